"""A twin as the arrays that the compiled kernel takes; where what stands in them: `hil.twin.stepping.layout`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.control import cascade
from hil.twin.library import BY_ID, SLOTS
from hil.twin.mechanism import PARAMETERS
from hil.twin.physics import Active, Physics
from hil.twin.stepping import layout, stages
from hil.twin.structure.chain import Chain
from hil.twin.structure.modal import Modal, discretise

Arrays = tuple[FloatArray, FloatArray, FloatArray, NDArray[np.int64]]  # constants, modes, mechanism values and codes

_ROUNDING = 1e-12  # of all damping
# The step is fine while the motor moves slower than this, or could reverse within two ticks. Alike for a lead of 10 mm.
SLOW_RAD_S, SLOW_M_S = 0.02, 32e-6


class Steps(NamedTuple):
    """Internal steps per control tick."""

    coarse: int
    fine: int


def pack_modes(own: Chain, chain: Chain, modes: Modal, period_s: float, steps: Steps) -> FloatArray:
    """Rows for each mode (layout.COUPLING + m, m). `own`: the chain before mechanisms added to it."""
    rows = np.empty((layout.COUPLING + modes.frequency_rad_s.size, modes.frequency_rad_s.size))
    rows[layout.COARSE : layout.COARSE + 6] = discretise(modes, period_s / steps.coarse)
    rows[layout.FINE : layout.FINE + 6] = discretise(modes, period_s / steps.fine)
    rows[layout.SHAPE_MOTOR] = modes.shape[modes.motor]
    rows[layout.SHAPE_TABLE] = modes.shape[modes.table]
    rows[layout.SHAPE_SPRING] = modes.transmission
    rows[layout.SHAPE_SCREW] = modes.screw
    # the coordinates that mechanisms add come after those of the chain, and stay
    for row, place in ((layout.TABLE_IMPULSE, own.table), (layout.MOTOR_IMPULSE, own.motor)):
        rows[row] = own.inertia_kg_m2 @ own.side(place) @ modes.shape[: len(own.names)]
    rows[layout.TABLE_SIDE] = chain.inertia_kg_m2 @ chain.side(chain.table) @ modes.shape
    modal = np.diag(2.0 * modes.damping_ratio * modes.frequency_rad_s)
    given = chain.damping_n_m_s_rad
    damping = modal if given is None else modes.shape.T @ given @ modes.shape
    rows[layout.COUPLING :] = damping - modal
    # a side that is the whole axis is damped by rounding alone, which no play may take away
    resisting = damping @ rows[layout.TABLE_SIDE]
    some = resisting @ rows[layout.TABLE_SIDE] > _ROUNDING * np.trace(damping) * np.sum(rows[layout.TABLE_SIDE] ** 2)
    rows[layout.SHAPE_DAMPER] = -resisting if some else 0.0
    return rows


def pack_constants(
    physics: Physics, active: Sequence[Active], gains: cascade.Gains, observer_s: float, modes: FloatArray, steps: Steps
) -> FloatArray:
    """Entries (layout.CONSTANTS,); `modes` as packed."""
    constants = np.zeros(layout.CONSTANTS)
    chain = physics.chain
    constants[layout.PERIOD] = gains.period_s
    constants[layout.RATIO] = gains.ratio_m_rad
    constants[layout.ANGLE_PER_UNIT] = physics.angle_per_unit
    constants[layout.COULOMB] = physics.coulomb_n_m
    constants[layout.VISCOUS] = physics.viscous_n_m_s_rad
    constants[layout.VISCOUS_SPEED] = physics.viscous_speed
    constants[layout.SPRING] = chain.transmission_stiffness_n_m_rad
    constants[layout.SCREW] = chain.screw_stiffness_n_m_rad
    constants[layout.SCREW_APART] = float(not np.array_equal(chain.screw, chain.transmission))
    # C s and s^T C s: what of the damping resists the two sides of the transmission moving apart as two bodies. In
    # play it is gone; where a lead errs, it counts from where that puts the table. What is left drives no mode.
    constants[layout.DAMPER] = -modes[layout.SHAPE_DAMPER] @ modes[layout.TABLE_SIDE]
    constants[layout.COARSE_STEPS], constants[layout.FINE_STEPS] = steps
    constants[layout.OBSERVER] = observer_s
    constants[layout.SLOW_VELOCITY] = SLOW_M_S if physics.linear else SLOW_RAD_S
    variants = [BY_ID[one.effect].variants[one.variant] for one in active]
    constants[layout.PLAY] = float(any(variant.play for variant in variants))
    constants[layout.SLIPS] = float(any(variant.slips for variant in variants))
    motor, table = modes[layout.SHAPE_MOTOR], modes[layout.SHAPE_TABLE]
    for at, first in ((layout.COARSE_GAINS, layout.COARSE), (layout.FINE_GAINS, layout.FINE)):
        per_torque = modes[first + 5]
        constants[at : at + 3] = motor * per_torque @ motor, motor * per_torque @ table, table * per_torque @ table
    # what a spring gives beside the modes is held over a step, and modes of a long chain are faster than a coarse one
    softens = any(BY_ID[one.effect].softens for one in active)
    elastic = np.count_nonzero(modes[layout.SHAPE_SPRING, 1:])
    constants[layout.ALWAYS_FINE] = float(softens and elastic > 1)
    return constants


def pack_mechanisms(active: Sequence[Active], coupled: bool) -> tuple[FloatArray, NDArray[np.int64]]:
    """Values (slots, PARAMETERS) and codes (layout.CODES,); `coupled`: whether modes share damping.

    Raises ValueError where a mechanism acts more often than it may.
    """
    values = np.zeros((len(SLOTS), PARAMETERS))
    codes = np.zeros(layout.CODES, dtype=np.int64)
    codes[layout.ON_COUPLING] = codes[layout.ON_ANY] = coupled
    free = dict(enumerate(SLOTS))
    for one in active:
        mechanism = BY_ID[one.effect]
        slot = next((slot for slot, other in free.items() if other is mechanism), None)
        if slot is None:
            raise ValueError(f"{mechanism.id} must act at most {mechanism.most} times at once, got more")
        del free[slot]
        stage = stages.stage_of(mechanism, one.variant)
        if stage not in stages.KERNEL_STAGES:
            continue
        values[slot, : len(one.values)] = one.values
        values[slot, PARAMETERS - 1] = one.variant
        codes[slot] = one.variant + 1
        codes[len(SLOTS) + stages.KERNEL_STAGES.index(stage)] = 1
        codes[layout.ON_ANY] = 1
    return values, codes
