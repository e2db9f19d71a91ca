"""Torque that a measured motion needs beyond that of a rigid twin, by its inverse dynamics.

    d = J a - net(q, v, T),    a, v, q about the middle of the period over which T is a mean

`net` is what the stages of the twin leave of a torque to accelerate it (`hil.twin.stepping.steady`). No noise of the
torque moves the twin, which slides wherever the axis does; a simulation of an axis with much friction and few rows
sticks, or leaves the place that was measured. Acceleration and torque pass the same mean (`hil.identification.
derivatives`), position and speed are smoothed.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.identification.derivatives import later_motion, matched, matched_motion
from hil.identification.measured import Measured
from hil.twin.axis import Response, Twin
from hil.twin.mechanism import Stage
from hil.twin.stepping.records import start_memory
from hil.twin.stepping.steady import net, readings

_BETWEEN_TICKS = (Stage.BRISTLE, Stage.CHAIN)  # they act through states that the motion of the motor does not give
LEAST_ROWS = 3  # of a second difference
_REMEMBERED = 2.0  # time constants of the observer
_SOLVED = 3  # steps of a fixed-point iteration
_MIDDLE = 0.5  # rows from a position to the middle of the torque's period


def is_rigid(twin: Twin) -> bool:
    """True for an axis without a spring between motor and table."""
    return not twin.physics.chain.transmission.any()


def at_each_tick(twin: Twin) -> Twin:
    """The twin with the mechanisms whose torque the motion of the motor gives."""
    return replace(twin, active=tuple(one for one in twin.active if one.form.stage not in _BETWEEN_TICKS))


def lacking(twin: Twin, measured: Response, run: Measured, window: int = LEAST_ROWS) -> FloatArray:
    """Torque (n,) that the motion of the measured channels of a run needs beyond that of a rigid twin.

    `window`: rows over which position and speed are smoothed. Right in rows in which the axis slides.
    """
    arrays, push = twin.arrays(), twin.push_n if twin.push_n.size else np.zeros(run.motor.size)

    def memory() -> NDArray[np.void]:
        state = start_memory()
        state["clock"] = run.start.time_s
        return state

    position = measured.motor_position
    for _ in range(_SOLVED if twin.arrays().codes[0][Stage.MOTOR_READING.value] else 0):  # an encoder errs by little
        position = measured.motor_position - readings(position, *arrays, memory()) + position
    raw, smooth = (later_motion(matched_motion(position, run.period_s, rows), _MIDDLE) for rows in (LEAST_ROWS, window))
    left = net(smooth.position, smooth.velocity, measured.torque_command, push, *arrays, memory())
    inertia = float(twin.chain.inertia_kg_m2.sum())
    return np.asarray(inertia * raw.acceleration - matched(left, LEAST_ROWS), dtype=np.float64)


def as_observed(torque: FloatArray, rows: NDArray[np.bool_], a: float) -> FloatArray:
    """A torque (n,), known in the rows (n,), as the innovation of the observer of a rigid axis tells it.

        e(z) = a^2 z^-1 / (1 - (2 - 2 a - a^2) z^-1 + (1 - 2 a) z^-2),   a = T / tau

    Between stretches in which the axis slides, where the sign of the velocity is not known, its mean about their ends
    goes on from one to the next.
    """
    at = np.flatnonzero(rows)
    if not at.size:
        return np.zeros(torque.size)
    mean = uniform_filter1d(torque[at], 2 * round(_REMEMBERED / a) + 1)
    bridged = np.where(rows, torque, np.interp(np.arange(torque.size), at, mean))
    return np.asarray(lfilter([0.0, a * a], [1.0, -(2.0 - 2.0 * a - a * a), 1.0 - 2.0 * a], bridged), dtype=np.float64)
