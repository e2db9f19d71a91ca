"""Quantities of columns whose names give none, by their relations to a position, or to a speed that a letter names."""

from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.identification.derivatives import MeasuredMotion, motion, smoothed
from hil.importing.column_names import Label
from hil.importing.lexicon import Quantity
from hil.importing.relations import (
    IS_DERIVATIVE,
    SAME_POSITION,
    SMOOTH,
    derivative_of,
    driven,
    noise,
    proportional,
    roughness,
)

IS_DRIVEN = 0.4  # share of an unnamed effort that one mass with friction explains: gravity and springs may be more
_EFFORT = "torque, force, current or voltage"


def quantities_by_relations(
    live: dict[str, FloatArray], told: dict[str, Label], period_s: float
) -> tuple[dict[str, Label], dict[str, str]]:
    """Labels with the quantities of columns (n,) whose names give none, and how these were found."""
    labels, how = dict(told), dict[str, str]()
    for name in live:  # a letter is a name by chance: the data say more, where they say something
        if told[name].letter and told[name].unit is None:
            labels[name] = replace(told[name], quantity=Quantity.UNKNOWN)
    unnamed = [name for name in live if labels[name].quantity is Quantity.UNKNOWN and not _switches(live[name])]
    positions = [name for name in live if labels[name].quantity is Quantity.POSITION]
    if not unnamed:
        return labels, how

    def become(name: str, quantity: Quantity, found: str) -> None:
        labels[name] = replace(labels[name], quantity=quantity)
        how[name] = found

    if not positions:
        smooth = [name for name in unnamed if roughness(live[name]) < SMOOTH]
        named = [name for name in smooth if told[name].quantity is Quantity.POSITION]
        scores = {name: _as_position(name, live, period_s) for name in named or smooth}
        if named and max(scores.values()) < IS_DRIVEN:
            scores = {name: _as_position(name, live, period_s) for name in smooth}
        best = max(scores, key=lambda name: scores[name], default=None)
        if best is None or scores[best] < IS_DRIVEN:
            return told, how
        if speed := _better_as_told(best, live, told, period_s):
            if not any(one.quantity is Quantity.EFFORT for one in told.values()):
                moved_by = motion(np.cumsum(live[speed]) * period_s, period_s)
                untold = [name for name in live if told[name].quantity is Quantity.UNKNOWN]
                shares = {name: driven(live[name], moved_by, period_s).share for name in untold}
                name = max(shares, key=lambda one: shares[one])
                if shares[name] > IS_DRIVEN:
                    become(name, Quantity.EFFORT, f"{_EFFORT}: inertia and friction of {speed} explain it")
            return told | {name: labels[name] for name in how}, how
        become(best, Quantity.POSITION, "a position: other columns follow from its derivatives")
        positions, unnamed = [best], [name for name in unnamed if name != best]
    # a name says more than the motion, which explains a current with cogging or gravity in it badly
    effort_told = any(one.quantity is Quantity.EFFORT and not one.command and not one.part for one in told.values())
    for name in unnamed:
        moved = {position: motion(live[position], period_s) for position in positions}
        if any(proportional(live[name], live[position]).share > SAME_POSITION for position in positions):
            become(name, Quantity.POSITION, f"a position: it follows {positions[0]}")
        elif any(derivative_of(live[name], one, period_s).share > IS_DERIVATIVE for one in moved.values()):
            become(name, Quantity.VELOCITY, f"a velocity: it is the derivative of {positions[0]}")
        elif any(_accelerates(live[name], one, period_s) for one in moved.values()):
            become(name, Quantity.ACCELERATION, f"an acceleration: the second derivative of {positions[0]}")
        elif not effort_told and max(driven(live[name], one, period_s).share for one in moved.values()) > IS_DRIVEN:
            become(name, Quantity.EFFORT, f"{_EFFORT}: inertia and friction of {positions[0]} explain it")
        elif told[name].quantity is not Quantity.UNKNOWN:
            labels[name] = told[name]
    return labels, how


def _switches(values: FloatArray) -> bool:
    """True for a column of two values: a switch or a state, no channel of the motion."""
    return bool(np.all((values == values.min()) | (values == values.max())))


def _better_as_told(best: str, live: dict[str, FloatArray], told: dict[str, Label], period_s: float) -> str:
    """Speed by its letter that explains the efforts better than `best` does as a position; "" without one.

    The efforts are those that letters name, else the columns of which nothing is told. A speed that is the derivative
    of `best` says that it is one.
    """
    speeds = [name for name in live if told[name].quantity is Quantity.VELOCITY and not told[name].command]
    moved = motion(live[best], period_s)
    if any(derivative_of(live[name], moved, period_s).share > IS_DERIVATIVE for name in speeds):
        return ""
    kinds = [[name for name in live if told[name].quantity is kind] for kind in (Quantity.EFFORT, Quantity.UNKNOWN)]
    efforts = [name for name in kinds[0] or kinds[1] if name != best]

    def explained(of: MeasuredMotion) -> float:
        return max(driven(live[name], of, period_s).share for name in efforts)

    if not speeds or not efforts:
        return ""
    by_speed = {name: explained(motion(np.cumsum(live[name]) * period_s, period_s)) for name in speeds}
    speed = max(by_speed, key=lambda name: by_speed[name])
    return speed if by_speed[speed] > explained(moved) else ""


def _as_position(name: str, live: dict[str, FloatArray], period_s: float) -> float:
    """Sum of the shares of the other columns that the derivatives of `name`, as a position, explain."""
    moved = motion(live[name], period_s)
    total = 0.0
    for other, values in live.items():
        if other == name or proportional(values, live[name]).share > SAME_POSITION:
            continue
        total += max(derivative_of(values, moved, period_s).share, driven(values, moved, period_s).share)
    return total - 0.01 * noise(live[name])


def _accelerates(values: FloatArray, moved: MeasuredMotion, period_s: float) -> bool:
    return proportional(smoothed(values, period_s), moved.acceleration).share > IS_DERIVATIVE
