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
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.structure_left import TORQUE, channels, least_energy, left_in_channel
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import intended
from hil.identification.laps import Laps
from hil.identification.noise_apart import intended_runs, smoothed_runs
from hil.identification.parallel import in_parallel
from hil.identification.plain_model import MOTION, PlainModel, plain_columns
from hil.identification.spectrum import spectrum
from hil.identification.structure import ResidualSeries
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain, measured_motion
from hil.identification.whitening import RANK, filtered, spread, whitening_filter
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Stage
from hil.twin.parameter import Role
from hil.twin.physics import Active

_FEWEST_ROWS = 100
_MANY = (Role.EDGE, Role.LINE, Role.PERIOD, Role.FREQUENCY)
_FAINT = 0.1  # of the strength of a friction: a small step, its shape is linear in it
_LARGEST = 1e150  # of a residual: an unstable twin leaves more, and its square overflows
_UNDERFLOW = 1e-290  # probability below which its floating-point number loses digits


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
    fast = not fitted
    asked, best = _asked(without, fast), 0.0
    if asked is None:
        return best
    added = _added(found, without)
    searched, (shaped, share) = _searched(found) - _searched(without.hypothesis), _faint(found, added, without)
    # then one is the shape, and no nuisance
    offset = any(Active(term.effect, term.values, term.variant).is_offset for term in added)
    for channel, own in asked.channels.items():
        after = left_in_channel(shaped, own.calm, channel, asked.plain, fast)
        rows = [at & one.clear for at, one in zip(own.rows, after, strict=True)]
        counted = np.concatenate([one.clear[at] for at, one in zip(own.rows, after, strict=True)])
        shape = own.quiet[counted] - _joined(after, rows)
        if shape.size < _FEWEST_ROWS or not _holds(shape):
            continue
        beside = own.beside[counted]
        matrix = np.column_stack([shape, beside[:, ~own.constant] if offset else beside])
        size, ratio, free = _first_coefficient(
            matrix, own.measured[counted], rows, [run.laps for run in without.data.runs]
        )
        if free > 0.0 and size**2 * float(np.mean(shape**2)) > own.least:
            if fitted:
                removes = max(2.0 * size * share - 1.0, 0.0) / (size * share) ** 2
                chance = _log_tail(abs(ratio) * removes**0.5, free)
            else:
                chance = math.log(2.0) + _log_tail(abs(ratio), free)
            best = min(best, math.log(len(LIBRARY)) + searched * math.log(counted.sum()) + chance)
    return best


def _log_tail(ratio: float, free: float) -> float:
    """Logarithm of the probability that Student's t exceeds a ratio >= 0, also where that is no floating-point number.

    There the first term of the incomplete beta function I_x(a, 1/2), x = free / (free + t^2), a = free / 2 (M.
    Abramowitz and I. Stegun, Handbook of Mathematical Functions, 26.5.4), with its series as 1 / (1 - x).
    """
    if (tail := float(student.sf(ratio, free))) > _UNDERFLOW:
        return math.log(tail)
    x, a = free / (free + ratio**2), 0.5 * free
    return float(a * math.log(x) - 0.5 * math.log1p(-x) - math.log(2.0 * a) - betaln(a, 0.5))


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
    """Residuals (m,) of a channel on the rows that slide: of the recordings, and of their `calm` motion (`quiet`).

    Rows in which the twin sticks are left out.

    `beside` (m, q) has the columns of least squares beside a shape, `constant` (q,) marks the offsets among them. A
    shape of less energy than `least` does not count.
    """

    rows: list[NDArray[np.bool_]]
    measured: FloatArray
    calm: Dataset
    quiet: FloatArray
    beside: FloatArray
    constant: NDArray[np.bool_]
    least: float


class _Asked(NamedTuple):
    """Channels of a fit in which a shape is sought, and the plain model."""

    channels: dict[str, _Seen]
    plain: PlainModel


@lru_cache(maxsize=2)
def _asked(without: Fit, fast: bool) -> _Asked | None:
    """Residuals of a fit, for the test of each mechanism's shape; None if the axis slides in no row.

    `fast`: with the internal steps of a search.
    """
    data, hypothesis, found = without.data, without.hypothesis, dict[str, _Seen]()
    plain = fit_plain(data)
    if plain is None:
        return None
    for channel in channels(data):
        calm = data.over((intended_runs if channel == TORQUE else smoothed_runs)(data.runs, plain))
        parts, quiet = (left_in_channel(hypothesis, one, channel, plain, fast) for one in (data, calm))
        rows = [one.rows & one.clear & other.clear for one, other in zip(parts, quiet, strict=True)]
        measured, own = _joined(parts, rows), _joined(quiet, rows)
        if measured.size < _FEWEST_ROWS or not (_holds(measured) and _holds(own)):
            continue
        beside = [np.ones_like(measured)]
        if channel == TORQUE:
            moved = [plain_columns(measured_motion(intended(run)).moved) for run in data.runs]
            beside += [np.concatenate([one[name][at] for one, at in zip(moved, rows, strict=True)]) for name in MOTION]
        other = (left_in_channel(one, calm, channel, plain, fast) for one in _other_values(without))
        changed = (_joined(one, rows) - own for one in other)
        beside += [change for change in changed if _holds(change)]
        least = least_energy(data, channel, plain) * (1.0 if channel == TORQUE else CRITERIA.material)
        columns = np.column_stack(beside)
        found[channel] = _Seen(rows, measured, calm, own, columns, np.ptp(columns, axis=0) == 0.0, least)
    return _Asked(found, plain)


