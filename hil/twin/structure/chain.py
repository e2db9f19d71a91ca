"""Physical parameters to a lumped chain: mass and stiffness matrices reduced to the motor shaft.

    [J] q'' + [C] q' + [K] q = tau                                          (Eq. 14)
    theta = x / r,  k_t = k_a r^2,  J = m r^2,  r = lead / (2 pi)            (Eq. 12-13)

Every coordinate is an angle of the motor shaft or its equivalent, which keeps the units alike.
A linear axis is the same chain with r = 1: its angles are metres and its torques newtons.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.twin.structure.ballscrew import RECONSTRUCTED_TABLE_1 as RECONSTRUCTED_TABLE_1
from hil.twin.structure.ballscrew import SevenDof, in_series

LINEAR_LEAD_M = 2.0 * pi
"""Lead of an axis without a screw: r = 1, so that motor and table share metres and newtons."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Chain of n lumped inertias, free to move as a rigid body. A value: chains of equal content are equal.

    `damping_ratio` holds one modal damping ratio per mode, in ascending frequency, 0 for the rigid
    body. `transmission @ q` is the deflection of the transmission spring, motor side minus table
    side [rad]; zeros where the chain has none. `screw @ q` is the deflection of the screw between its bearing and
    the nut; where that is no spring of its own, it is the transmission's. `damping_n_m_s_rad` (n, n) is [C] where
    the damping is not modal: the modes then share it, and `damping_ratio` is the own one of each.
    """

    inertia_kg_m2: FloatArray
    stiffness_n_m_rad: FloatArray
    lead_m: float
    damping_ratio: FloatArray
    names: tuple[str, ...]
    motor: int
    table: int
    transmission: FloatArray
    transmission_stiffness_n_m_rad: float
    screw: FloatArray
    screw_stiffness_n_m_rad: float
    damping_n_m_s_rad: FloatArray | None = None

    @cached_property
    def _content(self) -> tuple[object, ...]:
        values = (getattr(self, one.name) for one in fields(self))
        return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Chain) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)

    def side(self, place: int) -> FloatArray:
        """1 for each coordinate on the same side of the transmission as `place`, else 0; shape (n,)."""
        nut = self.transmission_stiffness_n_m_rad * np.outer(self.transmission, self.transmission)
        rest = np.abs(self.stiffness_n_m_rad - nut)
        reached = (rest > 1e-9 * np.max(np.abs(self.stiffness_n_m_rad))) | np.eye(len(self.names), dtype=bool)
        for _ in self.names:
            reached = reached @ reached
        return np.asarray(reached[place], dtype=np.float64)


def one_mass(mass_kg: float, lead_m: float = LINEAR_LEAD_M) -> Chain:
    """Build a rigid axis: motor and table are one mass [kg], seen at the table."""
    return serial_chain([mass_kg * (lead_m / (2.0 * pi)) ** 2], [], 0.0, lead_m, names=("axis",))


def two_mass(
    motor_mass_kg: float, table_mass_kg: float, stiffness_n_m: float, damping_ratio: float, lead_m: float
) -> Chain:
    """Build the 2-dof model of Eq. 1: motor and table mass [kg] and a spring [N/m], all seen at the table."""
    r2 = (lead_m / (2.0 * pi)) ** 2
    masses = (motor_mass_kg * r2, table_mass_kg * r2)
    return serial_chain(masses, [stiffness_n_m * r2], damping_ratio, lead_m, names=("motor", "table"))


def serial_chain(
    inertias_kg_m2: Sequence[float],
    stiffnesses_n_m_rad: Sequence[float],
    damping_ratio: float | Sequence[float],
    lead_m: float,
    *,
    names: Sequence[str] = (),
    transmission: int = -1,
) -> Chain:
    """Build n inertias in a row with n - 1 springs between them, all reduced to the motor shaft (Eq. 13).

    The first inertia carries the motor encoder, the last the linear encoder. `damping_ratio` is one
    number for all n - 1 elastic modes or one for each. `transmission` is the index of the spring that
    is the nut (default: the last). Raises ValueError where the lengths do not fit.
    """
    ratios = damping_ratio if isinstance(damping_ratio, float | int) else tuple(damping_ratio)
    return _serial_chain(
        tuple(inertias_kg_m2), tuple(stiffnesses_n_m_rad), ratios, lead_m, names=tuple(names), transmission=transmission
    )


@lru_cache(maxsize=256)
def _serial_chain(
    inertias_kg_m2: tuple[float, ...],
    stiffnesses_n_m_rad: tuple[float, ...],
    damping_ratio: float | tuple[float, ...],
    lead_m: float,
    *,
    names: tuple[str, ...],
    transmission: int,
) -> Chain:
    n = len(inertias_kg_m2)
    if n < 1 or len(stiffnesses_n_m_rad) != n - 1:
        raise ValueError(
            f"stiffnesses_n_m_rad must have one entry fewer than inertias_kg_m2 ({n}), got {len(stiffnesses_n_m_rad)}"
        )
    if names and len(names) != n:
        raise ValueError(f"names must have one entry per inertia ({n}), got {len(names)}")
    spring = np.eye(n - 1, n) - np.eye(n - 1, n, k=1)
    stiffness = np.asarray(stiffnesses_n_m_rad, dtype=float)
    nut = (spring[transmission], float(stiffness[transmission])) if n > 1 else (np.zeros(1), 0.0)
    return Chain(
        inertia_kg_m2=np.diag(np.asarray(inertias_kg_m2, dtype=float)),
        stiffness_n_m_rad=spring.T @ (stiffness[:, None] * spring),
        lead_m=lead_m,
        damping_ratio=_elastic_damping(damping_ratio, n),
        names=names or tuple(f"inertia {i + 1}" for i in range(n)),
        motor=0,
        table=n - 1,
        transmission=nut[0],
        transmission_stiffness_n_m_rad=nut[1],
        screw=nut[0],
        screw_stiffness_n_m_rad=nut[1],
    )


def _elastic_damping(damping_ratio: float | Sequence[float], n: int) -> FloatArray:
    """(n,) ratios: 0 for the rigid body, then one per elastic mode."""
    ratios = np.zeros(n)
    elastic = np.atleast_1d(np.asarray(damping_ratio, dtype=float))
    if elastic.size not in (1, n - 1):
        raise ValueError(f"damping_ratio must be one number or {n - 1} numbers, got {elastic.size}")
    ratios[1:] = elastic
    return ratios


def seven_dof(parameters: SevenDof, damping_ratio: float, nut_position_m: float | None = None) -> Chain:
    """Build the 7-dof chain of Fig. 4 and Eq. 14 with the nut anywhere between the bearings.

    Potential energy, with axial stiffnesses reduced by Eq. 13 (theta5 is the axial motion of the screw):
        k_t1 (t1 - t2)^2 + k_t2 (t2 - t3)^2 + k_t3 (t3 - t4)^2 + k_t4 t5^2
            + k_t5 (t4 + t5 - t6)^2 + k_t6 (t6 - t7)^2,   all / 2
    `damping_ratio` holds for all six elastic modes. The default nut position is the reference.
    Raises ValueError where the nut lies outside the bearings.
    """
    spring = np.array(
        [
            [1, -1, 0, 0, 0, 0, 0],
            [0, 1, -1, 0, 0, 0, 0],
            [0, 0, 1, -1, 0, 0, 0],
            [0, 0, 0, 0, 1, 0, 0],
            [0, 0, 0, 1, 1, -1, 0],
            [0, 0, 0, 0, 0, 1, -1],
        ],
        dtype=float,
    )
    inertias, stiffnesses = parameters.reduced(nut_position_m)
    return Chain(
        inertia_kg_m2=np.diag(inertias),
        stiffness_n_m_rad=spring.T @ (stiffnesses[:, None] * spring),
        lead_m=parameters.lead_m,
        damping_ratio=_elastic_damping(damping_ratio, 7),
        names=("motor", "coupling, motor side", "coupling, screw side", "screw at nut", "screw, axial", "nut", "table"),
        motor=0,
        table=6,
        transmission=spring[4],
        transmission_stiffness_n_m_rad=float(stiffnesses[4]),
        # torsion and axial give: both carry the load, and both are longer the farther the nut is away
        screw=spring[2] - spring[3],
        screw_stiffness_n_m_rad=in_series(float(stiffnesses[2]), float(stiffnesses[3])),
    )
