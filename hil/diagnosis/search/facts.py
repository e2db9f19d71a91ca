"""Facts of an axis and of its recordings, without a twin: what the values of a mechanism are checked against."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from hil.bench.bench_file import Bench
from hil.diagnosis.criteria import CRITERIA
from hil.identification.derivatives import motion, rows_per_sample
from hil.identification.least_squares import least_squares
from hil.identification.measured import Measured
from hil.identification.periods import harmonic_share
from hil.twin.scene import AxisFacts

_MOVES = 0.01  # of the largest step of the motor in a row: above rest and noise


def axis_facts(bench: Bench, runs: Sequence[Measured] = ()) -> AxisFacts:
    """Collect facts of the axis, with the nominal parameters of `bench`, and of its recordings."""
    physics, table, limit = bench.axis.physics(), bench.encoders.table, bench.gains.torque_limit_n_m
    peak = max((float(np.max(np.abs(run.torque))) for run in runs), default=0.0)
    ratio = bench.axis.ratio_m_rad
    apart = [lost_motion_m(run) for run in runs if run.table_m.size]
    return AxisFacts(
        coulomb=physics.coulomb_n_m,
        ratio=ratio,
        angle_per_unit=physics.angle_per_unit,
        rated_torque=limit / 3.0 if np.isfinite(limit) else peak,
        table_count_m=table.resolution_m if table is not None else None,
        duration_s=max((run.motor.size * run.period_s for run in runs), default=0.0),
        travel_m=max((ratio * float(np.ptp(run.motor)) for run in runs), default=math.inf),
        positions_m=(
            min((ratio * float(np.min(run.motor)) for run in runs), default=-math.inf),
            max((ratio * float(np.max(run.motor)) for run in runs), default=math.inf),
        ),
        lost_m=max(apart, default=math.inf),
        turn_known=physics.turn_known,
        torque_delay_s=bench.torque_delay_s or 0.0,
        held_s=lambda level: max((_held_s(run, level) for run in runs), default=math.inf),
        driven=lambda level: _driven(runs, level),
        swings=lambda line_hz: _swings(runs, line_hz),
        grows_with_speed=lambda line_hz: any(_grows_with_speed(run, line_hz) for run in runs),
    )


def _swings(runs: Sequence[Measured], line_hz: float) -> float:
    """Largest share of the energy of a motion that a line [Hz] holds."""
    turns = 2.0 * math.pi * line_hz
    return max((harmonic_share(turns * run.time_s, run.velocity_command_m_s) for run in runs), default=0.0)


def _grows_with_speed(run: Measured, line_hz: float) -> bool:
    """True if a line [Hz] of the torque that a motion needs is there with the speed more than without it.

    By least squares without a twin; a uniform speed does not tell the two apart, and counts as no growth.
    """
    moved, turns = motion(run.motor, run.period_s), 2.0 * math.pi * line_hz * run.time_s
    wave = {"sine": np.sin(turns), "cosine": np.cos(turns)}
    speed = np.abs(moved.velocity) / (float(np.sqrt(np.mean(moved.velocity**2))) or 1.0)
    columns = {"inertia": moved.acceleration, "viscous": moved.velocity, "coulomb": moved.direction}
    columns |= wave | {f"fast {name}": speed * one for name, one in wave.items()} | {"one": np.ones_like(speed)}
    fit = least_squares(columns, run.torque, rows_per_sample=rows_per_sample(run.period_s))
    of_all, fast = (math.hypot(*(fit[f"{kind}{name}"].value for name in wave)) for kind in ("", "fast "))
    error = math.hypot(*(fit[f"fast {name}"].std_error for name in wave))
    return fast > max(of_all, CRITERIA.sigmas * error)


@lru_cache(maxsize=64)
def lost_motion_m(run: Measured) -> float:
    """Largest lost motion [m] that the encoders of a run can hide, by least squares without a twin.

    Twice the part of their difference that changes with the direction, beside ratio and lateness, and three standard
    errors of it, and the range of what is left. Infinite where direction and lateness are not told apart.
    """
    moved = motion(run.motor, run.period_s)
    columns = {
        "one": np.ones_like(run.motor),
        "ratio": moved.position,
        "late": moved.velocity,
        "direction": moved.direction,
    }
    fit = least_squares(columns, run.table_m, rows_per_sample=rows_per_sample(run.period_s))
    step = fit["direction"]
    return 2.0 * (abs(step.value) + CRITERIA.sigmas * step.std_error) + float(np.ptp(fit.residual))


def _driven(runs: Sequence[Measured], level: float) -> float:
    """Share of the rows in which the motor moves whose |torque command| is above a level [motor unit]."""
    steps = [np.abs(np.diff(run.motor, append=run.motor[-1])) for run in runs]
    rows = [
        np.abs(run.torque_command[step > _MOVES * step.max()]) > level for run, step in zip(runs, steps, strict=True)
    ]
    return float(np.mean(np.concatenate(rows))) if any(part.size for part in rows) else 1.0


def _held_s(run: Measured, level: float) -> float:
    """Longest time for which the absolute torque command stays at a level or above [s]."""
    below = np.flatnonzero(np.abs(run.torque_command) < level)
    ends = np.concatenate([[-1], below, [run.torque_command.size]])
    return float(np.max(np.diff(ends)) - 1) * run.period_s
