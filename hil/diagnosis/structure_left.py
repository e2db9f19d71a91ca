"""Structure in what a twin leaves: over position, angle, speed, load and time, in torque and in position.

A residual within its noise says that the rows of a channel are explained one by one; thousands of rows together tell
far less than the noise of one. Each channel is asked over each quantity (`hil.identification.structure`). A dependence
counts if chance makes it in less than the level of significance over the number of questions, if it holds on held-out
recordings, and if it is material: a torque above a thousandth of its deviation, a difference of the encoders against
their noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.moment_of_change import MomentOfChange, SteadyChange
from hil.diagnosis.questions import (
    ENCODER_LATENESS,
    LATENESS,
    OFFSET,
    Question,
    about,
    change_over_time,
    clocks_of_encoders,
    everywhere,
    folded,
    over_time,
    strongest_line,
)
from hil.diagnosis.wording import by_chance
from hil.identification.dataset import Dataset, in_turn
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import measured_motion
from hil.identification.plain_model import PlainModel
from hil.identification.structure import ResidualSeries, Structure, offset, structure
from hil.identification.torque_left import fit_plain, needed_torque, torque_deviation
from hil.quantities import digits, quantity, reading_unit

TORQUE, DIFFERENCE = "torque", "difference"  # needed beyond the twin's; of the encoders, beyond the twin's
DRIVEN = "difference of the driven twin"  # of the encoders, by the twin that the measured torque moves
_SECONDS = dict.fromkeys(("N m", "N", "V"), "s")
# Coefficients of the plain model, and their units on axes whose torque is in N m, N, or V.
_COEFFICIENTS = {
    "inertia": ("the inertia", {"N m": "kg m^2", "N": "kg", "V": "V s^2/rad"}),
    "viscous": ("the viscous friction", {"N m": "N m s/rad", "N": "N s/m", "V": "V s/rad"}),
    "coulomb": ("the Coulomb friction", {}),
    "offset": ("the load", {}),
    "sine": ("the torque over the sine of the angle", {}),
    "cosine": ("the torque over the cosine of the angle", {}),
    LATENESS: ("the delay of the recorded torque", _SECONDS),
    ENCODER_LATENESS: ("the delay of the second encoder", _SECONDS),
}
_RESIDUAL = {TORQUE: "motor", DIFFERENCE: "table"}  # channel of the twin that shows it


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
        if (change := question.change) is not None:
            told = _steadily(change, drive_unit) if isinstance(change, SteadyChange) else _changed(change, drive_unit)
            return f"{told} ({by_chance(found.p)})"
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


def _changed(change: MomentOfChange, drive_unit: str) -> str:
    """Say from which moment on which coefficient is larger or smaller."""
    name, unit = coefficient(change, drive_unit)
    size = quantity(abs(change.change), unit)
    more = "larger" if change.change > 0.0 else "smaller"
    return f"from {change.moment_s:.2f} s on {name} is {size} {more} than before"


def _steadily(steady: SteadyChange, drive_unit: str) -> str:
    """Say by how much a coefficient changes, or that two clocks run apart."""
    if steady.coefficient in (LATENESS, ENCODER_LATENESS):
        return _apart(steady)
    name, unit = coefficient(steady, drive_unit)
    change = steady.rate * steady.duration_s
    way = "grows" if change > 0.0 else "falls"
    return f"{name} {way} by {quantity(abs(change), unit)} within {quantity(steady.duration_s, 's')}"


def _apart(steady: SteadyChange) -> str:
    """Say that the delay of the torque, or of the second encoder, changes steadily."""
    way, late_s = "later" if steady.rate > 0.0 else "earlier", abs(steady.rate) * steady.duration_s
    of_torque = steady.coefficient == LATENESS
    clocks, what = ("torque and position", "torque") if of_torque else ("both encoders", "second encoder")
    return (
        f"the clocks of {clocks} run apart by {digits(1e6 * abs(steady.rate))} ppm: at the end the {what} "
        f"is recorded {quantity(late_s, 's')} {way} than at the begin"
    )


def coefficient(change: MomentOfChange | SteadyChange, drive_unit: str) -> tuple[str, str]:
    """Name in words and unit of the coefficient that changes."""
    name, units = _COEFFICIENTS[change.coefficient]
    return name, units.get(drive_unit, drive_unit)


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
    asked = len(channels(fit.data)) * (
        len(everywhere(fit.hypothesis, fit.data, plain)) + 4
    )  # offset, line, time, its change
    told = _told(found, asked)
    counted = [one for one in told if one.material > 1.0 and (one.held_out is None or one.held_out > 0.0)]
    return tuple(sorted(counted, key=lambda one: -one.explained))


def _told(found: Sequence[Dependence], asked: int) -> list[Dependence]:
    """Dependences that chance makes in none of the questions `asked`: each test beside the answers that are told.

    S. Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 6 (1979) 65.
    """
    told: list[Dependence] = []
    for one in sorted(found, key=lambda one: one.found.p * one.question.choices):
        if not one.found.p * one.question.choices * max(asked - len(told), 1) < CRITERIA.significance:
            break
        told.append(one)
    return told


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


def channels(data: Dataset) -> list[str]:
    """Channels that are asked: the torque, and the difference of the encoders, as far as they are recorded."""
    torque = data.observability.torque_measured
    return [*([TORQUE] if torque else []), *([DIFFERENCE] if data.runs[0].table_m.size else [])]


def left_in_channel(
    hypothesis: Hypothesis, data: Dataset, channel: str, plain: PlainModel, fast: bool = False
) -> list[ResidualSeries]:
    """Residuals of a channel and the rows in which the axis slides, for each run; `fast`: in the steps of a search."""
    if channel == TORQUE:
        return needed_torque(hypothesis, data, plain, fast)
    residuals = hypothesis.driven if channel == DRIVEN else hypothesis.blocks
    return [
        ResidualSeries(left["table"], measured_motion(run).sliding(plain.slowest))
        for run in data.runs
        for left in [residuals(run, data.observer_s, data.steps_of(fast))]
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
    # of all runs at once, so that a value by direction means the same in each
    all_runs = everywhere(fit.hypothesis, fit.data.over((*fit.data.runs, *held_out.runs)), plain)
    number = len(fit.data.runs)
    asked = [replace(one, values=one.values[:number]) for one in all_runs]
    there_too = [replace(one, values=one.values[number:]) for one in all_runs] if others else []
    if line := strongest_line(fit.data, parts, asked):
        physics, ratio = fit.bench.axis.physics(), fit.bench.axis.ratio_m_rad
        turn = 2.0 * np.pi * ratio / physics.angle_per_unit if physics.turn_known else 0.0
        asked.append(folded(asked, line, turn))
        there_too += [folded(there_too, line, turn)] if there_too else []
    elsewhere = {one.name: one.values for one in there_too}
    for question in asked:
        if found := structure(parts, question.values, question.bins):
            gain = _removed(found, others, elsewhere[question.name]) if question.name in elsewhere else None
            yield Dependence(channel, question, found, found.energy / total, found.energy / least, gain)
    runs = (*fit.data.runs, *held_out.runs)
    one_way = bool(in_turn(runs))  # parts of a recording: its time goes on
    whole, of_whole = (fit.data.over(runs), [*parts, *others]) if one_way else (fit.data, parts)
    all_of_it = float(np.var(np.concatenate([part.left[part.rows] for part in of_whole])))
    question = over_time(fit.hypothesis, whole)
    if found := structure(of_whole, question.values, question.bins):
        yield Dependence(channel, question, found, found.energy / all_of_it, found.energy / least, None)
    if not one_way:
        return
    torque = channel == TORQUE
    if change := change_over_time(whole, of_whole, plain) if torque else clocks_of_encoders(whole, of_whole):
        # errors of counts repeat with the position and do not grow with time
        found, enough = change.course, least if torque else CRITERIA.material * least
        yield Dependence(channel, about(change), found, min(found.energy / all_of_it, 1.0), found.energy / enough, None)


def least_energy(data: Dataset, channel: str, plain: PlainModel) -> float:
    """Mean square of a residual from which a dependence is material.

    A creeping encoder stays within a count, and the counts of two of them beat: that of two encoders is their noise.
    """
    if channel == TORQUE:
        return (CRITERIA.least_torque * torque_deviation([data], plain.slowest)) ** 2
    return float(np.mean([run.noise.table_m**2 for run in data.runs]))


def _removed(found: Structure, parts: Sequence[ResidualSeries], quantity: Sequence[FloatArray]) -> float:
    """Mean square that a dependence removes from residuals (n,) of other recordings, their means taken off."""
    left = np.concatenate([part.left[part.rows] for part in parts])
    if not left.size:
        return 0.0
    model = np.concatenate([found.at(one)[part.rows] for one, part in zip(quantity, parts, strict=True)])
    return float(np.var(left) - np.var(left - model))
