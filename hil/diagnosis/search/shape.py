"""Test whether the shape that a term adds to the torque, or to the difference of the encoders, is in what a fit leaves.

    r = c s + inertia, friction, offset, and what other parameters of the fit change,
    s = r of the fit without the term - r of the fit with it,

s of the intended motion (`hil.identification.intended_motion`), in the difference of the encoders of the smoothed one,
and of the torque that the plain model needs for it: what a term makes of the noise of position and torque, which is in
r too, is no evidence.

Least squares on the rows that slide: `c / error` is Student's t, with an error and degrees of freedom by the spectrum
of what is left (`hil.identification.spectrum`). An effect below the noise of a row shows in the mean of many rows.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.structure_left import DRIVEN, TORQUE, channels, least_energy, left_in_channel
from hil.identification.coefficient import Coefficient, coefficients, log_tail
from hil.identification.dataset import Dataset
from hil.identification.derivatives import MeasuredMotion, matched_motion
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import intended_motion, measured_motion
from hil.identification.noise_apart import intended_runs, smoothed_runs
from hil.identification.plain_model import MOTION, PlainModel, plain_columns
from hil.identification.residual_scales import follows
from hil.identification.structure import ResidualSeries
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain, quiet_motion
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Stage
from hil.twin.parameter import Role
from hil.twin.physics import Active

_FEWEST_ROWS = 100
_MANY = (Role.EDGE, Role.LINE, Role.PERIOD, Role.FREQUENCY)
_FAINT = 0.1  # of the strength of a friction: a small step, its shape is linear in it
_LARGEST = 1e150  # of a residual: an unstable twin leaves more, and its square overflows


def log_chance_below_noise(fit: Fit, without: Fit) -> float | None:
    """Logarithm of the chance of a term's shape where the fit without it is within its noise; else None."""
    return log_chance_of_shape(fit.hypothesis, without) if without.within_noise else None


def log_chance_of_shape(found: Hypothesis, without: Fit, fitted: bool = True) -> float:
    """Logarithm of the probability that chance makes the shape of one of all mechanisms in what a fit leaves.

    By the number of values that were searched, see `_searched`. 0 where nothing tells, for less than the least energy
    that counts, and for a `fitted` shape that leaves more at its own size: of the size c the term
    has 1, and removes (2 c - 1) / c^2 of what the shape removes. Others are simulated with the steps of a search.
    A term that may have further harmonics is asked without them, too: none need be there.
    """
    added = _added(found, without)
    plain = [_without_harmonics(found, added[-1])] if added else []
    return min(_log_chance(one, without, fitted) for one in (found, *plain) if one is not None)


def _without_harmonics(found: Hypothesis, term: Term) -> Hypothesis | None:
    """The hypothesis with the values that a term need not have at their defaults; None if it has none."""
    parameters = BY_ID[term.effect].parameters
    values = tuple(v if p.default is None else p.default for p, v in zip(parameters, term.values, strict=True))
    index = next((place for place, one in enumerate(found.terms) if one.key == term.key), None)
    if index is None or values == tuple(term.values):
        return None
    return found.replaced(index, replace(term, values=values))


def _log_chance(found: Hypothesis, without: Fit, fitted: bool) -> float:
    """`log_chance_of_shape` of one form of a term."""
    searched, best = _searched(found) - _searched(without.hypothesis), 0.0
    seen = sizes([found], without, not fitted)
    for _, (size, ratio, free), energy, rows in (one for each in seen for one in each):
        if free > 0.0 and energy > 1.0:
            if fitted:
                removes = max(2.0 * size - 1.0, 0.0) / size**2
                chance = log_tail(abs(ratio) * removes**0.5, free)
            else:
                chance = math.log(2.0) + log_tail(abs(ratio), free)
            # values told apart: the independent ones of an octave, each octave with the same share of the chance
            number = math.log(min(free * math.log2(rows), rows))
            best = min(best, math.log(len(LIBRARY) * len(seen)) + searched * number + chance)
    return best


class Size(NamedTuple):
    """Size of a term in a channel, 1 at its own values; its energy over the least that counts; number of rows."""

    channel: str
    told: Coefficient
    energy: float
    rows: int


