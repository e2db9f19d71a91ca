"""Residuals of a twin block by block, each fed measured inputs; of a rigid axis that slides by inverse dynamics."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.identification.dataset import Dataset
from hil.identification.inverse_twin import LEAST_ROWS, as_observed, at_each_tick, is_rigid, lacking
from hil.identification.measured import Measured
from hil.identification.residual_scales import inertia
from hil.identification.residuals import differences
from hil.identification.standstill import resting
from hil.twin.axis import Response, Twin, taken_back
from hil.twin.mechanism import Stage
from hil.twin.mechanisms.channel_time_skew import delayed
from hil.twin.physics import Active


def undelayed(twin: Twin, run: Measured, torque_delay_s: float) -> Response:
    """Measured channels without the lateness that mechanisms, and a delay of the torque, give them."""
    late = tuple(one for one in twin.active if one.form.stage is Stage.CHANNEL)
    return _undelayed(run, late, torque_delay_s / run.period_s)


def blocks(twin: Twin, bench: Bench, run: Measured, rests: Measured) -> dict[str, FloatArray]:
    """Measured less twin with each block fed measured inputs, per channel (n,); 0 for hidden channels.

    The motor rests where it does in `rests`. `bench`: of the twin.
    """
    measured = undelayed(twin, run, bench.torque_delay_s or 0.0)
    rest = resting(rests, twin.slow_velocity)
    predicted = twin.observe(
        run.position_command_m, run.velocity_command_m_s, measured, run.start, rest, run.feedforward
    )
    residuals = differences(measured, predicted, bench, run.evaluated)
    residuals["command"] = measured.torque_command - predicted.torque_command
    return residuals | {name: np.zeros(run.motor.size) for name in run.observability.hidden}


def sliding(
    twin: Twin,
    bench: Bench,
    run: Measured,
    rests: Measured,
    rows: NDArray[np.bool_],
    data: Dataset,
    window: int = LEAST_ROWS,
) -> dict[str, FloatArray]:
    """Residuals as in `blocks`, right in the rows (n,) in which the axis slides; of its motor by inverse dynamics.

    Speeds are smoothed over a window of rows. An axis with springs is simulated; on a rigid one what mechanisms with
    states between the ticks change is the difference of two simulations.
    """
    found, known = blocks(twin, bench, run, rests), at_each_tick(twin)
    if not is_rigid(twin):
        return found
    missing = lacking(known, undelayed(twin, run, bench.torque_delay_s or 0.0), run, window)
    motor = data.observer_s**2 / inertia(data.bench) * as_observed(missing, rows, run.period_s / data.observer_s)
    if len(known.active) < len(twin.active):
        motor = motor + found["motor"] - blocks(known, bench, run, rests)["motor"]
    return found | {"motor": motor}


@lru_cache(maxsize=32)  # most parameters of a fit leave the lateness as it is
def _undelayed(run: Measured, late: tuple[Active, ...], torque_periods: float) -> Response:
    channels = taken_back(run.response, late, run.period_s)
    if not torque_periods:
        return channels
    command, torque = (delayed(part, torque_periods) for part in (channels.torque_command, channels.torque))
    return channels._replace(torque_command=command, torque=torque)
