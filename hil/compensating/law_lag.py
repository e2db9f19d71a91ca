"""Torque that the lag of the control law needs, over the acceleration and the velocity.

A sampled law sees position and velocity late against its set-points, so it works against a feed-forward of the inertia
alone: a lag T asks for Kv T a + Ki T v more, Kv and Ki of the velocity loop. T has parts of the rates, filters and
delays; so both factors are taken from the twin in closed loop, by least squares on its following error and on the
place of its table. A motor that follows better may overshoot a stop, where friction holds the table: it gets less.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.compensating.prediction import in_closed_loop
from hil.control.compensation_tables import Adds, Compensation, CompensationLimits, CompensationTable, Over
from hil.motion.trajectory import Trajectory

_TRIED = 0.1  # of the largest value of a table: torque whose answer is simulated; the loop is linear where it slides


def with_lag_of_law(
    bench: Bench,
    motion: Trajectory,
    compensation: Compensation,
    fade_in_s: float,
    limits: Callable[[Sequence[CompensationTable]], CompensationLimits],
) -> tuple[CompensationTable, ...]:
    """The tables with those over acceleration and velocity enlarged, so that the twin errs least on a motion.

    They are enlarged by less, or not at all, where the table then rests elsewhere by more than a count of its encoder.
    `limits`: those for tables. Raises FieldError without a control law.
    """
    tables, first = compensation.tables, round(fade_in_s / bench.period_s)

    def errors(of: tuple[CompensationTable, ...]) -> FloatArray:
        found = in_closed_loop(bench, motion, replace(compensation, tables=of, limits=limits(of)))
        place = found.place_m[first:]
        return np.concatenate([found.following_m[first:], place - place.mean()])

    wanted = [one for one in tables if one.adds is Adds.TORQUE and one.over in (Over.ACCELERATION, Over.VELOCITY)]
    lines = [_line(one, _TRIED * float(np.abs(one.forward).max())) for one in wanted]
    if not lines:
        return tables
    before = errors(tables)
    answers = np.column_stack([errors((*tables, line)) - before for line in lines])
    factors = np.linalg.lstsq(answers, -before, rcond=None)[0]
    added = {one.name: (line, float(factor)) for one, line, factor in zip(wanted, lines, factors, strict=True)}
    encoder = bench.encoders.table
    count_m = encoder.resolution_m if encoder is not None else np.inf
    at_rest = np.flatnonzero(np.asarray(motion.velocity_m_s)[first:] == 0.0) + before.size // 2
    for share in (1.0, 0.5, 0.25):
        larger = tuple(
            _sum(one, added[one.name][0], share * added[one.name][1]) if one.name in added else one for one in tables
        )
        after = errors(larger)
        moved = _rms(after[at_rest]) - _rms(before[at_rest])
        if np.sum(after**2) < np.sum(before**2) and moved <= count_m:
            return larger
    return tables


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _line(table: CompensationTable, largest: float) -> CompensationTable:
    """A torque in proportion to the quantity of a table."""
    end = float(np.abs(table.at).max())
    at, values = np.array([-end, end]), np.array([-largest, largest])
    return CompensationTable("lag of the law", table.adds, table.over, at, values, values)


def _sum(table: CompensationTable, line: CompensationTable, factor: float) -> CompensationTable:
    more = factor * line.forward[-1] / line.at[-1] * table.at
    return replace(table, forward=table.forward + more, backward=table.backward + more)
