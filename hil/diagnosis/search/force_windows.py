"""Windows of time in which the torque tells a force, by least squares alone.

    T = A b + a 1(t1 <= t < t2) + e,    t1 and t2 where the sum of squares of e is least

T is the torque, measured or needed beyond that of a twin, A the columns of the plain model, the speed without its sign,
and slow cosines over time, since a torque wanders. With the error s of the jackknife over blocks a / s is Student's t
of as many blocks less one; each pair of moments is one question more (G. C. Chow, Econometrica 28 (1960) 591, with two
unknown moments). What a twin lacks comes again with the motion, in most blocks, and so enlarges s; what happens once
does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.event_detection import Event
from hil.diagnosis.wording import whole_name
from hil.identification.dataset import Dataset, in_turn
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import measured_motion
from hil.identification.least_squares import Estimate, LinearFit, least_squares
from hil.identification.measured import Measured
from hil.identification.plain_model import PlainModel, plain_columns
from hil.identification.structure import ResidualSeries
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain, needed_torque
from hil.identification.whitening import RANK

_STEPS = 200  # of the rows in order of time, between which edges are sought
_BLOCKS = 20  # of the jackknife
_SHORTEST = 2 * _STEPS // _BLOCKS  # steps: a window covers one block, and rows of others
_TOLD = 0.05  # of the power of a window: below, the other columns do what it does
_SLOW = 6  # half periods of a wander of the torque over the recording
_MOST = 4  # windows of a recording
CUT_S = 0.15  # at the cut of a recording: rows at rest or not evaluated


class ForceWindow(NamedTuple):
    """Start and end [s], level beside the rest [motor units], and its chance."""

    start_s: float
    end_s: float
    level: float
    p: float


def torque_windows(fit: Fit, data: Dataset) -> list[Event]:
    """Windows in which the torque of recordings tells a force, beside the twin of a fit or beside none.

    Parts of one recording are one. A window over a cut is one in each part.
    """
    plain = fit_plain(fit.data) if data.observability.torque_measured else None
    if plain is None:
        return []
    found = list[Event]()
    for group in _groups(data):
        told = [windows_of(one) for one in _seen(fit.hypothesis, data.over(group), plain)]
        best = min(told, key=lambda windows: min((one.p for one in windows), default=1.0), default=[])
        for one, run in product(best, group):
            first_s, last_s = run.time_s[run.evaluated][[0, -1]].tolist()
            begin_s, end_s = max(one.start_s, first_s), min(one.end_s, last_s)
            if begin_s < end_s:
                found.append(Event(run.name, begin_s, end_s, -one.level))
    return found


def strength_told(without: Fit, term: Term, data: Dataset) -> bool:
    """True if the torque of recordings tells one of the long windows of an event, beside the twin of a fit without it.

    Else it is a torque that wanders. A single window from the first row on is asked too: it may be the state in which
    the recording begins. True also where none is asked, or there is no torque.
    """
    plain = fit_plain(without.data) if data.observability.torque_measured else None
    chances = [1.0]
    for group in _groups(data) if plain else ():
        part = data.over(group)
        edges = [term.edges(one) for one in term.windows if one.run in {run.name for run in group}]
        for seen in _seen(without.hypothesis, part, plain) if plain and edges else ():
            inside = [seen.inside(*one) for one in _uncut(edges)]
            fit = seen.fit(inside)
            asked = [at for at, one in enumerate(inside) if one.sum() * _STEPS >= _SHORTEST * one.size]
            if len(edges) == 1 and edges[0][0] - seen.time_s[0] < CUT_S:
                asked = [0]
            chances += [_once(fit[f"force {at}"]) for at in asked]
    return len(chances) == 1 or min(chances) < CRITERIA.significance


def _groups(data: Dataset) -> list[list[Measured]]:
    """The parts of each recording, in order of time; all runs together if one follows the other."""
    if ordered := in_turn(data.runs):
        return [ordered]
    names = dict.fromkeys(whole_name(run.name) for run in data.runs)
    parts = [[run for run in data.runs if whole_name(run.name) == name] for name in names]
    return [group for one in parts for group in ([in_turn(one)] if in_turn(one) else [[run] for run in one])]


def _uncut(edges: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Windows (start, end) in order of time; those that a cut of the recording parts are one."""
    found = list[tuple[float, float]]()
    for start_s, end_s in sorted(edges):
        if found and start_s - found[-1][1] < CUT_S:
            found[-1] = found[-1][0], max(end_s, found[-1][1])
        else:
            found.append((start_s, end_s))
    return found


@dataclass(frozen=True, eq=False)
class SlidingTorque:
    """A torque (n,) at times (n,) where the axis slides, and what else acts: columns (n, k)."""

    time_s: FloatArray
    torque: FloatArray
    table: FloatArray

    def inside(self, start_s: float, end_s: float) -> FloatArray:
        """1 in a window, 0 outside of it (n,)."""
        return ((self.time_s >= start_s) & (self.time_s <= end_s)).astype(np.float64)

    def fit(self, windows: Sequence[FloatArray]) -> LinearFit:
        """Least squares with the forces in windows (n,), named by their number."""
        columns = {f"{number}": column for number, column in enumerate(self.table.T)}
        forces = {f"force {number}": one for number, one in enumerate(windows)}
        return least_squares({**columns, **forces}, self.torque, blocks=_BLOCKS)


