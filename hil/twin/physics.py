"""Nominal physics of an axis, and the mechanisms that are on."""

from dataclasses import dataclass

import numpy as np

from hil.twin.library import BY_ID
from hil.twin.mechanism import WIDTH, Moment, Stage, Variant
from hil.twin.structure.chain import Chain


@dataclass(frozen=True)
class Active:
    """Active mechanism: its id, its parameters in the library's order, its variant."""

    effect: str
    values: tuple[float, ...]
    variant: int = 0

    @property
    def form(self) -> Variant:
        """Its entry in the library."""
        return BY_ID[self.effect].variants[self.variant]

    @property
    def is_offset(self) -> bool:
        """True for a torque or force that is the same at each time, place and speed of a sliding axis."""
        if self.form.stage not in (Stage.MOTOR_TORQUE, Stage.TABLE_FORCE, Stage.BIAS):
            return False
        moments = (Moment(x, 0.0, 1e-3, 1e-4, 0.7 * x, x - 1.1, 0.3 * x, 1.0, 1.0) for x in (0.1, 0.9, 2.3, 71.0))
        values = np.array(self.values)
        added = {float(self.form.contribution(0.0, one, values, np.zeros(WIDTH))) for one in moments}
        return len(added) == 1 and added != {0.0}


@dataclass(frozen=True)
class Physics:
    """Nominal parameters of an axis, in motor units (rad, N m; on a linear axis m, N)."""

    chain: Chain
    coulomb_n_m: float
    viscous_n_m_s_rad: float
    linear: bool = False
    angle_per_unit: float = 1.0  # motor angle per motor unit: 1, or 2 pi / screw lead on a linear axis
    turn_known: bool = True  # False on a linear axis without a lead: there 2 pi of the motor angle are 1 m of travel

    @property
    def viscous_speed(self) -> float:
        """Speed at which viscous friction equals Coulomb friction [rad/s, m/s]; 0 without viscous friction."""
        return self.coulomb_n_m / self.viscous_n_m_s_rad if self.viscous_n_m_s_rad > 0.0 else 0.0
