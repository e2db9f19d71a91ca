"""Fit the edges and strengths of all windows of an event at once, together with the other parameters of a hypothesis.

The answer of the axis to an edge is over before the next one, since each block forgets: one simulation with all starts
shifted gives the derivatives by every start, each from the rows after it until the next (Curtis, Powell and Reid 1974).
So an iteration costs three simulations however many windows there are, and the derivatives are a sparse matrix with
three values in a row.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from scipy.sparse import csc_array

from hil.arrays import FloatArray
from hil.identification.coordinates import LAST_EDGE_STEP_S
from hil.identification.estimator import Estimator, Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import sandwich
from hil.identification.levenberg_marquardt import damped_step
from hil.identification.terms import Term, Window
from hil.twin.library import BY_ID

_SHIFT_S = 0.01  # largest shift of an edge in one step: residuals are linear over an observer's time constant
_FACTOR_STEP = 1e-3
_SHIFTS_S = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)  # of an edge that are tried
_BESIDE_S = 0.05  # rows beside a shifted edge: several time constants of the observer
_SEEN = 9.0  # growth of the energy in units of noise^2: three standard errors
_LEAST_GAIN = 1e-6  # relative to the cost, as for other fits


def fit_windows(fit: Fit, evaluations: int = 16, others: bool = True) -> Fit:
    """Fit the windows of the event in a fit, with the other parameters (`others`) or alone; then those once more.

    Returns the fit itself if it has no event in its runs.
    """
    estimator, at = fit.estimator, fit.hypothesis.rebased if others else fit.hypothesis
    index = next((index for index, term in enumerate(at.terms) if _inside(estimator, term)), None)
    if index is None:
        return fit
    inside = _inside(estimator, at.terms[index])
    slopes = _other_slopes(estimator, at, index) if others else np.empty((fit.rows, 0))
    free = [column for column in range(at.x.size) if column not in range(at.x.size)[at.columns(index)]]
    free = free if others else []
    residuals, damping = estimator.residuals(at), 1e-3
    among = slopes.T @ slopes
    for _ in range(evaluations):
        edges = _window_slopes(estimator, at, index)
        across = edges.T @ slopes
        normal = np.block([[among, across.T], [across, (edges.T @ edges).toarray()]])
        descent = np.concatenate([slopes.T @ residuals.vector, edges.T @ residuals.vector])
        size = np.sqrt(np.diag(normal))
        low, high = _limits(at, len(inside), free)
        while damping < 1e6:
            step = damped_step(normal, descent, damping, size, low, high)
            moved = _moved(at, index, inside, free, step)
            there = estimator.residuals(moved)
            gained = float(residuals.vector @ residuals.vector - there.vector @ there.vector)
            if gained > 0.0:
                break
            damping *= 10.0
        else:
            break
        at, residuals, damping = moved, there, 0.1 * damping
        if gained < _LEAST_GAIN * float(there.vector @ there.vector):
            break
    return estimator.fit(_referred(at, index), evaluations=4) if others else estimator.evaluate(at)


def window_errors(fit: Fit, index: int) -> FloatArray:
    """Standard errors (w, 3) of start, end and strength of the windows of a term in the runs of a fit.

    An edge at rest, where friction holds the force, may lie anywhere there: its error is at least `_free_shifts`.
    """
    at = fit.hypothesis.rebased
    inside = _inside(fit.estimator, at.terms[index])
    edges = _window_slopes(fit.estimator, at, index).toarray()
    both = np.hstack([_other_slopes(fit.estimator, at, index), edges])
    errors = sandwich(both, fit.residuals)[-3 * len(inside) :].reshape(3, -1).T
    term = at.resolved.terms[index]
    strength = abs(term.values[BY_ID[term.effect].strength])
    errors[:, :2] = np.maximum(errors[:, :2], _free_shifts(fit.estimator, at, index))
    return np.asarray(np.maximum(errors, [0.01 * LAST_EDGE_STEP_S] * 2 + [0.0]) * [1.0, 1.0, strength])


def _free_shifts(estimator: Estimator, at: Hypothesis, index: int) -> FloatArray:
    """Largest shifts (w, 2) [s] of start and end that worsen the residuals about them by less than `_SEEN`."""
    term, inside = at.terms[index], _inside(estimator, at.terms[index])
    base = estimator.residuals(at)
    runs = {run.name: run for run in estimator.data.runs}
    shifts = np.zeros((len(inside), 2))
    for edge, sign in product((0, 1), (-1.0, 1.0)):
        free = np.ones(len(inside), dtype=bool)
        for shift_s in (sign * size_s for size_s in _SHIFTS_S):
            later = (shift_s, 0.0) if edge == 0 else (0.0, shift_s)
            moved = estimator.residuals(_with(at, index, partial(_later, by_s=later)))
            for place, number in enumerate(inside):
                window = term.windows[number]
                run, at_s = runs[window.run], term.edges(window)[edge]
                span_s = min(at_s, at_s + shift_s) - _BESIDE_S, max(at_s, at_s + shift_s) + _BESIDE_S
                rows = slice(*np.searchsorted(run.time_s[run.evaluated], span_s))
                change = sum(
                    float(np.sum(part[rows] ** 2 - base.parts[key][rows] ** 2))
                    for key, part in moved.parts.items()
                    if estimator.data.runs[key[0]] is run
                )
                free[place] &= change < _SEEN
            shifts[free, edge] = np.maximum(shifts[free, edge], abs(shift_s))
    return shifts


def _later(_: int, window: Window, by_s: tuple[float, float]) -> Window:
    return window._replace(later_s=window.later_s + by_s[0], end_later_s=window.end_later_s + by_s[1])


def _inside(estimator: Estimator, term: Term) -> list[int]:
    """Indices of the windows of a term in the runs of the data."""
    names = {run.name for run in estimator.data.runs}
    return [number for number, window in enumerate(term.windows) if window.run in names]


def _other_slopes(estimator: Estimator, at: Hypothesis, index: int) -> FloatArray:
    """Derivatives by the parameters of all other terms."""
    return np.delete(estimator.jacobian(at), at.columns(index), axis=1)


def _with(at: Hypothesis, index: int, change: Callable[[int, Window], Window]) -> Hypothesis:
    """The hypothesis with changed windows."""
    term = at.terms[index]
    windows = tuple(change(number, window) for number, window in enumerate(term.windows))
    terms = (*at.terms[:index], replace(term, windows=windows), *at.terms[index + 1 :])
    return Hypothesis(at.bench, terms, at.x)


def _window_slopes(estimator: Estimator, at: Hypothesis, index: int) -> csc_array:
    """Derivatives (m, 3 w) by starts, ends and factors of the windows in the runs of the data."""
    term, inside = at.terms[index], _inside(estimator, at.terms[index])
    base = estimator.residuals(at)
    runs = estimator.data.runs
    times = [(runs[run].name, runs[run].time_s[runs[run].evaluated]) for run, _ in base.parts]
    step = LAST_EDGE_STEP_S
    changes: tuple[tuple[float, Callable[[int, Window], Window], int], ...] = (
        (step, lambda _, one: one._replace(later_s=one.later_s + step), 0),
        (step, lambda _, one: one._replace(end_later_s=one.end_later_s + step), 1),
        (_FACTOR_STEP, lambda _, one: one._replace(factor=one.factor + _FACTOR_STEP), 0),
    )
    values, rows, columns = [np.zeros(0)], [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    for kind, (size, change, edge) in enumerate(changes):
        change_of = (estimator.residuals(_with(at, index, change)).vector - base.vector) / size
        begin = 0
        for name, time_s in times:
            own = sorted(
                (term.edges(term.windows[number])[edge], place)
                for place, number in enumerate(inside)
                if term.windows[number].run == name
            )
            if own:
                first = np.searchsorted(time_s, [at_s - 2.0 * step for at_s, _ in own])
                places = np.array([place for _, place in own])
                rows.append(begin + np.arange(first[0], time_s.size))
                columns.append(kind * len(inside) + np.repeat(places, np.diff([*first, time_s.size])))
                values.append(change_of[rows[-1]])
            begin += time_s.size
    triplets = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csc_array(triplets, shape=(base.vector.size, 3 * len(inside)))


def _limits(at: Hypothesis, count: int, free: list[int]) -> tuple[FloatArray, FloatArray]:
    """Bounds of a step: those of the parameters, and of one shift of the edges of `count` windows."""
    low, high = at.bounds
    limits = np.concatenate([np.full(2 * count, _SHIFT_S), np.full(count, 1e3)])
    return np.concatenate([(low - at.x)[free], -limits]), np.concatenate([(high - at.x)[free], limits])


def _moved(at: Hypothesis, index: int, inside: list[int], free: list[int], step: FloatArray) -> Hypothesis:
    """The hypothesis after a step of its parameters `free` and of the windows `inside`."""
    x = at.x.copy()
    x[free] += step[: len(free)]
    starts, ends, factors = step[len(free) :].reshape(3, -1)
    places = {number: place for place, number in enumerate(inside)}

    def change(number: int, one: Window) -> Window:
        if number not in places:
            return one
        start, end, factor = (float(part[places[number]]) for part in (starts, ends, factors))
        return Window(one.run, one.later_s + start, one.end_later_s + end, one.factor + factor)

    return _with(at.moved(x), index, change)


def _referred(at: Hypothesis, index: int) -> Hypothesis:
    """The same hypothesis with the strongest window as the values of the term."""
    term = at.resolved.terms[index]
    first = max(term.windows, key=lambda one: abs(one.factor))
    windows = tuple(
        Window(one.run, one.later_s - first.later_s, one.end_later_s - first.end_later_s, one.factor / first.factor)
        for one in term.windows
    )
    return at.replaced(index, replace(term, values=term.at(first), windows=windows))
