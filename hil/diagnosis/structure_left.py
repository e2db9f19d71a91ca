"""Structure in what a twin leaves: over position, angle, speed, load and time, in torque and in position.

A residual within its noise says that the rows of a channel are explained one by one; thousands of rows together tell
far less than the noise of one. Each channel is asked over each quantity (`hil.identification.structure`). A dependence
counts if chance makes it in less than the level of significance over the number of questions, if it holds on held-out
recordings, and if it is material: a torque above the share by which correct simulations of one axis differ, a
difference of the encoders against their noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.wording import by_chance
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.periods import strongest_periods
from hil.identification.plain_model import PlainModel
from hil.identification.structure import BINS, ResidualSeries, Structure, offset, slow, structure
from hil.identification.torque_left import fit_plain, measured_motion, needed_torque, torque_deviation
from hil.quantities import digits, quantity, reading_unit

_ROWS = 4.0  # per period of a line: less is an alias
_MOST_PERIODS = 4000  # of a line over the travel
_SEEN = 4.0  # bins of the position per period, from which they show it
POSITION, SPEED, OFFSET = "position", "speed", "offset"
TORQUE, DIFFERENCE = "torque", "difference"  # needed beyond the twin's; of the encoders, beyond the twin's
_RESIDUAL = {TORQUE: "motor", DIFFERENCE: "table"}  # channel of the twin that shows it


@dataclass(frozen=True, eq=False)
class Question:
    """A quantity (n,) of each run that a residual may depend on, in a unit.

    `length` is the unit of positions, m or rad. `by_direction`: it is counted from its `least` value on, and further by
    `by_direction` where the axis moves up. `kept`: it means the same in other recordings. `choices`: number of
    quantities of which the residual itself chose this one.
    """

    name: str
    unit: str
    length: str
    values: tuple[FloatArray, ...]
    bins: int = BINS
    by_direction: float = 0.0
    least: float = 0.0
    kept: bool = True
    choices: int = 1


@dataclass(frozen=True, eq=False)
class Dependence:
    """A residual that depends on a quantity: on training recordings, its noise, and what it explains held out.

    `explained` is the share of the residual's mean square, `material` the energy over the least one that counts,
    `held_out` the mean square that the dependence removes from held-out recordings; None where nothing tells.
    """

    channel: str
    question: Question
    found: Structure
    explained: float
    material: float
    held_out: float | None

    def rms_left(self, fit: Fit, data: Dataset) -> float:
        """Rms of the residual of a fit on other recordings, its mean taken off; infinite where it is not held."""
        plain = fit_plain(fit.data)
        if plain is None:
            return np.inf
        left = np.concatenate(
            [one.left[one.rows] for one in left_in_channel(fit.hypothesis, data, self.channel, plain)]
        )
        return float(np.std(left)) if left.size and np.isfinite(left).all() else np.inf

    def in_words(self, drive_unit: str) -> str:
        """Say what the twin lacks, and where it lacks most."""
        found, question = self.found, self.question
        at = int(np.argmax(np.abs(found.means) / np.maximum(found.errors, 1e-300)))
        value, low, high = (float(one) for one in (found.means[at], found.edges[at], found.edges[at + 1]))
        more = "more" if value > 0.0 else "less"
        if self.channel == TORQUE:
            what = f"the axis needs {quantity(abs(value), drive_unit)} {more} torque than the twin"
        else:
            what = f"the second encoder reads {quantity(abs(value), question.length)} {more} than the twin"
        if question.name == OFFSET:
            return f"{what} throughout ({by_chance(found.p)})"
        moving = ""
        if question.by_direction:
            # a range may cover the end of one way and the begin of the other
            up = low + high >= 2.0 * question.by_direction
            begin, moving = (question.by_direction, " moving forwards") if up else (0.0, " moving backwards")
            low, high = (question.least + min(max(one - begin, 0.0), question.by_direction) for one in (low, high))
        factor, unit = reading_unit(question.unit, max(abs(low), abs(high)))
        return (
            f"{what} at a {question.name} of {digits(factor * low)} to {digits(factor * high)} {unit}{moving} "
            f"({by_chance(self.found.p)})"
        )


def structure_left(fit: Fit, held_out: Dataset) -> tuple[Dependence, ...]:
    """Dependences of what a fit leaves in training, the one with most energy first; none is no structure."""
    plain = fit_plain(fit.data)
    if plain is None:
        return ()
    found = []
    for channel in channels(fit.data):
        parts = left_in_channel(fit.hypothesis, fit.data, channel, plain)
        others = left_in_channel(fit.hypothesis, held_out, channel, plain) if held_out.runs else []
        if not all(np.isfinite(part.left).all() for part in (*parts, *others)):
            continue  # the twin does not hold the motion
        found += list(_dependences(fit, held_out, channel, plain, (parts, others)))
    asked = len(channels(fit.data)) * (len(questions(fit.hypothesis, fit.data, plain)) + 1)  # a line is one more
    level = CRITERIA.significance / max(asked, 1)
    counted = [
        one
        for one in found
        if one.found.p * one.question.choices < level
        and one.material > 1.0
        and (one.held_out is None or one.held_out > 0.0)
    ]
    return tuple(sorted(counted, key=lambda one: -one.explained))


def like_noise(fit: Fit, left: Sequence[Dependence]) -> frozenset[str]:
    """Channels of the twin whose remainder depends on nothing, as far as its rows can tell: noise, white or not.

    Sensors wander, and a torque has noise of its own. None where the input of the twin has no error: a twin leaves
    nothing then.
    """
    plain = fit_plain(fit.data)
    if fit.data.observability.exact_input or plain is None:
        return frozenset()
    told = {one.channel for one in left}
    return frozenset(
        _RESIDUAL[channel]
        for channel in channels(fit.data)
        if channel not in told and offset(left_in_channel(fit.hypothesis, fit.data, channel, plain)) is not None
    )


def questions(hypothesis: Hypothesis, data: Dataset, plain: PlainModel) -> list[Question]:
    """Quantities that a residual may depend on."""
    motions = [measured_motion(run).moved for run in data.runs]
    ratio = hypothesis.bench.axis.ratio_m_rad
    position = tuple(ratio * moved.position for moved in motions)
    low = min(float(one.min()) for one in position)
    span = max(float(one.max()) for one in position) - low
    length = "rad" if hypothesis.bench.axis.turns else "m"
    begin = min(float(run.time_s[0]) for run in data.runs)
    duration = max(float(run.time_s[-1]) for run in data.runs) - begin
    up = [moved.velocity > 0.0 for moved in motions]
    by_direction = tuple(one - low + 1.001 * span * moves for one, moves in zip(position, up, strict=True))
    load = [plain.predict(moved) for moved in motions]
    least = min(float(one.min()) for one in load)
    range_ = 1.001 * (max(float(one.max()) for one in load) - least)
    by_load = tuple(one - least + range_ * moves for one, moves in zip(load, up, strict=True))
    later = tuple(run.time_s - begin + 1.001 * duration * moves for run, moves in zip(data.runs, up, strict=True))
    return [
        Question(POSITION, length, length, position),
        Question("distance from the first position", length, length, by_direction, 2 * BINS, 1.001 * span),
        Question(SPEED, f"{length}/s", length, tuple(ratio * moved.velocity for moved in motions)),
        # friction of a load has its sign
        Question("load", hypothesis.bench.axis.drive_unit, length, by_load, 2 * BINS, range_, least),
        Question("time", "s", length, later, 2 * BINS, 1.001 * duration, kept=False),
    ]


def _line(data: Dataset, parts: Sequence[ResidualSeries], asked: Sequence[Question]) -> tuple[float, int] | None:
    """Period of the strongest line of a residual over the position, and of how many; None without one.

    Periods are shorter than the bins of the position show, and longer than counts and rows make.
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
    found = strongest_periods(position, left, shortest / _ROWS, shortest, 1, longest=_SEEN * span / BINS)
    return (found[0], int(2.0 * span / shortest)) if found else None


