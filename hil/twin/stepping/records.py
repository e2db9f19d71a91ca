"""Records that the compiled kernels work on, and their packing from a twin.

`constants`, `codes` and `memory` are arrays of one record; `modes` (21 + n, n) has a row for each quantity of the n
modes, read through `shapes_of`, `step_of` and `coupling_of`; `values` (slots, PARAMETERS) holds the parameters of the
mechanisms.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.control import cascade
from hil.twin.library import BY_ID, SLOTS
from hil.twin.mechanism import PARAMETERS, WIDTH, Contact
from hil.twin.physics import Active, Physics
from hil.twin.stepping.contact import ELEMENTS
from hil.twin.stepping.stages import KERNEL_STAGES
from hil.twin.structure.chain import Chain
from hil.twin.structure.modal import Discrete, Modal, discretise, lowest_modes

_ROUNDING = 1e-12  # of all damping: below, a whole axis as one side has only rounding of it
_STEEP = 8  # exponent: 0.4 % of a mode of a quarter turn per tick are left out, 99.6 % of one of a whole turn
# The step is fine while motor or table moves slower than this, or could reverse within two ticks; the axis then rests
# for the observer of its table. Alike for a lead of 10 mm; SLOW_M_S is in rad/s where the table turns.
SLOW_RAD_S, SLOW_M_S = 0.02, 32e-6

# An internal step: number per control tick, velocity of the motor or table per unit of torque on the motor or table.
_STEP = np.dtype([("number", np.int64)] + [(name, np.float64) for name in ("motor_gain", "cross_gain", "table_gain")])
_NUMBERS = (
    "period", "ratio", "angle_per_unit", "coulomb", "viscous", "viscous_speed", "spring", "screw", "damper",
    "slow_velocity", "observer",
)  # fmt: skip
_FLAGS = ("any_active", "coupled", "always_fine", "play", "slips", "screw_apart", "rigid")
CONSTANTS = np.dtype(
    [(name, np.float64) for name in _NUMBERS]
    + [(name, np.int64) for name in _FLAGS]
    + [("coarse", _STEP), ("fine", _STEP)],
    align=True,
)
# Variant + 1 of the mechanism in each slot (0: off), then whether each stage has an active mechanism.
CODES = np.dtype([("slots", np.int64, (len(SLOTS),))] + [(stage.value, np.int64) for stage in KERNEL_STAGES])
MEMORY = np.dtype(
    [
        ("mechanisms", np.float64, (len(SLOTS), WIDTH)),
        ("clock", np.float64),  # [s]
        ("push", np.float64),  # force on the table over this tick beside the mechanisms [N]
        ("spring_extra", np.float64),  # deflection by mechanisms of the transmission at the last step
        ("floating", np.float64),  # 1: the table floats in a gap
        ("carried", np.float64),  # table of a rigid axis [motor units]
        ("last_speed", np.float64),  # of the motor at the last tick
        # torques of the slip elements of each contact; the first is the deflection of a contact after Dahl
        ("motor_contact", np.float64, (ELEMENTS,)),
        ("table_contact", np.float64, (ELEMENTS,)),
    ],
    align=True,
)


class Arrays(NamedTuple):
    """A twin as the kernels take it."""

    constants: NDArray[np.void]
    modes: FloatArray
    values: FloatArray
    codes: NDArray[np.void]


class Axis(NamedTuple):
    """A twin as the kernels take it, with its state: `delta` (2, n) of the modes, and `memory`."""

    constants: NDArray[np.void]
    modes: FloatArray
    values: FloatArray
    codes: NDArray[np.void]
    delta: FloatArray
    memory: NDArray[np.void]


class Shapes(NamedTuple):
    """Shares of the modes (n,) in displacements and forces."""

    motor: FloatArray
    table: FloatArray
    spring: FloatArray  # deflection of the transmission
    screw: FloatArray  # deflection of the screw
    damper: FloatArray  # damping against the sides of the transmission moving apart
    table_side: FloatArray  # momentum of the table side of the transmission, all that mechanisms added included
    table_impulse: FloatArray  # momentum of the table side of the nominal chain
    motor_impulse: FloatArray  # and of its motor side
    held_impulse: FloatArray  # of its motor side and of what moves with it as one body


@njit(inline="always")
def step_of(modes, fine):  # type: ignore[no-untyped-def]
    """Exact discretisation of the coarse or the fine step, each (n,)."""
    k = 6 if fine else 0
    return Discrete(modes[k], modes[k + 1], modes[k + 2], modes[k + 3], modes[k + 4], modes[k + 5])


@njit(inline="always")
def shapes_of(modes):  # type: ignore[no-untyped-def]
    """Shares of the modes in displacements and forces."""
    return Shapes(modes[12], modes[13], modes[14], modes[15], modes[16], modes[17], modes[18], modes[19], modes[20])


@njit(inline="always")
def coupling_of(modes):  # type: ignore[no-untyped-def]
    """Damping that modes share (n, n)."""
    return modes[21:]


def start_memory() -> NDArray[np.void]:
    """Memory before the first step."""
    return np.zeros(1, MEMORY)


def pack(
    physics: Physics,
    chain: Chain,
    modes: int | None,
    gains: cascade.Gains,
    active: Sequence[Active],
    steps: tuple[int, int],
    observer_s: float,
) -> Arrays:
    """Pack a twin; `chain`: with the changes by mechanisms; `modes`: the lowest ones kept; `steps`: coarse and fine
    ones per tick.

    Raises ValueError where a mechanism acts more often than it may.
    """
    values, codes = _pack_mechanisms(active)
    packed = _pack_modes(physics.chain, chain, modes, gains.period_s, steps)
    constants = np.zeros(1, CONSTANTS)
    c = constants[0]
    c["period"], c["ratio"], c["observer"] = gains.period_s, gains.ratio_m_rad, observer_s
    c["angle_per_unit"], c["viscous_speed"] = physics.angle_per_unit, physics.viscous_speed
    c["coulomb"], c["viscous"] = physics.coulomb_n_m, physics.viscous_n_m_s_rad
    c["slow_velocity"] = SLOW_M_S if physics.linear else min(SLOW_RAD_S, SLOW_M_S / gains.ratio_m_rad)
    c["spring"] = physics.chain.transmission_stiffness_n_m_rad
    c["screw"] = physics.chain.screw_stiffness_n_m_rad
    c["rigid"] = not physics.chain.transmission.any()
    c["screw_apart"] = not np.array_equal(physics.chain.screw, physics.chain.transmission)
    c["damper"], c["coarse"], c["fine"] = packed.damper, packed.coarse, packed.fine
    for contact in Contact:
        c[contact.value] = any(one.form.contact is contact for one in active)
    c["coupled"] = chain.damping_n_m_s_rad is not None
    c["any_active"] = c["coupled"] or codes["slots"].any()
    # a spring's change beside the modes is held over a step, and modes of a long chain are faster than a coarse one
    c["always_fine"] = any(BY_ID[one.effect].softens for one in active) and packed.springs > 1
    return Arrays(constants, packed.rows, values, codes)


class _PackedModes(NamedTuple):
    """Modes as the kernels take them: `rows` (21 + n, n), and what a mechanism or a step does to them.

    `damper` is the damping against the sides of the transmission moving apart, `springs` the number of elastic modes
    that deflect it; `coarse` and `fine` are records of a step.
    """

    rows: FloatArray
    damper: float
    springs: int
    coarse: tuple[float, ...]
    fine: tuple[float, ...]


@lru_cache(maxsize=256)
def _pack_modes(own: Chain, chain: Chain, number: int | None, period_s: float, steps: tuple[int, int]) -> _PackedModes:
    """Pack the modes of a chain; `own`: the chain without the coordinates that mechanisms add after its own."""
    modes = lowest_modes(chain, number)
    coarse, fine = (discretise(modes, period_s / each) for each in steps)
    modal_damping = np.diag(2.0 * modes.damping_ratio * modes.frequency_rad_s)
    given = chain.damping_n_m_s_rad
    damping = modal_damping if given is None else modes.shape.T @ given @ modes.shape
    shapes = _pack_shapes(own, chain, modes, damping, period_s)
    motor, table = shapes.motor, shapes.table
    gains = [
        (float(each), float(motor * step.b2 @ motor), float(motor * step.b2 @ table), float(table * step.b2 @ table))
        for each, step in zip(steps, (coarse, fine), strict=True)
    ]
    return _PackedModes(
        rows=np.vstack([*coarse, *fine, *shapes, damping - modal_damping]),
        # s^T C s: resists the two sides of the transmission moving apart as two bodies. Play removes it; for a lead
        # error the table's place with the error counts. The rest of the damping drives no mode.
        damper=float(-shapes.damper @ shapes.table_side),
        springs=int(np.count_nonzero(shapes.spring[1:])),
        coarse=gains[0],
        fine=gains[1],
    )


def _shown(impulse: FloatArray, place: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """An impulse (n,) with little of each mode that turns by more than half a turn per tick, and its shift of a place.

    Ticks do not show such a mode (Nyquist): corrections at each tick would excite its alias.
    """
    shown = impulse / (1.0 + (angle_rad / np.pi) ** _STEEP)
    return shown * ((place @ impulse) / (place @ shown))


def _pack_shapes(own: Chain, chain: Chain, modes: Modal, damping: FloatArray, period_s: float) -> Shapes:
    """Shares of the modes."""
    n = len(own.names)
    table_side = chain.inertia_kg_m2 @ chain.side(chain.table) @ modes.shape
    table, motor = (chain.inertia_kg_m2[:n, :n] @ own.side(place) @ modes.shape[:n] for place in (own.table, own.motor))
    # a side that is the whole axis is damped by rounding alone, which play must not remove
    resisting = damping @ table_side
    some = resisting @ table_side > _ROUNDING * np.trace(damping) * np.sum(table_side**2)
    damper = -resisting if some else np.zeros(resisting.size)
    at_motor, at_table = modes.shape[modes.motor], modes.shape[modes.table]
    held = _shown(motor, at_motor, modes.frequency_rad_s * period_s)
    return Shapes(at_motor, at_table, modes.transmission, modes.screw, damper, table_side, table, motor, held)


def _pack_mechanisms(active: Sequence[Active]) -> tuple[FloatArray, NDArray[np.void]]:
    """Values (slots, PARAMETERS) and codes of the mechanisms that act in the kernel."""
    values, codes = np.zeros((len(SLOTS), PARAMETERS)), np.zeros(1, CODES)
    record: Any = codes[0]
    free = dict(enumerate(SLOTS))
    for one in active:
        mechanism = BY_ID[one.effect]
        slot = next((slot for slot, other in free.items() if other is mechanism), None)
        if slot is None:
            raise ValueError(f"{mechanism.id} must act at most {mechanism.most} times at once, got more")
        del free[slot]
        if one.form.stage in KERNEL_STAGES:
            values[slot, : len(one.values)] = one.values
            record["slots"][slot], record[one.form.stage.value] = one.variant + 1, 1
    return values, codes
