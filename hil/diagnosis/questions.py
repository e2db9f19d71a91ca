"""Quantities over which the residual of a twin is asked for structure, and what of it is asked."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.moment_of_change import MomentOfChange, SteadyChange, moment_of_change, steady_change
from hil.diagnosis.result import CLOCK, MOMENT, TREND
from hil.identification.dataset import Dataset
from hil.identification.derivatives import MeasuredMotion
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import intended_motion, measured_motion
from hil.identification.least_squares import Columns
from hil.identification.periods import refined_period, strongest_periods
from hil.identification.plain_model import PlainModel, plain_columns
from hil.identification.structure import BINS, ResidualSeries
from hil.quantities import digits, quantity

_ROWS = 4.0  # per period of a line: less is an alias
_MOST_PERIODS = 4000  # of a line over the travel
_LONGEST = 0.5  # period of a line over the travel: seen twice
POSITION, SPEED, OFFSET = "position", "speed", "offset"
# Of the recorded torque, a coefficient that may change as those of the plain model; and of the second encoder.
LATENESS, ENCODER_LATENESS = "lateness", "encoder lateness"


@dataclass(frozen=True, eq=False)
class Question:
    """A quantity (n,) of each run that a residual may depend on, in a unit.

    `length` is the unit of positions, m or rad. `by_direction`: it is counted from its `least` value on, and further by
    `by_direction` where the axis moves up. `choices`: number of quantities of which the residual itself chose this one.
    `period`: what the position is folded on, 0 for none. `change`: asked is from which moment on a coefficient of the
    plain model is another one, or at which rate it changes.
    """

    name: str
    unit: str
    length: str
    values: tuple[FloatArray, ...]
    bins: int = BINS
    by_direction: float = 0.0
    least: float = 0.0
    choices: int = 1
    period: float = 0.0
    change: MomentOfChange | SteadyChange | None = None


def everywhere(hypothesis: Hypothesis, data: Dataset, plain: PlainModel) -> list[Question]:
    """Quantities that mean the same in every recording, of the intended motion.

    The measured speed moves with the disturbances of the loop, which the residual has, too: it would sort the rows of a
    constant feed by them.
    """
    motions = [intended_motion(run) for run in data.runs]
    axis, ratio = hypothesis.bench.axis, hypothesis.bench.axis.ratio_m_rad
    length = "rad" if axis.turns else "m"
    speed = [ratio * moved.velocity for moved in motions]
    position = [ratio * moved.position for moved in motions]
    since = [ratio * _since_reversal(moved) for moved in motions]
    load = [plain.predict(moved) for moved in motions]
    power = [one * moved.velocity for one, moved in zip(load, motions, strict=True)]

    def by_direction(name: str, unit: str, values: Sequence[FloatArray]) -> Question:
        least = min(float(one.min()) for one in values)
        range_ = 1.001 * (max(float(one.max()) for one in values) - least)
        by_way = (one - least + range_ * (moved.velocity > 0.0) for one, moved in zip(values, motions, strict=True))
        return Question(name, unit, length, tuple(by_way), 2 * BINS, range_, least)

    low = min(float(one.min()) for one in position)
    return [
        Question(POSITION, length, length, tuple(position)),
        by_direction("distance from the first position", length, [one - low for one in position]),
        # presliding contacts, covers and cables that are dragged along
        by_direction("distance from the last reversal", length, since),
        Question(SPEED, f"{length}/s", length, tuple(speed)),
        # friction of a load has its sign
        by_direction("load", axis.drive_unit, load),
        # at the limit of its voltage a drive gives less torque while the motor drives, and not while it brakes
        *([] if axis.drive_unit == "V" else [by_direction("power", "W", power)]),
    ]


def _since_reversal(moved: MeasuredMotion) -> FloatArray:
    """Distance (n,) from where the motion last turned, or from the first row [motor units]."""
    way = moved.direction
    moving = np.flatnonzero(way)
    turns = moving[1:][way[moving[1:]] != way[moving[:-1]]]  # first row of each way but the first
    begins = np.concatenate([[0], turns])
    last = begins[np.searchsorted(begins, np.arange(way.size), side="right") - 1]
    return np.asarray(np.abs(moved.position - moved.position[last]))


def over_time(hypothesis: Hypothesis, data: Dataset) -> Question:
    """Time, by direction, as friction changes."""
    length = "rad" if hypothesis.bench.axis.turns else "m"
    begin = min(float(run.time_s[0]) for run in data.runs)
    since = [run.time_s - begin for run in data.runs]
    duration = 1.001 * max(float(one[-1]) for one in since)
    up = [measured_motion(run).moved.velocity > 0.0 for run in data.runs]
    later = tuple(one + duration * moves for one, moves in zip(since, up, strict=True))
    return Question("time", "s", length, later, 2 * BINS, duration, begin)


def change_over_time(
    data: Dataset, parts: Sequence[ResidualSeries], plain: PlainModel
) -> MomentOfChange | SteadyChange | None:
    """How a coefficient of the plain model, or the delay of the torque, changes: at a moment, or steadily.

    Steadily the coefficient of least chance; beside the moment the one that explains more if chance makes neither, else
    that of less chance. None where the rows tell none.
    """
    turning = plain.load_ratio if "sine" in plain.fit.names else None  # an arc that tells gravity
    columns = [
        {**plain_columns(moved, turning), LATENESS: _of_lateness(moved, plain, run.period_s)}
        for run in data.runs
        for moved in [measured_motion(run).moved]
    ]
    times_s = [run.time_s for run in data.runs]
    if not any(one[LATENESS][part.rows].any() for one, part in zip(columns, parts, strict=True)):  # one speed
        columns = [{name: one[name] for name in one if name != LATENESS} for one in columns]
    steady = [steady_change(parts, columns, times_s, name, len(columns[0])) for name in columns[0]]
    surest = min(filter(None, steady), key=lambda one: one.course.p, default=None)
    told = [one for one in (moment_of_change(parts, columns, times_s), surest) if one]
    if told and all(one.course.p < CRITERIA.significance for one in told):
        return max(told, key=lambda one: one.course.energy)
    return min(told, key=lambda one: one.course.p, default=None)


def clocks_of_encoders(data: Dataset, parts: Sequence[ResidualSeries]) -> SteadyChange | None:
    """How the lateness of the second encoder changes steadily; None where another change tells more, or rows are few.

    Others are a reversal error or a twist by acceleration that changes steadily, and any of these at a moment.
    """
    ratio, columns = data.bench.axis.ratio_m_rad, list[Columns]()
    for run in data.runs:
        moved = measured_motion(run).moved
        place = {"ratio": ratio * moved.position, "datum": np.ones(moved.position.size)}
        bends = {"reversal": moved.direction, "twist": moved.acceleration}
        columns.append({ENCODER_LATENESS: -ratio * moved.velocity, **place, **bends})
    times_s = [run.time_s for run in data.runs]
    names = (ENCODER_LATENESS, "reversal", "twist")
    steady = [found for name in names if (found := steady_change(parts, columns, times_s, name))]
    moment = moment_of_change(parts, columns, times_s)
    told: list[MomentOfChange | SteadyChange] = [*steady, *([moment] if moment else [])]
    best = min(told, key=lambda one: one.course.p, default=None)
    return best if isinstance(best, SteadyChange) and best.coefficient == ENCODER_LATENESS else None


def about(change: MomentOfChange | SteadyChange) -> Question:
    """The question that a change over time answers."""
    late = change.coefficient in (LATENESS, ENCODER_LATENESS)
    name = MOMENT if isinstance(change, MomentOfChange) else CLOCK if late else TREND
    return Question(name, "s", "", (), change=change)


def _of_lateness(moved: MeasuredMotion, plain: PlainModel, period_s: float) -> FloatArray:
    """Torque (n,) that is recorded beyond that of a motion, for each second by which it is recorded late."""
    every = {**plain_columns(moved, plain.load_ratio, spring=True), "coulomb": np.zeros(moved.velocity.size)}
    return np.asarray(-np.gradient(plain.fit.predict(every), period_s))


def strongest_line(
    data: Dataset, parts: Sequence[ResidualSeries], asked: Sequence[Question]
) -> tuple[float, int] | None:
    """Period of the strongest line of a residual over the position, and of how many; None without one.

    Periods are longer than counts and rows make, and seen twice.
    """
    position, speed = (
        np.concatenate([one[part.rows] for one, part in zip(question.values, parts, strict=True)])
        for question in (_named(asked, POSITION), _named(asked, SPEED))
    )
    if not position.size:
        return None
    span = float(np.ptp(position))
    run, ratio = data.runs[0], data.bench.axis.ratio_m_rad
    counts = np.sqrt(12.0) * max(ratio * run.noise.motor, run.noise.table_m)
    shortest = max(_ROWS * run.period_s * float(np.median(np.abs(speed))), _ROWS * float(counts), span / _MOST_PERIODS)
    left = np.concatenate([part.left[part.rows] for part in parts])
    longest = _LONGEST * span
    found = strongest_periods(position, left, shortest / _ROWS, shortest, 1, longest)
    choices = int(2.0 * span / shortest)
    return (refined_period(position, left, found[0], shortest, longest), choices) if found else None


def folded(asked: Sequence[Question], line: tuple[float, int], turn: float) -> Question:
    """The position within a period; `turn` is that of the motor, 0 if it is not known."""
    (period, choices), position = line, _named(asked, POSITION)
    often = f" ({digits(turn / period)} per motor turn)" if turn else ""
    name = f"place within its period of {quantity(period, position.length)}{often}"
    places = tuple(np.mod(one, period) for one in position.values)
    return replace(position, name=name, values=places, choices=choices, period=period)


def _named(asked: Sequence[Question], name: str) -> Question:
    return next(one for one in asked if one.name == name)
