"""Windows of an event as reported: with standard errors, a common strength where it fits, and their period.

A window that the split of a recording cut is one window.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import EventWindow, PulseTrain
from hil.diagnosis.search.force_windows import CUT_S
from hil.diagnosis.turning import of_load
from hil.diagnosis.value import Value
from hil.diagnosis.wording import unit_in, value_in_words
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.terms import Term, Window
from hil.identification.window_fit import window_errors
from hil.quantities import quantity
from hil.twin.library import BY_ID
from hil.twin.parameter import Role

_SHARE = 0.05  # largest deviation of a strength from the common one, beside its standard errors: what real axes leave
_REGULAR_S = 0.005  # largest deviation of an edge from a period: a controlled event repeats more exactly
_LEAST_ERROR_S = 1e-4  # of an edge in the fit of a period: ten times finer than the rows of a recording at 1 kHz
_FEWEST = 3  # windows of a train: two always have a period
_RAMP = 1.0 / 3.0  # of the impulse of a push


@dataclass(frozen=True)
class Seen:
    """A window of one run: start, end [s] and strength, and their standard errors."""

    run: Measured
    values: tuple[float, float, float]
    errors: tuple[float, float, float]


@dataclass(frozen=True)
class EventReport:
    """Windows in order of time, the period that they have in common, and the sentence."""

    windows: tuple[EventWindow, ...]
    train: PulseTrain | None
    sentence: str
    parameters: dict[str, Value]


def describe_event(final: Fit, index: int, held_out: Dataset) -> EventReport:
    """Report the event that is the term `index` of a fit, with its windows in training and held-out recordings."""
    term = final.terms[index]
    mechanism, bench = BY_ID[term.effect], final.bench
    fits = [final] + ([replace(final.estimator, data=held_out).evaluate(final.hypothesis)] if held_out.runs else [])
    seen = joined(_whole([one for fit in fits for one in _seen(fit, index)]))
    common = _common(np.array([one.values[2] for one in seen]), np.array([one.errors[2] for one in seen]))
    if common is not None:
        value, error = common
        same = (replace(one, values=(*one.values[:2], value), errors=(*one.errors[:2], error)) for one in seen)
        seen = joined(same, alike=True)
    regular = None
    if common is not None and _different(seen) == len(seen):
        regular = train_of(np.array([one.values[:2] for one in seen]), np.array([one.errors[:2] for one in seen]))
    if regular is not None:
        pairs = zip(seen, regular[1].tolist(), regular[2].tolist(), strict=True)
        seen = [Seen(one.run, (*at_s, one.values[2]), (*error_s, one.errors[2])) for one, at_s, error_s in pairs]
    train = regular[0] if regular is not None else None
    names = [mechanism.names[place] for place in (*_edges(term), mechanism.strength)]
    units = [unit_in(bench, mechanism.parameters[place]) for place in (*_edges(term), mechanism.strength)]

    def value_of(one: Seen, place: int) -> Value:
        return Value(value=one.values[place], std=one.errors[place], unit=units[place])

    windows = tuple(
        EventWindow(recording=one.run.name, start=value_of(one, 0), end=value_of(one, 1), strength=value_of(one, 2))
        for one in seen
    )
    first, last = min(seen, key=lambda one: one.values[0]), max(seen, key=lambda one: one.values[1])
    strongest = max(seen, key=lambda one: abs(one.values[2]))
    found = dict(zip(names, (value_of(first, 0), value_of(last, 1), value_of(strongest, 2)), strict=True))
    parameters = {name: found[name] for name in mechanism.names}
    of_windows = mechanism.text.of_windows
    text = (
        of_windows(_different(seen), train is not None, _against_motion(seen))
        if of_windows
        else mechanism.text.sentence
    )
    words = {one.name: value_in_words(parameters[one.name].value, one, bench) for one in mechanism.parameters}
    words["count"] = str(train.count if train else _different(seen))
    if train is not None:
        words |= {"width_s": quantity(train.width_s, "s"), "period_s": quantity(train.period_s, "s")}
    text = of_load(text, bench.axis.turns).format(**words)
    return EventReport(windows, train, text, parameters)


def _edges(term: Term) -> list[int]:
    return BY_ID[term.effect].indices(Role.EDGE)


def _seen(fit: Fit, index: int) -> list[Seen]:
    term, strength = fit.terms[index], BY_ID[fit.terms[index].effect].strength
    runs = {run.name: run for run in fit.data.runs}
    inside = [window for window in term.windows if window.run in runs]
    if not inside:
        return []

    def edges(window: Window) -> tuple[float, float]:  # one before the first row that is evaluated is not told
        first, *_, last = runs[window.run].time_s[runs[window.run].evaluated].tolist()
        start, end = term.edges(window)
        return min(max(start, first), last), min(max(end, first), last)

    return [
        Seen(runs[window.run], (*edges(window), term.at(window)[strength]), (row[0], row[1], row[2]))
        for window, row in zip(inside, window_errors(fit, index).tolist(), strict=True)
    ]


def _whole(seen: Sequence[Seen]) -> list[Seen]:
    """Join windows that continue in the next part of a recording, in order of time."""
    result = list[Seen]()
    for one in sorted(seen, key=lambda other: other.values[0]):
        before = next((other for other in result if _continues(other, one)), None)
        if before is None:
            result.append(one)
            continue
        better = min(before, one, key=lambda other: other.errors[2])
        values = (before.values[0], one.values[1], better.values[2])
        result[result.index(before)] = Seen(before.run, values, (before.errors[0], one.errors[1], better.errors[2]))
    return result


def joined(seen: Iterable[Seen], alike: bool = False) -> list[Seen]:
    """Join windows of a run of which one begins where another ends: all of one strength (`alike`), or ramps of a push.

    A neighbour with less than a third of the impulse is the ramp of the stronger one, whose strength the push has.
    """
    parts = sorted(seen, key=lambda one: (one.run.name, one.values[0]))
    while True:
        pairs = (place for place in range(1, len(parts)) if _belong(parts[place - 1], parts[place], alike))
        place = next(pairs, None)
        if place is None:
            return sorted(parts, key=lambda one: one.values[0])
        parts[place - 1 : place + 1] = [_both(parts[place - 1], parts[place])]


def _belong(before: Seen, after: Seen, alike: bool) -> bool:
    near = before.run is after.run and after.values[0] - before.values[1] < _REGULAR_S
    less, more = sorted((abs(_impulse(before)), abs(_impulse(after))))
    return near and (less < _RAMP * more or (alike and _impulse(before) * _impulse(after) > 0.0))


def _both(before: Seen, after: Seen) -> Seen:
    stronger = max(before, after, key=lambda one: abs(_impulse(one)))
    last = max(before, after, key=lambda one: one.values[1])
    values = (before.values[0], last.values[1], stronger.values[2])
    return Seen(before.run, values, (before.errors[0], last.errors[1], stronger.errors[2]))


def _impulse(one: Seen) -> float:
    start_s, end_s, strength = one.values
    return (end_s - start_s) * strength


def _continues(before: Seen, after: Seen) -> bool:
    last_s, first_s = before.run.time_s[-1], after.run.time_s[after.run.evaluated.start]
    cut_s, period_s = after.run.start.time_s, after.run.period_s
    following = before.run is not after.run and cut_s - 2.0 * period_s < last_s < max(cut_s, first_s) + 2.0 * period_s
    near = abs(before.values[1] - last_s) < CUT_S and abs(after.values[0] - first_s) < CUT_S
    return following and near and before.values[2] * after.values[2] > 0.0


def _common(strengths: FloatArray, errors: FloatArray) -> tuple[float, float] | None:
    """Weighted mean of strengths (w,) and its standard error; None where they differ."""
    weights = 1.0 / np.maximum(errors, 1e-3 * np.abs(strengths)) ** 2
    mean, error = float(np.average(strengths, weights=weights)), float(weights.sum() ** -0.5)
    fits = np.abs(strengths - mean) <= np.maximum(CRITERIA.sigmas * errors, _SHARE * abs(mean))
    return (mean, error) if bool(fits.all()) else None


def _different(seen: Sequence[Seen]) -> int:
    """Number of windows at different times: the same one in several recordings counts once."""
    starts = np.sort([one.values[0] for one in seen])
    return 1 + int(np.count_nonzero(np.diff(starts) > _REGULAR_S))


def _against_motion(seen: Sequence[Seen]) -> bool:
    """True if windows of one strength are each against the motion of the motor, in both ways, beyond chance."""
    moved = list[float]()
    for run, (start_s, end_s, _) in ((one.run, one.values) for one in seen):
        inside = run.motor[(run.time_s >= start_s) & (run.time_s <= end_s)]
        moved.append(float(inside[-1] - inside[0]) if inside.size > 1 else 0.0)
    strength, error = np.array([(one.values[2], one.errors[2]) for one in seen]).T
    known = np.array(moved) != 0.0
    against = np.sign(moved)[known] * strength[known]
    both_ways = np.ptp(np.sign(strength[known]), axis=0) > 1.0 if known.any() else False
    alike = _common(np.abs(strength[known]), error[known]) is not None if both_ways else False
    return bool(alike and np.all(against < 0.0)) and 0.5**against.size < CRITERIA.significance


def train_of(edges: FloatArray, errors: FloatArray) -> tuple[PulseTrain, FloatArray, FloatArray] | None:
    """The period of windows with starts and ends (w, 2) in order of time, known to `errors` (w, 2); None without one.

    Returns it with its own edges and their errors. An edge at rest, where friction holds a force, contradicts no
    period; `_FEWEST` windows are told without those.
    """
    count = len(edges)
    if np.count_nonzero(np.all(errors <= _REGULAR_S, axis=1)) < _FEWEST:
        return None
    seen, error = edges.T.ravel(), np.maximum(errors.T.ravel(), _LEAST_ERROR_S)
    first, numbers = np.ones(count), np.arange(count, dtype=np.float64)
    # by the first start, the period and the width
    columns = np.vstack([np.stack([first, numbers, width], axis=1) for width in (0.0 * first, first)])
    covariance = np.linalg.inv(columns.T @ (columns / error[:, None] ** 2))
    solved = covariance @ columns.T @ (seen / error**2)
    fitted, spread = columns @ solved, np.sqrt(np.sum(columns @ covariance * columns, axis=1))
    if np.any(np.abs(seen - fitted) > np.maximum(_REGULAR_S, CRITERIA.sigmas * error)):
        return None
    start_s, period_s, width_s = solved.tolist()
    train = PulseTrain(start_s=start_s, width_s=width_s, period_s=period_s, count=count)
    return train, fitted.reshape(2, -1).T, spread.reshape(2, -1).T
