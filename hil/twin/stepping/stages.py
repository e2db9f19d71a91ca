"""Compiled chains of the library's contributions, one for each stage of the stepping kernel.

Contributions of a stage are composed in the order of the library, so that a new mechanism needs no change here or in
the kernel. A mechanism that is off costs one comparison, and so does a stage without active mechanisms.
"""

from typing import Any, NamedTuple

from numba import njit

from hil.twin.library import SLOTS
from hil.twin.mechanism import Mechanism, Stage

_OUTSIDE = (Stage.VELOCITY_FILTER, Stage.CHAIN, Stage.CHANNEL, Stage.ANSWER)
KERNEL_STAGES = tuple(stage for stage in Stage if stage not in _OUTSIDE)


class Effects(NamedTuple):
    """The mechanisms as the stages take them: see `hil.twin.stepping.records`."""

    values: Any  # (slots, PARAMETERS)
    codes: Any  # record
    memory: Any  # (slots, WIDTH)


def stage_of(mechanism: Mechanism, variant: int) -> Stage:
    """Stage at which a variant enters."""
    return mechanism.variants[variant].stage


def _compose(entries: list[tuple[Any, int, int]]) -> Any:
    """Build a compiled `(value, at, effects) -> value` that runs the entries in order.

    An entry is (contribution, slot of the mechanism, bit mask of the variants that enter here).
    """
    if not entries:

        @njit
        def nothing(value: float, at: Any, effects: Any) -> Any:
            return value

        return nothing
    (contribution, index, mask), rest = entries[0], _compose(entries[1:])

    @njit(inline="always")
    def chained(value: float, at: Any, effects: Any) -> Any:
        code = effects.codes.slots[index]
        if code != 0 and (mask >> (code - 1)) & 1:
            value = contribution(value, at, effects.values[index], effects.memory[index])
        return rest(value, at, effects)

    return chained


def _stage(stage: Stage) -> Any:
    entries = []
    for index, mechanism in enumerate(SLOTS):
        masks: dict[Any, int] = {}
        for number, variant in enumerate(mechanism.variants):
            if variant.stage is stage:
                masks[variant.contribution] = masks.get(variant.contribution, 0) | 1 << number
        entries += [(contribution, index, mask) for contribution, mask in masks.items()]
    name, run = stage.value, _compose(entries)

    @njit(inline="always")
    def entered(value: float, at: Any, effects: Any) -> Any:
        if effects.codes[name]:
            value = run(value, at, effects)
        return value

    return entered


current = _stage(Stage.CURRENT)
torque = _stage(Stage.TORQUE)
motor_torque = _stage(Stage.MOTOR_TORQUE)
coulomb = _stage(Stage.COULOMB)
friction_scale = _stage(Stage.FRICTION_SCALE)
viscous_scale = _stage(Stage.VISCOUS_SCALE)
drag = _stage(Stage.DRAG)
bias = _stage(Stage.BIAS)
bristle = _stage(Stage.BRISTLE)
table_share = _stage(Stage.TABLE_SHARE)
table_viscous_share = _stage(Stage.TABLE_VISCOUS_SHARE)
transmission = _stage(Stage.TRANSMISSION)
screw = _stage(Stage.SCREW)
table_force = _stage(Stage.TABLE_FORCE)
motor_reading = _stage(Stage.MOTOR_READING)
table_reading = _stage(Stage.TABLE_READING)
