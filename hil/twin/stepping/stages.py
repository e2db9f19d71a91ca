"""Compiled chains of the library's contributions, one for each stage of the stepping kernel.

Contributions of a stage are composed in the order of the library, so that adding a mechanism needs no
change here or in the kernel. A mechanism that is off is one comparison; a stage without any
active mechanism is not entered at all.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from hil.twin.library import SLOTS
from hil.twin.mechanism import Mechanism, Stage

# fmt: off
KERNEL_STAGES = (
    Stage.CURRENT, Stage.TORQUE, Stage.MOTOR_TORQUE, Stage.COULOMB, Stage.FRICTION_SCALE, Stage.DRAG,
    Stage.BIAS, Stage.BRISTLE, Stage.TABLE_SHARE, Stage.TRANSMISSION, Stage.SCREW, Stage.TABLE_FORCE,
    Stage.MOTOR_READING, Stage.TABLE_READING,
)
# fmt: on


def stage_of(mechanism: Mechanism, variant: int) -> Stage:
    """Stage at which a variant enters."""
    return mechanism.variants[variant].stage


def _compose(entries: list[tuple[Any, int, int]]) -> Any:
    """A compiled `(value, at, values, codes, memory) -> value` that runs the entries in order.

    An entry is (contribution, slot of the mechanism, bit mask of the variants that enter here).
    """
    if not entries:

        @njit
        def nothing(value: float, at: Any, values: Any, codes: Any, memory: Any) -> Any:
            return value

        return nothing
    (contribution, index, mask), rest = entries[0], _compose(entries[1:])

    @njit(inline="always")
    def chained(value: float, at: Any, values: Any, codes: Any, memory: Any) -> Any:
        code = codes[index]
        if code != 0 and (mask >> (code - 1)) & 1:
            value = contribution(value, at, values[index], memory[index])
        return rest(value, at, values, codes, memory)

    return chained


def _stage(stage: Stage) -> Any:
    entries = []
    for index, mechanism in enumerate(SLOTS):
        masks: dict[Any, int] = {}
        for number, variant in enumerate(mechanism.variants):
            if variant.stage is stage:
                masks[variant.contribution] = masks.get(variant.contribution, 0) | 1 << number
        entries += [(contribution, index, mask) for contribution, mask in masks.items()]
    return _compose(entries)


current = _stage(Stage.CURRENT)
torque = _stage(Stage.TORQUE)
motor_torque = _stage(Stage.MOTOR_TORQUE)
coulomb = _stage(Stage.COULOMB)
friction_scale = _stage(Stage.FRICTION_SCALE)
drag = _stage(Stage.DRAG)
bias = _stage(Stage.BIAS)
bristle = _stage(Stage.BRISTLE)
table_share = _stage(Stage.TABLE_SHARE)
transmission = _stage(Stage.TRANSMISSION)
screw = _stage(Stage.SCREW)
table_force = _stage(Stage.TABLE_FORCE)
motor_reading = _stage(Stage.MOTOR_READING)
table_reading = _stage(Stage.TABLE_READING)