def _seen(hypothesis: Hypothesis, data: Dataset, plain: PlainModel) -> list[SlidingTorque]:
    """The torque of runs in order of time, needed beyond a twin and measured, as far as there are rows enough."""
    needed = needed_torque(hypothesis, data, plain)
    motions = [measured_motion(run) for run in data.runs]
    ratio = data.bench.axis.ratio_m_rad if data.bench.axis.turns else None
    measured = [ResidualSeries(one.torque, series.rows) for one, series in zip(motions, needed, strict=True)]
    found = [torque_over_time(data.runs, series, ratio) for series in (needed, measured)]
    return [one for one in found if one.torque.size >= 2 * _STEPS and np.isfinite(one.torque).all()]


def torque_over_time(runs: Sequence[Measured], series: Sequence[ResidualSeries], ratio: float | None) -> SlidingTorque:
    """The torque of runs beside the plain model, a torque over the position, and a slow wander.

    `ratio` [load rad per motor rad] is that of a load that turns.
    """
    rows = [one.rows for one in series]
    time_s, torque = (
        np.concatenate([one[at] for one, at in zip(each, rows, strict=True)])
        for each in ([run.time_s for run in runs], [one.left for one in series])
    )
    moved = [measured_motion(run).moved for run in runs]
    columns = [{**plain_columns(one, ratio, spring=True), "speed": np.abs(one.velocity)} for one in moved]
    table = np.column_stack(
        [np.concatenate([one[name][at] for one, at in zip(columns, rows, strict=True)]) for name in columns[0]]
    )
    phase = np.pi * (time_s - time_s[:1]) / max(float(np.ptp(time_s)) if time_s.size else 0.0, 1e-300)
    return SlidingTorque(time_s, torque, np.column_stack([table, np.cos(np.outer(phase, np.arange(1, _SLOW + 1)))]))


def windows_of(seen: SlidingTorque) -> list[ForceWindow]:
    """Windows of a torque; each is told beside the others."""
    edges = np.linspace(0, seen.torque.size, _STEPS + 1).astype(int)
    found, taken = list[FloatArray](), np.zeros(_STEPS, dtype=bool)
    for _ in range(_MOST):  # a window that is left counts as noise of the others
        first, last = _most_explained(np.column_stack([seen.table, *found]), seen.torque, edges, taken)
        taken[first:last] = True
        found.append(np.zeros(seen.torque.size))
        found[-1][edges[first] : edges[last]] = 1.0
    while found:
        fit = seen.fit(found)
        forces = [fit[f"force {at}"] for at in range(len(found))]
        chances = [min(_once(force) * _STEPS**2 / 2.0, 1.0) for force in forces]
        if max(chances) < CRITERIA.significance:
            ends = [seen.time_s[inside > 0.0] for inside in found]
            windows = zip(ends, forces, chances, strict=True)
            return [
                _shorter(ForceWindow(float(at[0]), float(at[-1]), force.value, p), seen.time_s)
                for at, force, p in windows
            ]
        del found[int(np.argmax(chances))]
    return []


def _once(force: Estimate) -> float:
    """Chance of a force in a window that is given; 1 where it is not told."""
    if not (np.isfinite(force.std_error) and force.std_error > 0.0):
        return 1.0
    return 2.0 * float(student.sf(abs(force.value) / force.std_error, _BLOCKS - 1))


def _shorter(window: ForceWindow, time_s: FloatArray) -> ForceWindow:
    """A window from the first row or to the last one, or the rest of the rows, whichever is shorter."""
    begin_s, end_s = float(time_s[0]), float(time_s[-1])
    whole = window.end_s - window.start_s > 0.5 * (end_s - begin_s)
    if whole and window.start_s <= begin_s:
        return ForceWindow(window.end_s, end_s, -window.level, window.p)
    if whole and window.end_s >= end_s:
        return ForceWindow(begin_s, window.start_s, -window.level, window.p)
    return window


def _most_explained(
    table: FloatArray, torque: FloatArray, edges: NDArray[np.intp], taken: NDArray[np.bool_]
) -> tuple[int, int]:
    """First and last edge of the window that explains most of a torque (n,) beside columns (n, k), in steps that are
    not `taken`."""
    basis, size, _ = np.linalg.svd(table / np.maximum(np.linalg.norm(table, axis=0), 1e-300), full_matrices=False)
    basis = basis[:, size > RANK * size[0]]
    left = torque - basis @ (basis.T @ torque)
    sums = np.vstack([np.zeros(basis.shape[1] + 1), np.cumsum(np.column_stack([basis, left]), axis=0)])[edges]
    inside, numbers = sums[None] - sums[:, None], np.arange(edges.size)
    count, steps = (np.subtract.outer(one, one).T.astype(np.float64) for one in (edges, numbers))
    power = count - np.sum(inside[..., :-1] ** 2, axis=2)
    before = np.concatenate([[0], np.cumsum(taken)])
    fits = (steps >= _SHORTEST) & (steps <= _STEPS - _SHORTEST) & (power > _TOLD * count)
    fits &= np.equal.outer(before, before)
    gain = np.where(fits, inside[..., -1] ** 2 / np.where(fits, power, 1.0), 0.0)
    first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return int(first), int(last)
