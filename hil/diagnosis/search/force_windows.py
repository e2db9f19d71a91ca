"""Windows of time in which the torque tells a force, by least squares alone.

    T = A b + a 1(t1 <= t < t2) + e,    t1 and t2 where the sum of squares of e is least

T is the torque, measured or needed beyond that of a twin, A the columns of the plain model, the speed without its sign,
and slow cosines over time, since a torque wanders. With the error s of the jackknife over blocks a / s is Student's t
of as many blocks less one; each pair of moments is one question more (G. C. Chow, Econometrica 28 (1960) 591, with two
unknown moments). What a twin lacks comes again with the motion, in most blocks, and so enlarges s; what happens once
does not.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.event_detection import Event
from hil.identification.dataset import Dataset, in_turn
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.least_squares import Estimate, least_squares
from hil.identification.measured import Measured
from hil.identification.plain_model import PlainModel, plain_columns
from hil.identification.structure import ResidualSeries
from hil.identification.torque_left import fit_plain, measured_motion, needed_torque
from hil.identification.whitening import RANK

_STEPS = 200  # of the rows in order of time, between which edges are sought
_BLOCKS = 20  # of the jackknife
_SHORTEST = 2 * _STEPS // _BLOCKS  # steps: a window covers one block, and rows of others
_TOLD = 0.05  # of the power of a window: below, the other columns do what it does
_SLOW = 6  # half periods of a wander of the torque over the recording
_MOST = 4  # windows of a recording


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
    ordered = in_turn(data.runs)
    groups = [ordered] if ordered else [[run] for run in data.runs]
    return [event for group in groups for event in _of_group(fit.hypothesis, data.over(group), plain)]


def _of_group(hypothesis: Hypothesis, data: Dataset, plain: PlainModel) -> list[Event]:
    """Events of runs that are parts of one recording, in order of time."""
    needed = needed_torque(hypothesis, data, plain)
    motions = [measured_motion(run) for run in data.runs]
    measured = [ResidualSeries(one.torque, series.rows) for one, series in zip(motions, needed, strict=True)]
    ratio = data.bench.axis.ratio_m_rad if data.bench.axis.turns else None
    found = [windows_of(data.runs, series, ratio) for series in (needed, measured)]
    best = min(found, key=lambda windows: min((one.p for one in windows), default=1.0))
    return [
        Event(run.name, max(one.start_s, first_s), min(one.end_s, last_s), -one.level)
        for one in best
        for run in data.runs
        for first_s, last_s in [tuple(run.time_s[run.evaluated][[0, -1]])]
        if max(one.start_s, first_s) < min(one.end_s, last_s)
    ]


def windows_of(runs: Sequence[Measured], series: Sequence[ResidualSeries], ratio: float | None) -> list[ForceWindow]:
    """Windows of a torque (n,) of runs; each is told beside the others, and beside a torque over the position.

    `ratio` [load rad per motor rad] is that of a load that turns.
    """
    moved = [measured_motion(run).moved for run in runs]
    rows = [one.rows for one in series]
    time_s, torque = (
        np.concatenate([one[at] for one, at in zip(each, rows, strict=True)])
        for each in ([run.time_s for run in runs], [one.left for one in series])
    )
    if torque.size < 2 * _STEPS or not np.isfinite(torque).all():
        return []
    columns = [{**plain_columns(one, ratio, spring=True), "speed": np.abs(one.velocity)} for one in moved]
    table = np.column_stack(
        [np.concatenate([one[name][at] for one, at in zip(columns, rows, strict=True)]) for name in columns[0]]
    )
    table = np.column_stack([table, _wander(time_s)])
    edges = np.linspace(0, torque.size, _STEPS + 1).astype(int)
    names = {f"{number}": column for number, column in enumerate(table.T)}
    found, taken = dict[tuple[int, int], FloatArray](), np.zeros(_STEPS, dtype=bool)
    for _ in range(_MOST):  # a window that is left counts as noise of the others
        first, last = _most_explained(np.column_stack([table, *found.values()]), torque, edges, taken)
        taken[first:last] = True
        inside = np.zeros(torque.size)
        inside[edges[first] : edges[last]] = 1.0
        found[int(edges[first]), int(edges[last])] = inside
    while found:
        fit = least_squares({**names, **{str(rows): one for rows, one in found.items()}}, torque, blocks=_BLOCKS)
        told = {rows: _chance(fit[str(rows)]) for rows in found}
        least = max(told, key=lambda rows: told[rows])
        if told[least] < CRITERIA.significance:
            windows = (
                ForceWindow(float(time_s[first]), float(time_s[last - 1]), fit[str((first, last))].value, chance)
                for (first, last), chance in told.items()
            )
            return [_shorter(one, time_s) for one in windows]
        del found[least]
    return []


def _chance(force: Estimate) -> float:
    """Chance of a force, of as many questions as there are windows; 1 where it is not told."""
    if not (np.isfinite(force.std_error) and force.std_error > 0.0):
        return 1.0
    once = 2.0 * float(student.sf(abs(force.value) / force.std_error, _BLOCKS - 1))
    return min(once * _STEPS**2 / 2.0, 1.0)


def _wander(time_s: FloatArray) -> FloatArray:
    """Cosines (n, k) over time, of a torque that wanders slowly; a force begins and ends at once."""
    phase = np.pi * (time_s - time_s[0]) / max(float(np.ptp(time_s)), 1e-300)
    return np.cos(np.outer(phase, np.arange(1, _SLOW + 1)))


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