def _holds(residual: FloatArray) -> bool:
    """True if a twin holds the motion: its residual (n,) has squares that are floating-point numbers."""
    return bool(np.max(np.abs(residual), initial=0.0) < _LARGEST)


def _other_values(fit: Fit) -> Iterator[Hypothesis]:
    """The hypothesis of a fit with each parameter beside those of the axis moved by a step, without edges."""
    hypothesis, steps = fit.hypothesis, fit.estimator.steps(fit.hypothesis)
    for index, one in enumerate(hypothesis.coordinates):
        if index >= len(hypothesis.bench.axis.NOMINAL) and not one.edge:
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


def _first_coefficient(
    matrix: FloatArray, signal: FloatArray, rows: Sequence[NDArray[np.bool_]], laps: Sequence[Laps | None]
) -> tuple[float, float, float]:
    """Coefficient of the first column (n, p), the same over its error, and the degrees of freedom; 0 where not told.

    Generalised least squares: both sides are whitened by the autoregressive model of what the columns leave, so that
    slow errors do not hide a shape that is faster. The error counts what is correlated still (D. W. K. Andrews and J.
    C. Monahan, Econometrica 60 (1992) 953), and what repeats from lap to lap, as the counts of an encoder do: a lap
    tells it no better than one. Rows (m,) of each run count.
    """
    whole = np.column_stack([signal, matrix])
    taps = whitening_filter(signal, matrix, rows)
    signal, *columns = (filtered(one, rows, taps) for one in whole.T)
    matrix = np.column_stack(columns)
    scale = np.linalg.norm(matrix, axis=0)
    scaled = matrix / np.where(scale > 0.0, scale, 1.0)
    basis, upper = np.linalg.qr(scaled)  # an orthonormal basis: the singular values are those of a small matrix
    weights = np.linalg.pinv(upper, rcond=RANK) @ basis.T
    solved = weights @ signal
    own = upper[:, 0] - upper[:, 1:] @ np.linalg.lstsq(upper[:, 1:], upper[:, 0], rcond=RANK)[0]
    if float(own @ own) < RANK:  # the others make it
        return 0.0, 0.0, 0.0
    splits = np.cumsum([int(at.sum()) for at in rows])[:-1]
    series = [np.split(one, splits) for one in (signal - scaled @ solved, weights[0], *basis.T)]
    left, weight, *beside = ([spread(part, at) for part, at in zip(one, rows, strict=True)] for one in series)
    covariance, free = spectrum(left, beside, rows).covariance([weight])
    variance = float(covariance[0, 0])
    if not variance > 0.0:
        return 0.0, 0.0, 0.0
    parts = [ResidualSeries(one, at) for one, at in zip(left, rows, strict=True)]
    repeated = 1.0 + _repeated(parts, series[1], laps) / variance
    return float(solved[0] / scale[0]), float(solved[0]) / (repeated * variance) ** 0.5, free / repeated


def _repeated(parts: Sequence[ResidualSeries], weights: Sequence[FloatArray], laps: Sequence[Laps | None]) -> float:
    """Variance that a sum of residuals with weights (m,) of the rows has because these repeat from lap to lap."""
    found = 0.0
    for part, weight, of in zip(parts, weights, laps, strict=True):
        if of is None:
            continue
        both = part.rows[of.first] & part.rows[of.again]
        first, again, series = of.first[both], of.again[both], spread(weight, part.rows)
        if first.size:
            alike = max(float(np.mean(part.left[first] * part.left[again])), 0.0)
            found += 2.0 * alike * max(float(series[first] @ series[again]), 0.0)
    return found


def shown(base: Fit, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Candidates whose shape, at the values where their search begins, is in what a base leaves, the clearest first."""

    def chance(one: Candidate) -> float:
        begun = (base.hypothesis.with_term(term) for term in (one.term, *one.others))
        return min(log_chance_of_shape(start, base, fitted=False) for start in begun)

    _asked(base, fast=True)  # once, before the jobs ask for it
    found = zip(in_parallel([partial(chance, one) for one in candidates]), candidates, strict=True)
    level = [(least, one) for least, one in found if least < math.log(CRITERIA.significance)]
    return [one for _, one in sorted(level, key=lambda pair: pair[0])]