def _folded(question: Question, line: tuple[float, int], turn: float) -> Question:
    """The position within a period; `turn` is that of the motor, 0 if it is not known."""
    period, choices = line
    often = f" ({digits(turn / period)} per motor turn)" if turn else ""
    name = f"place within its period of {quantity(period, question.length)}{often}"
    folded = tuple(np.mod(one, period) for one in question.values)
    return replace(question, name=name, values=folded, choices=choices)


def _named(asked: Sequence[Question], name: str) -> Question:
    return next(one for one in asked if one.name == name)


def channels(data: Dataset) -> list[str]:
    """Channels that are asked: the torque, and the difference of the encoders, as far as they are recorded."""
    torque = data.observability.torque_measured
    return [*([TORQUE] if torque else []), *([DIFFERENCE] if data.runs[0].table_m.size else [])]


def left_in_channel(hypothesis: Hypothesis, data: Dataset, channel: str, plain: PlainModel) -> list[ResidualSeries]:
    """Residuals of a channel and the rows in which the axis slides, for each run."""
    if channel == TORQUE:
        return needed_torque(hypothesis, data, plain)
    return [
        ResidualSeries(hypothesis.blocks(run, data.observer_s)["table"], measured_motion(run).sliding(plain.slowest))
        for run in data.runs
    ]


