"""Detect events of a recording: windows in which a constant force acts, from the disturbance torque that a fit leaves.

Disturbance torque = what errors of inertia and friction explain + a constant level in each window. Both are estimated
in turn, and so is the noise beside the windows. The motion is the measured one: the torque of a loop has the shape of
the windows itself.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.change_points import Segment, joined, segments, standing_out
from hil.diagnosis.search.disturbance import Disturbance, disturbance
from hil.identification.derivatives import MeasuredMotion
from hil.identification.estimator import Fit
from hil.identification.least_squares import least_absolute
from hil.identification.measured import Measured
from hil.identification.plain_model import plain_columns
from hil.identification.residual_scales import inertia

BLOCK_S = 0.005  # an edge to be refined by simulation
SHORTEST, EDGE = 3, 6  # blocks of the shortest window; blocks in which the observer follows an edge
_MOST_BLOCKS = 6000  # the time of a partition grows with their square: half a second
_REVERSAL_S = 0.05  # about a reversal, a start or a stop friction is known least
_ALIKE = 0.25  # levels of adjacent windows that differ less are one
_ROUNDS = 3  # windows found in one round do not count as motion or noise in the next; then they stay
_LEAST_USUAL = 0.3  # of the blocks without an event: else the level without one is unknown
_SMOOTH_BLOCKS = 8  # the noise of a block is that of means over 40 ms: longer than the observer remembers


class Event(NamedTuple):
    """A window [s] of a run, by its name, and the level in it, in motor units."""

    run: str
    start_s: float
    end_s: float
    level: float


def detect(fit: Fit) -> list[Event]:
    """Find the events of all runs of a fit, beside its permanent terms; none about a reversal or a start.

    They are those that hold nearly all energy of the windows: a fit that begins with many faint ones ends nowhere. What
    those leave shows beside the fitted ones (`left_over`).
    """
    known = [index for index, term in enumerate(fit.hypothesis.terms) if term.windows]
    events = _of_fit(fit.estimator.evaluate(fit.hypothesis.without(*known)) if known else fit, False)
    left_out = faint([(one.start_s, one.end_s, one.level) for one in events])
    return [one for one, leave in zip(events, left_out, strict=True) if not leave]


def faint(windows: Sequence[tuple[float, float, float]]) -> list[bool]:
    """True for windows (start, end, level) that hold next to nothing of the energy of all, weakest first."""
    energies = np.array([level**2 * (end_s - start_s) for start_s, end_s, level in windows])
    weak, order = np.zeros(len(windows), dtype=bool), np.argsort(energies)
    weak[order] = np.cumsum(energies[order]) < CRITERIA.faint * energies.sum()
    return [bool(one) for one in weak]


def left_over(fit: Fit) -> list[Event]:
    """Find the events that a fit with events leaves, also those about a reversal that stand out against the others."""
    return _of_fit(fit, True)


def _of_fit(fit: Fit, reversals: bool) -> list[Event]:
    pairs = zip(fit.data.runs, fit.residuals.channels, strict=True)
    axis, observer_s = inertia(fit.bench), fit.data.observer_s
    return [
        event
        for run, channels in pairs
        if run.observability.torque_measured and np.isfinite(channels["motor"]).all()  # a twin may be unstable
        for event in _of_run(run, disturbance(run, channels["motor"], axis, observer_s), reversals)
    ]


def _of_run(run: Measured, seen: Disturbance, reversals: bool) -> list[Event]:
    first = run.lead_in  # those rows belong to another part
    seen = Disturbance(seen.torque[first:], seen.velocity[first:], seen.sliding[first:])
    block = max(round(BLOCK_S / run.period_s), -(-seen.sliding.size // _MOST_BLOCKS), 1)
    rows = seen.sliding.size // block * block
    reversals_at = np.diff(np.signbit(seen.velocity), append=np.signbit(seen.velocity[-1]))
    starts_at = np.diff(seen.sliding, append=seen.sliding[-1])
    turns = (reversals_at | starts_at).astype(float)
    turning = np.convolve(turns, np.ones(2 * round(_REVERSAL_S / run.period_s) + 1), "same") > 0.5
    usable = seen.sliding if reversals else seen.sliding & ~turning
    usable = usable & (np.arange(usable.size) >= run.evaluated.start - first)

    def means(values: FloatArray) -> FloatArray:
        whole = (values * usable)[:rows].reshape(-1, block)
        return np.asarray(whole.sum(axis=1) / np.maximum(known, 1), dtype=np.float64)

    known = usable[:rows].reshape(-1, block).sum(axis=1)
    weights = np.asarray(known >= block / 2, dtype=np.float64)
    if not weights.any():
        return []
    values = means(seen.torque)
    speed = means(seen.velocity) / max(float(np.abs(seen.velocity).max()), 1e-300)
    acceleration = means(np.gradient(seen.velocity, run.period_s))
    moved = MeasuredMotion(np.zeros(speed.size), speed, acceleration, np.sign(speed))
    columns = {**plain_columns(moved), "viscous, by direction": np.abs(speed)}
    usual, rest = weights, values
    for _ in range(_ROUNDS):
        rest = values - least_absolute(columns, values, usual)
        windows = standing_out(rest, weights, _windows(rest, weights), CRITERIA.stands_out, EDGE)
        usual = weights.copy()
        for one in windows:
            usual[one.first : one.last] = 0.0
        if usual.sum() < _LEAST_USUAL * weights.sum():
            return []
    near = np.any(turning[:rows].reshape(-1, block), axis=1, keepdims=True)[:, 0]
    windows = [one for one in windows if _beyond_reversals(rest, weights, near, one)]
    at_s, length_s = run.time_s[first], block * run.period_s
    # edges are where the torque is seen: at rest before and after it a window may begin anywhere
    shown = [one.first + np.flatnonzero(weights[one.first : one.last])[[0, -1]] + [0, 1] for one in windows]
    return [
        Event(run.name, at_s + float(begin) * length_s, at_s + float(end) * length_s, one.level)
        for one, (begin, end) in zip(windows, shown, strict=True)
    ]


def _beyond_reversals(rest: FloatArray, weights: FloatArray, near: NDArray[np.bool_], one: Segment) -> bool:
    """False for a window mostly about a reversal, if its level is not well above the residuals at other reversals."""
    known = weights[one.first : one.last]
    if 2.0 * known[near[one.first : one.last]].sum() <= known.sum():
        return True
    others = near & (weights > 0.0)
    others[max(one.first - EDGE, 0) : one.last + EDGE] = False
    return abs(one.level) > CRITERIA.stands_out * float(np.sqrt(np.mean(rest[others] ** 2) if others.any() else np.inf))


def _windows(rest: FloatArray, weights: FloatArray) -> list[Segment]:
    """Windows of constant level in a signal (n,), and its noise beside them, estimated in turn."""
    windows, beside = list[Segment](), weights
    for _ in range(_ROUNDS):
        noise = _noise(rest, beside)
        if noise <= 0.0:
            break
        cut = joined(
            segments(rest, weights, noise**2, 3.0 * np.log(rest.size) + CRITERIA.evidence), weights, EDGE, _ALIKE
        )
        before, windows = windows, [one for one in cut if weights[one.first : one.last].sum() >= SHORTEST]
        beside = weights.copy()
        for one in windows:
            beside[one.first : one.last + EDGE] = 0.0
        if windows == before or beside.sum() < _LEAST_USUAL * weights.sum():
            break
    return windows


def _noise(rest: FloatArray, weights: FloatArray) -> float:
    """Standard deviation of a block of a signal (n,), from the differences of neighbouring means; 0 if unknown."""
    if rest.size < 2 * _SMOOTH_BLOCKS:
        return 0.0
    known, total = (np.convolve(values, np.ones(_SMOOTH_BLOCKS), "valid") for values in (weights, rest * weights))
    means, enough = total / np.maximum(known, 1.0), known >= _SMOOTH_BLOCKS / 2
    steps = (means[_SMOOTH_BLOCKS:] - means[:-_SMOOTH_BLOCKS])[enough[_SMOOTH_BLOCKS:] & enough[:-_SMOOTH_BLOCKS]]
    return 1.4826 * float(np.median(np.abs(steps)) * np.sqrt(_SMOOTH_BLOCKS / 2.0)) if steps.size else 0.0
