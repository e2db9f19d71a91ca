"""Torque that the lag of the control law needs, over the acceleration and the velocity, and how much of a pulse helps.

A sampled law sees position and velocity late against its set-points, so it works against a feed-forward of the inertia
alone: a lag T asks for Kv T a + Ki T v more, Kv and Ki of the velocity loop. T has parts of the rates, filters and
delays; so both factors are taken from the twin in closed loop, by least squares on its following error and on the
place of its table. A motor that follows better may overshoot a stop, where friction holds the table: it gets less.

The pulse after a reversal gets a factor from 0 to 1 by the same least squares: at rest the velocity loop holds part of
the torque, and the table of the friction goes from one direction to the other within some way, both by the motion.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.compensating.prediction import in_closed_loop
from hil.compensating.shapes import NEAR
from hil.control.compensation_tables import Adds, Compensation, CompensationLimits, CompensationTable, Over
from hil.motion.trajectory import Trajectory

_TRIED = 0.1  # of the largest value of a table: torque whose answer is simulated; the loop is linear where it slides

Tables = tuple[CompensationTable, ...]
ErrorsOf = Callable[[Tables], FloatArray]


def with_lag_of_law(
    bench: Bench,
    motion: Trajectory,
    compensation: Compensation,
    fade_in_s: float,
    limits: Callable[[Sequence[CompensationTable]], CompensationLimits],
) -> Tables:
    """The tables, those over acceleration and velocity enlarged, with which the twin errs least on a motion.

    They are enlarged by less, or not at all, where the table then rests elsewhere by more than a count of its encoder.
    A pulse is left out unless it takes more than `NEAR` of the errors. `limits`: those for tables. Raises FieldError
    without a control law.
    """
    first = round(fade_in_s / bench.period_s)

    def errors(of: Tables) -> FloatArray:
        found = in_closed_loop(bench, motion, replace(compensation, tables=of, limits=limits(of)))
        place = found.place_m[first:]
        return np.concatenate([found.following_m[first:], place - place.mean()])

    at_rest = np.flatnonzero(np.asarray(motion.velocity_m_s)[first:] == 0.0) + motion.position_m.size - first
    encoder = bench.encoders.table
    count_m = encoder.resolution_m if encoder is not None else np.inf
    pulses = tuple(one for one in compensation.tables if one.over is Over.REVERSAL_WAY)
    steady = tuple(one for one in compensation.tables if one not in pulses)
    plain = _enlarged(steady, (), errors, at_rest, count_m)
    if not pulses:
        return plain
    pulsed = _enlarged(steady, pulses, errors, at_rest, count_m)
    return pulsed if _rms(errors(pulsed)) < (1.0 - NEAR) * _rms(errors(plain)) else plain


def _enlarged(steady: Tables, pulses: Tables, errors: ErrorsOf, at_rest: NDArray[np.intp], count_m: float) -> Tables:
    """The tables with lines added to those over acceleration and velocity, and with a share of the pulses."""
    wanted = [one for one in steady if one.adds is Adds.TORQUE and one.over in (Over.ACCELERATION, Over.VELOCITY)]
    lines = [_line(one, _TRIED * float(np.abs(one.forward).max())) for one in wanted]
    tried = [*lines, *(_times(one, _TRIED) for one in pulses)]
    if not tried:
        return steady
    before = errors(steady)
    answers = np.column_stack([errors((*steady, one)) - before for one in tried])
    factors = _least_squares(answers, -before, len(pulses))
    added = {one.name: (line, float(factor)) for one, line, factor in zip(wanted, lines, factors, strict=False)}
    for share in (1.0, 0.5, 0.25):
        larger = tuple(
            _sum(one, added[one.name][0], share * added[one.name][1]) if one.name in added else one for one in steady
        )
        larger += tuple(
            _times(one, share * float(factor) * _TRIED)
            for one, factor in zip(pulses, factors[len(lines) :], strict=True)
        )
        after = errors(larger)
        moved = _rms(after[at_rest]) - _rms(before[at_rest])
        if np.sum(after**2) < np.sum(before**2) and moved <= count_m:
            return larger
    return steady


def _least_squares(answers: FloatArray, wanted: FloatArray, pulses: int) -> FloatArray:
    """Factors (n,) of the answers (m, n), those of the last `pulses` columns from 0 to the whole pulse."""
    factors = np.linalg.lstsq(answers, wanted, rcond=None)[0]
    lines = factors.size - pulses
    bounded = np.clip(factors[lines:], 0.0, 1.0 / _TRIED)
    rest = np.linalg.lstsq(answers[:, :lines], wanted - answers[:, lines:] @ bounded, rcond=None)[0]
    return np.concatenate([rest, bounded])


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


def _times(table: CompensationTable, factor: float) -> CompensationTable:
    return replace(table, forward=factor * table.forward, backward=factor * table.backward)
