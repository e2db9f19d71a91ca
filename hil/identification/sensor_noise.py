"""White noise of the sensors of a recording, each estimated from its own channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.identification.plain_model import fit_plain_model, motion_data
from hil.recording.quantum import count_of

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench

_COARSER = 1.5  # factor of a recorded step over the count of the bench: one count, seen with noise, is below
_RESPONSE_ROWS = 20  # of the current loop and its delays: 4 to 50 ms at 5 kHz to 400 Hz
_LESS = 0.9  # of the plain deviation: fitted to noise alone, the response takes away less than a hundredth
_LEVELS = 20  # counts of a torque: fewer are the levels of a command, which are exact
HELD = 0.5  # share of the moving rows with an unchanged command: a feedback of a moving encoder changes at each count
_DIGITS = 1e-7  # of the largest value: rounding of a recording in single precision, the least noise of a torque


@dataclass(frozen=True)
class Noise:
    """Standard deviation of the white noise of a sensor: motor [rad or m], table [m], torque [N m or N].

    `motor` is the noise of its travel per period if its velocity was recorded in place of its position. `coarse`: the
    recorded steps of the motor position are coarser than the counts of the bench.

    `table_m` is that of table position less r x motor position, 0 without a linear encoder. `jitter_s` is that of the
    sampling instants of the encoders: its position error is proportional to the speed and equal for both.
    """

    motor: float
    table_m: float
    torque: float
    jitter_s: float = 0.0
    coarse: bool = False


def estimate_noise(
    bench: Bench,
    velocity: FloatArray,
    motor: FloatArray,
    table: FloatArray,
    command: FloatArray,
    torque: FloatArray,
    period_s: float,
) -> Noise:
    """Estimate sensor noise from channels (n,) in motor units, at least that of counting: count / sqrt(12).

    The count is that of the bench, or that of the recording if it is coarser.
    """
    count = _count(motor, bench.motor_count)
    white, table_noise = white_noise(motor), 0.0
    if table.size and bench.encoders.table is not None:
        ratio_m = bench.axis.ratio_m_rad
        counts = np.hypot(_count(table, bench.encoders.table.resolution_m), ratio_m * count)
        table_noise = max(white_noise(table - ratio_m * motor), float(counts) / np.sqrt(12.0))
        white = min(white, table_noise / abs(ratio_m))  # in slow rows the motion itself looks like noise
    motor_noise = max(white, count / np.sqrt(12.0))
    if not np.array_equal(command, torque):
        of_torque = _of_drive(command, torque)
    else:  # the steps of a held command are no noise
        of_torque = 0.0 if is_held(torque, motor) else _of_samples(torque, motor, period_s)
    of_torque = max(of_torque, _rounding(torque), _DIGITS * float(np.max(np.abs(torque), initial=0.0)))
    jitter_s = _jitter_s(motor, velocity, motor_noise, period_s)
    return Noise(motor_noise, table_noise, of_torque, jitter_s, coarse=count > bench.motor_count)


def _count(values: FloatArray, of_bench: float) -> float:
    """Count of a channel (n,): that of the bench, or the step of the values if it is clearly coarser."""
    step = count_of(values) or 0.0
    return step if step > _COARSER * of_bench else of_bench


def _rounding(torque: FloatArray) -> float:
    """Noise of a torque (n,) that was recorded in counts; 0 for a command of few levels, such as a binary sequence."""
    step = count_of(torque) or 0.0
    return step / np.sqrt(12.0) if np.ptp(torque) > _LEVELS * step else 0.0


def moving(velocity: FloatArray) -> NDArray[np.bool_]:
    """Mark the rows (n,) at which a set velocity moves the axis: above 1/1000 of its maximum; below lies rounding."""
    speed = np.abs(velocity)
    return np.asarray(speed > 1e-3 * np.max(speed, initial=0.0))


def white_noise(signal: FloatArray) -> float:
    """White noise of a smooth signal (n,) from its fourth differences, which have the variance 70 sigma^2.

    The median over blocks excludes events such as reversals; of less than a block it is that of all rows.
    """
    blocks = _white_blocks(signal)
    return (
        float(np.sqrt(np.median(blocks if blocks.size else np.diff(signal, 4) ** 2 / 70.0))) if signal.size > 4 else 0.0
    )


def _white_blocks(signal: FloatArray) -> FloatArray:
    """Variance (b,) of the white noise in each block of 64 rows."""
    differences = np.diff(signal, 4)
    blocks = differences[: differences.size // 64 * 64].reshape(-1, 64)
    return np.asarray(np.mean(blocks**2, axis=1) / 70.0, dtype=np.float64)


def _jitter_s(motor: FloatArray, velocity: FloatArray, noise: float, period_s: float) -> float:
    """Jitter of the sampling instants: excess over `noise` at constant feed, divided by the speed.

    It takes six blocks of 64 rows at constant set velocity, at half of the fastest such feed or above; 0 with fewer.
    Also 0 if the variance is below three times that of the noise: counting at half a count per row makes 2.7.
    """
    variance = _white_blocks(motor)
    rows = 64 * variance.size
    speed = np.abs(np.diff(motor)[:rows].reshape(-1, 64).mean(axis=1)) / period_s
    steady = np.ptp(velocity[:rows].reshape(-1, 64), axis=1) <= 1e-6 * np.max(np.abs(velocity), initial=0.0)
    steady &= moving(velocity)[:rows].reshape(-1, 64).all(axis=1)
    fast = steady & (speed > 0.5 * np.max(speed[steady], initial=0.0))
    if np.count_nonzero(fast) < 6:
        return 0.0
    more = (variance[fast] - noise**2) / speed[fast] ** 2
    return float(np.sqrt(np.median(more))) if np.median(variance[fast]) > 3.0 * noise**2 else 0.0


def _of_samples(torque: FloatArray, motor: FloatArray, period_s: float) -> float:
    """Noise of a torque (n,) that was sampled: its white noise, or what the plain model leaves of it if that is less.

    Between slow rows the torque itself changes, which is no noise.
    """
    data = motion_data(motor, torque, period_s)
    plain = fit_plain_model([data])
    if plain is None:
        return white_noise(torque)
    left = torque - plain.predict(data.moved)
    return min(white_noise(torque), float(np.std(left[data.sliding(plain.slowest)])))


def _of_drive(command: FloatArray, torque: FloatArray) -> float:
    """Noise of a measured torque (n,): what neither follows its command nor any linear response to it, if that is less.

    A drive is linear to first order; its delay, lag and gain are no noise. The response has `_RESPONSE_ROWS` rows.
    """
    plain = _coloured(torque - command)
    if torque.size < 10 * _RESPONSE_ROWS:
        return plain
    before = np.concatenate([np.full(_RESPONSE_ROWS - 1, command[0]), command])
    past = np.lib.stride_tricks.sliding_window_view(before, _RESPONSE_ROWS)
    past = np.column_stack([past, np.ones(torque.size)])
    response = np.linalg.lstsq(past.T @ past, past.T @ torque, rcond=None)[0]
    linear = _coloured(torque - past @ response)
    return linear if linear < _LESS * plain else plain


def _coloured(signal: FloatArray) -> float:
    """Noise of any colour of a signal (n,) near zero: deviation from a straight line in each block of 64 rows.

    A current measurement is filtered, so its noise is not white. The median over blocks excludes events.
    """
    rows = np.arange(64) - 31.5
    blocks = signal[: signal.size // 64 * 64].reshape(-1, 64)
    blocks = blocks - blocks.mean(axis=1, keepdims=True)
    blocks = blocks - np.outer(blocks @ rows / (rows @ rows), rows)
    return float(np.sqrt(np.median(np.sum(blocks**2, axis=1)) / 62.0))


def is_held(command: FloatArray, motor: FloatArray) -> bool:
    """True if a command (n,) stays the same from row to row over most of the motion (n,)."""
    moves = np.diff(motor) != 0.0
    return bool(moves.any() and np.mean(np.diff(command)[moves] == 0.0) > HELD)