def _dependences(
    fit: Fit,
    held_out: Dataset,
    channel: str,
    plain: PlainModel,
    left: tuple[Sequence[ResidualSeries], Sequence[ResidualSeries]],
) -> Iterator[Dependence]:
    """Answers to the questions on one channel, (training, held-out) residuals."""
    parts, others = left
    least = least_energy(fit.data, channel, plain)
    rows = np.concatenate([part.left[part.rows] for part in parts])
    total = float(np.mean((rows - rows.mean()) ** 2)) if rows.size else 0.0
    if not total > 0.0:
        return
    if channel == TORQUE and (constant := offset(parts)):  # positions have a datum of their own
        square = float(np.mean(rows**2))
        there = np.concatenate([part.left[part.rows] for part in others]) if others else np.empty(0)
        gain = float(np.mean(there**2) - np.mean((there - constant.means[0]) ** 2)) if there.size else None
        question = Question(OFFSET, "", "", ())
        yield Dependence(
            channel,
            question,
            constant,
            constant.energy / square,
            constant.energy / least_energy(fit.data, channel, plain),
            gain,
        )
    asked = questions(fit.hypothesis, fit.data, plain)
    there_too = questions(fit.hypothesis, held_out, plain) if others else []
    if line := _line(fit.data, parts, asked):
        physics, ratio = fit.bench.axis.physics(), fit.bench.axis.ratio_m_rad
        turn = 2.0 * np.pi * ratio / physics.angle_per_unit if physics.turn_known else 0.0
        asked.append(_folded(_named(asked, POSITION), line, turn))
        there_too += [_folded(_named(there_too, POSITION), line, turn)] if there_too else []
    elsewhere = {one.name: one.values for one in there_too}
    for question in asked:
        found = structure(parts, question.values, question.bins)
        if found is None:
            continue
        if not question.kept:
            found = replace(found, p=max(found.p, slow(parts, question.values, found)))
        gain = None
        if question.kept and question.name in elsewhere:
            gain = _removed(found, others, elsewhere[question.name])
        yield Dependence(channel, question, found, found.energy / total, found.energy / least, gain)


def least_energy(data: Dataset, channel: str, plain: PlainModel) -> float:
    """Mean square of a residual from which a dependence is material.

    A creeping encoder stays within a count, and the counts of two of them beat: that of two encoders is their noise.
    """
    if channel == TORQUE:
        return (CRITERIA.discrepancy * torque_deviation([data], plain.slowest)) ** 2
    return float(np.mean([run.noise.table_m**2 for run in data.runs]))


def _removed(found: Structure, parts: Sequence[ResidualSeries], quantity: Sequence[FloatArray]) -> float:
    """Mean square that a dependence removes from residuals (n,) of other recordings, their means taken off."""
    left = np.concatenate([part.left[part.rows] for part in parts])
    if not left.size:
        return 0.0
    model = np.concatenate([found.at(one)[part.rows] for one, part in zip(quantity, parts, strict=True)])
    return float(np.var(left) - np.var(left - model))
