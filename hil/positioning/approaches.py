"""Positioning deviations at targets that are approached from both sides, from a recording or from readings in a CSV."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.csv_columns import read_columns, read_header
from hil.identification.measured import bench_of
from hil.quantities import UNITS
from hil.recording.recording import Recording

LEAST_REST_S = 0.1  # longer than the rests between segments, which are on a grid of milliseconds
READ_SHARE = 0.5  # of a rest at its end: the servo loop has settled
SAME_M = 1e-7  # targets nearer than this are one
_STILL = 1e-9  # change of a set-point from row to row that is none [m]


@dataclass(frozen=True, eq=False)
class Approaches:
    """Deviations [m, rad] of n cycles at m targets (m,) in ascending order, forward and backward (m, n)."""

    name: str
    unit: str
    target_m: FloatArray
    forward_m: FloatArray
    backward_m: FloatArray
    notes: tuple[str, ...] = ()


class Stop(NamedTuple):
    """A standstill: target, direction of approach (1 forward, -1 backward), deviation [m]."""

    target_m: float
    way: int
    deviation_m: float


def from_recording(run: Recording) -> Approaches:
    """Take the mean of the linear encoder over the second half of each standstill; targets are the set-points there.

    Raises InputError without a linear encoder or set-points, or without targets that are approached from both sides.
    """
    command, table = run["position_command_m"], run["table_position_m"]
    moves = np.diff(command)
    rest = np.concatenate([[False], np.abs(moves) <= _STILL, [False]])
    edges = np.flatnonzero(np.diff(rest.astype(np.int8)))
    stops = list[Stop]()
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        way = np.sign(moves[first - 1]) if first > 0 else 0.0
        if way == 0.0 or (last - first) * run.period_s < LEAST_REST_S:
            continue
        read = slice(last + 1 - max(round(READ_SHARE * (last - first)), 1), last + 1)
        stops.append(Stop(float(command[last]), int(way), float(np.mean(table[read] - command[last]))))
    turns = isinstance(run.metadata.get("bench"), dict) and bench_of(run).axis.turns
    return _gathered(run.name, "rad" if turns else "m", stops)


def from_readings(path: Path) -> Approaches:
    """Read the CSV of a laser: columns target_UNIT and reading_UNIT or deviation_UNIT, a row per standstill in order.

    A row is approached from the row before it; where that has the same target, the axis has turned beyond it. The
    column `direction` (1, -1) says so instead. Raises InputError for other columns, units or orders.
    """
    names = read_header(path)
    found = {}
    for name in names:
        what, _, unit = name.strip().partition("_")
        if what in ("target", "reading", "deviation") and unit in UNITS and UNITS[unit][0] in ("m", "rad"):
            found[what] = (name, *UNITS[unit])
    measured = found.get("reading") or found.get("deviation")
    if "target" not in found or measured is None or measured[1] != found["target"][1]:
        raise InputError(
            f"{path}: given {listed(names)}, allowed the columns target_mm and reading_mm, or deviation_um, in any "
            "unit of length or angle; rename them"
        )
    with_way = "direction" in names
    columns = read_columns(path, [found["target"][0], measured[0], *(["direction"] if with_way else [])])
    target = columns[found["target"][0]] * found["target"][2]
    deviation = columns[measured[0]] * measured[2] - (target if "reading" in found else 0.0)
    ways = np.sign(columns["direction"]) if with_way else _ways(target)
    if np.any(ways == 0.0):
        raise InputError(f"{path}: the direction of approach is not told; add a column direction with 1 or -1")
    rows = zip(target.tolist(), ways.astype(int).tolist(), deviation.tolist(), strict=True)
    return _gathered(path.stem, found["target"][1], [Stop(*row) for row in rows])


def _ways(target: FloatArray) -> FloatArray:
    """Direction of approach of each row (n,) from the order of the targets."""
    ways = np.sign(np.diff(target, prepend=np.nan))
    ways[0] = next((way for way in ways[1:] if way != 0.0), 0.0) if target.size > 1 else 0.0
    for row in np.flatnonzero(ways == 0.0):
        ways[row] = -ways[row - 1]
    return np.asarray(ways)


def _gathered(name: str, unit: str, stops: list[Stop]) -> Approaches:
    targets = list[float]()
    for one in sorted(stop.target_m for stop in stops):
        if not targets or one - targets[-1] > SAME_M:
            targets.append(one)

    def of(target: float, way: int) -> list[float]:
        return [one.deviation_m for one in stops if one.way == way and abs(one.target_m - target) <= SAME_M]

    both = [target for target in targets if of(target, 1) and of(target, -1)]
    counts = [len(of(target, way)) for target in both for way in (1, -1)]
    if len(both) < 2 or min(counts) < 2:
        raise InputError(
            f"{name}: given {len(both)} targets with standstill that are approached from both sides, the fewest "
            f"{min(counts, default=0)} times, allowed 2 and more, twice and more; record such as "
            "hil run profiles/positioning_iso_230_2.yaml"
        )
    cycles = min(counts)
    forward, backward = (np.array([of(target, way)[:cycles] for target in both]) for way in (1, -1))
    return Approaches(name, unit, np.array(both), forward, backward, tuple(_notes(np.array(both), counts)))


def _notes(target: FloatArray, counts: list[int]) -> list[str]:
    notes = list[str]()
    cycles, gaps = min(counts), np.diff(target)
    if max(counts) > cycles:
        notes.append(f"some targets have up to {max(counts)} approaches; the first {cycles} of each direction count")
    if target.size < 5 or cycles < 5:
        notes.append(f"{target.size} targets and {cycles} cycles; ISO 230-2 asks for 5 and 5 at least")
    if target.size > 2 and np.ptp(gaps) <= 1e-3 * gaps.mean():
        notes.append("the targets are equally spaced: a periodic error of that pitch, or a part of it, is not seen")
    return notes
