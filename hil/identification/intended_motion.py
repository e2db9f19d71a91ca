"""Motion of a recording: measured, and intended, without the noise of its encoder and without what pushes the axis.

    q = c s + sum_k h_k F_k(s) + w,    intended: q - w

s set-points, F_k their speed, acceleration and direction through first-order lags, h_k by least squares, w what else
moves the axis. Friction that fluctuates moves it through its loop: what a model leaves is then correlated with the
measured motion, as a mode at the bandwidth of the loop would make it, and not with the intended one (P. M. J. Van den
Hof, R. J. P. Schrama, An indirect method for transfer function estimation from closed loop data, Automatica 29 (1993)
1523). Without set-points it is the motion far below that bandwidth, where the loop holds the axis whatever pushes it.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.identification.derivatives import MeasuredMotion, matched_motion
from hil.identification.measured import Measured
from hil.identification.plain_model import MotionData, motion_data
from hil.identification.sensor_noise import moving, white_noise
from hil.identification.whitening import RANK
from hil.identification.windows import LONGEST_S, noiseless_motion

_LAGS_S = (0.004, 0.008, 0.016, 0.032, 0.064, 0.128)  # of a fast loop to one without feed-forward and integrator
_ANOTHER = 0.1  # of the variance of the acceleration: set-points that differ by more are a target, or not its own
_LOST = 0.005  # of the variance of the acceleration: an inertia is a quarter of a per cent too large


@lru_cache(maxsize=16)
def intended(run: Measured) -> Measured:
    """The run with its intended motor position (n,)."""
    motor = _by_set_points(run)
    return replace(run, motor=_slow(run, measured_motion(run)) if motor is None else motor)


def intended_motion(run: Measured) -> MeasuredMotion:
    """The intended motion of a run (n,) with its derivatives."""
    return motion_of_set_points(run) or measured_motion(intended(run)).moved


def motion_of_set_points(run: Measured) -> MeasuredMotion | None:
    """The motion (n,) that set-points make, without the mean that a measured one needs; None if they do not tell it."""
    motor = _by_set_points(run)
    return None if motor is None else noiseless_motion(motor, run.period_s)


@lru_cache(maxsize=32)
def measured_motion(run: Measured) -> MotionData:
    """Motion and torque of a run for the plain model."""
    return motion_data(run.motor, run.torque, run.period_s, run.evaluated)


@lru_cache(maxsize=16)
def _by_set_points(run: Measured) -> FloatArray | None:
    """Motor position (n,) that the set-points make; None if they do not tell it."""
    data = measured_motion(run)
    command = run.position_command_m - np.mean(run.position_command_m)
    size = float(command @ command)
    scale = float(command @ run.motor) / size if size > 0.0 else 0.0
    follows = float(np.std(run.motor - scale * command)) > run.noise.motor  # else the measured position stands for it
    if follows and scale != 0.0 and white_noise(scale * command) <= run.noise.motor:
        motor = _of_set_points(run)
        if _loses(data, matched_motion(motor, run.period_s, data.window)) < _ANOTHER:
            return motor
    return None


def _loses(data: MotionData, moved: MeasuredMotion) -> float:
    """Variance of the acceleration that another motion lacks, or has beyond it, over that of the measured one."""
    own, other = (one.acceleration[data.rows] for one in (data.moved, moved))
    return float(np.var(other - own) / max(float(np.var(own)), 1e-300)) if own.size else np.inf


def _of_set_points(run: Measured) -> FloatArray:
    speed = np.gradient(run.position_command_m, run.period_s)
    direction = np.where(moving(speed), np.sign(speed), 0.0)
    columns = [run.position_command_m, speed, np.gradient(speed, run.period_s), np.ones(speed.size)]
    for course in (*columns[1:3], direction):
        for lag_s in _LAGS_S:
            if lag_s > run.period_s:
                once = _lagged(course, lag_s, run.period_s)
                twice = _lagged(once, lag_s, run.period_s)
                columns += [twice] if course is direction else [once, twice]  # a friction moves no axis at once
    matrix = np.column_stack(columns)
    matrix /= np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    return np.asarray(matrix @ np.linalg.lstsq(matrix, run.motor, rcond=RANK)[0], dtype=np.float64)


def _lagged(values: FloatArray, time_constant_s: float, period_s: float) -> FloatArray:
    """Values (n,) through a first-order lag."""
    pole = float(np.exp(-period_s / time_constant_s))
    return np.asarray(lfilter([1.0 - pole], [1.0, -pole], values), dtype=np.float64)


def _slow(run: Measured, data: MotionData) -> FloatArray:
    """The motor position (n,) through the longest mean that keeps its acceleration."""
    kept, window = run.motor, data.window
    while window <= min(LONGEST_S / run.period_s, run.motor.size // 4):
        moved = matched_motion(run.motor, run.period_s, window)
        if _loses(data, moved) > _LOST:
            break
        kept, window = moved.position, 2 * window - 1
    return kept