def sizes(found: Sequence[Hypothesis], without: Fit, fast: bool = True) -> list[list[Size]]:
    """Sizes of terms, all beside each other, for each way in which they are asked; none where nothing tells.

    Each hypothesis adds one term to that of the fit. `fast`: with the internal steps of a search.
    """
    plain, asked = _asked(without, fast)
    if plain is None:
        return []
    added = [_added(one, without) for one in found]
    faint = [_faint(one, terms, without) for one, terms in zip(found, added, strict=True)]
    # then one is the shape, and no nuisance
    offset = any(Active(term.effect, term.values, term.variant).is_offset for terms in added for term in terms)
    laps, every = [run.laps for run in without.data.runs], list[list[Size]]()
    for of in asked:
        after = [left_in_channel(one, of.calm, of.channel, plain, fast) for one, _ in faint]
        clear = [np.logical_and.reduce([one.clear for one in run]) for run in zip(*after, strict=True)]
        for own in of.seen:
            if own.smoothed and any(BY_ID[term.effect].shifts_phase for terms in added for term in terms):
                continue
            rows = [at & one for at, one in zip(own.rows, clear, strict=True)]
            counted = np.concatenate([one[at] for at, one in zip(own.rows, clear, strict=True)])
            shapes = [own.quiet[counted] - _joined(one, rows) for one in after]
            if np.count_nonzero(counted) < _FEWEST_ROWS or not all(_holds(one) for one in shapes):
                continue
            beside = own.beside[counted][:, ~own.constant] if offset else own.beside[counted]
            matrix = np.column_stack([*shapes, beside])
            told = coefficients(matrix, own.measured[counted], rows, laps, len(found))
            every.append(
                [
                    Size(
                        of.channel,
                        one._replace(value=one.value * share),
                        one.value**2 * float(np.mean(shape**2)) / max(of.least, 1e-300),
                        shape.size,
                    )
                    for one, shape, (_, share) in zip(told, shapes, faint, strict=True)
                ]
            )
    return every


def prepare(without: Fit) -> None:
    """Compute what the shapes of all terms are asked in, in the steps of a search."""
    _asked(without, True)


def _added(found: Hypothesis, without: Fit) -> list[Term]:
    known = {term.key for term in without.terms}
    return [term for term in found.resolved.terms if term.key not in known]


def _faint(found: Hypothesis, added: Sequence[Term], without: Fit) -> tuple[Hypothesis, float]:
    """The fit, or the one without its term and little of the friction that it adds: of more the twin would stick.

    With the share of the term's strength.
    """
    mechanism = BY_ID[added[-1].effect] if added else None
    if mechanism is None or mechanism.variants[added[-1].variant].stage is not Stage.COULOMB:
        return found, 1.0
    values, none = list(added[-1].values), 0.0
    if mechanism.neutral is not None:
        none = mechanism.neutral(axis_facts(without.bench, without.data.runs))
    for index in mechanism.indices(Role.STRENGTH):
        values[index] = none + _FAINT * (values[index] - none)
    return without.hypothesis.with_term(replace(added[-1], values=tuple(values))), _FAINT


class _Seen(NamedTuple):
    """Residuals (m,) of a channel on the rows that slide: `measured`, and `quiet` of the calm motion.

    Rows in which the twin sticks are left out. `beside` (m, q) has the columns of least squares beside a shape,
    `constant` (q,) marks the offsets among them. `smoothed`: of a motion through a mean, which is itself a lag or a
    resonance, so that it tells none.
    """

    rows: list[NDArray[np.bool_]]
    measured: FloatArray
    quiet: FloatArray
    beside: FloatArray
    constant: NDArray[np.bool_]
    smoothed: bool


class _Asked(NamedTuple):
    """A channel in which a shape is sought, with the calm motion that gives it; of less energy it does not count."""

    channel: str
    calm: Dataset
    least: float
    seen: list[_Seen]


@lru_cache(maxsize=2)
def _asked(without: Fit, fast: bool) -> tuple[PlainModel | None, list[_Asked]]:
    """The plain model, and the residuals of a fit in which shapes are sought; no model if the axis never slides.

    The torque is asked twice: with the measured motion, and with the smoothed one, in which the noise of the encoder
    does not hide a torque that is faster than the twin's observer. A second encoder that is judged behind the motor is
    asked once more for what torque deflects the springs. A channel that is set aside tells nothing.
    """
    data, found = without.data, list[_Asked]()
    plain = fit_plain(data)
    if plain is None:
        return None, found
    smooth = quiet_motion(data)
    springs = bool(without.bench.axis.SPRINGS)
    behind = all(follows(run, springs, data.observer_s) for run in data.runs)
    for channel in (*channels(data), *([DRIVEN] if behind else [])):
        if channel != TORQUE and "table" in data.set_aside:
            continue
        calm = data.over((intended_runs if channel == TORQUE else smoothed_runs)(data.runs, plain))
        quiet = left_in_channel(without.hypothesis, calm, channel, plain, fast)
        others = [left_in_channel(one, calm, channel, plain, fast) for one in _other_values(without)]
        least = least_energy(data, channel, plain) * (1.0 if channel == TORQUE else CRITERIA.material)
        seen = [
            _seen(parts, quiet, others, _motions(data, channel, held is smooth), held is smooth)
            for held in ((data, smooth) if channel == TORQUE else (data,))
            for parts in [left_in_channel(without.hypothesis, held, channel, plain, fast)]
        ]
        found.append(_Asked(channel, calm, least, [one for one in seen if one is not None]))
    return plain, found


def _motions(data: Dataset, channel: str, smooth: bool) -> list[list[MeasuredMotion]]:
    """Motions of each run whose torque by the plain model is beside a shape of the torque.

    The intended one; beside the smoothed motion also that, and that of twice the window: what smoothing takes off a
    motion is a torque that the twin seems to lack.
    """
    if channel != TORQUE:
        return []
    found = [[intended_motion(run) for run in data.runs]]
    for more in (1, 2) if smooth else ():
        each = [(run, more * (measured_motion(run).window - 1) + 1) for run in data.runs]
        found.append([matched_motion(run.motor, run.period_s, window) for run, window in each])
    return found


def _seen(
    parts: Sequence[ResidualSeries],
    quiet: Sequence[ResidualSeries],
    others: Sequence[Sequence[ResidualSeries]],
    motions: Sequence[Sequence[MeasuredMotion]],
    smoothed: bool,
) -> _Seen | None:
    """Residuals of a channel and of its calm motion; None where too few rows slide, or the twin holds no motion."""
    rows = [one.rows & one.clear & other.clear for one, other in zip(parts, quiet, strict=True)]
    measured, own = _joined(parts, rows), _joined(quiet, rows)
    if measured.size < _FEWEST_ROWS or not (_holds(measured) and _holds(own)):
        return None
    beside = [np.ones_like(measured), *(column for moved in motions for column in _of_motion(moved, rows))]
    changed = (_joined(one, rows) - own for one in others)
    columns = np.column_stack([*beside, *(change for change in changed if _holds(change))])
    return _Seen(rows, measured, own, columns, np.ptp(columns, axis=0) == 0.0, smoothed)


def _of_motion(moved: Sequence[MeasuredMotion], rows: Sequence[NDArray[np.bool_]]) -> list[FloatArray]:
    """Regressors (m,) of the plain model for a motion, on the rows (n,) of each run that count."""
    columns = [plain_columns(one) for one in moved]
    return [np.concatenate([one[name][at] for one, at in zip(columns, rows, strict=True)]) for name in MOTION]


def _holds(residual: FloatArray) -> bool:
    """True if a twin holds the motion: its residual (n,) has squares that are floating-point numbers."""
    return bool(np.max(np.abs(residual), initial=0.0) < _LARGEST)


def _other_values(fit: Fit) -> Iterator[Hypothesis]:
    """The hypothesis of a fit with each parameter beside those of the axis moved by a step, without edges."""
    hypothesis, steps = fit.hypothesis, fit.estimator.steps(fit.hypothesis)
    for index, one in enumerate(hypothesis.coordinates):
        if index >= len(hypothesis.bench.axis.refitted) and not one.edge:
            x = hypothesis.x.copy()
            x[index] += steps[index]
            yield hypothesis.moved(x)


def _joined(parts: Sequence[ResidualSeries], rows: Sequence[NDArray[np.bool_]]) -> FloatArray:
    """Residuals (m,) of all runs on the rows (n,) of each that count."""
    return np.concatenate([one.left[at] for one, at in zip(parts, rows, strict=True)])


def _searched(found: Hypothesis) -> float:
    """Logarithm, over that of the independent rows, of the number of values in which the terms were searched.

    A half for each parameter beside a strength and not at its default (Schwarz 1978), one for the edge of a window, a
    line or a period, of which as many are told apart as there are rows (Y.-C. Yao, Statistics and Probability Letters 6
    (1988) 181).
    """
    roles = [
        one.role
        for one, value in zip(found.coordinates, found.values, strict=True)
        if one.parameter is not None and value != one.parameter.default
    ]
    return sum(1.0 if role in _MANY else 0.5 for role in roles if role is not Role.STRENGTH)
