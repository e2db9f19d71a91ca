"""A recording as the twin meets it: channels of its axis, where the axis starts, how noisy the sensors are.

The set-points, the first samples and the control law fix the start of a closed-loop simulation. Which rows are
ticks of the position loop comes from replaying the controller over the first motion: of all phases, the one that
reproduces the torque commands best. The rows before the first such tick are left out, since the velocity reference
they were controlled with is not known.

A drive in CSP gets positions only: the velocity that its loops feed forward is their difference from SYNC to SYNC.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode
from hil.channels import AxisKind
from hil.control import cascade
from hil.errors import InputError
from hil.recording.recording import Recording
from hil.twin.axis import Response, Start

Channels = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # as control.replay takes them

SETTLE_S = 0.05  # the start is only roughly known: this much of it is not judged
_REPLAYED_ROWS = 200  # to find the phase of the position loop
_FITTED_ROWS = 11  # of the motor position, for its velocity at the first row


@dataclass(frozen=True)
class Noise:
    """Standard deviation of the white noise of a sensor: motor in rad (m), table in m, torque in N m (N).

    `table_m` is that of table position less r x motor position, 0 without a linear encoder. `jitter_s` is that of the
    instants at which positions are read: an error that grows with the speed, and is the same for both encoders.
    """

    motor: float
    table_m: float
    torque: float
    jitter_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Measured:
    """One recording ready to be compared, channels (n,) in motor units: rad and N m, or m and N."""

    name: str
    kind: AxisKind
    period_s: float
    position_command_m: FloatArray
    velocity_command_m_s: FloatArray
    motor: FloatArray
    table_m: FloatArray  # empty without a linear encoder
    torque_command: FloatArray
    torque: FloatArray
    torque_is_command: bool  # only one of the two was recorded
    start: Start
    noise: Noise
    left_out: int = 0  # rows of the recording before the first tick of the position loop

    @property
    def time_s(self) -> FloatArray:
        """Time from the first row of the recording, tick x period."""
        return np.asarray((self.left_out + np.arange(self.motor.size)) * self.period_s, dtype=np.float64)

    @cached_property
    def motor_noise(self) -> FloatArray:
        """Noise of the motor position at each row (n,), with that of the instant of its reading."""
        speed = np.gradient(self.motor) / self.period_s
        return np.asarray(np.hypot(self.noise.motor, self.noise.jitter_s * speed), dtype=np.float64)

    @property
    def response(self) -> Response:
        """The measured channels in the twin's order."""
        return Response(self.motor, self.table_m, self.torque_command, self.torque)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Rows (n,) at which the set-points move."""
        return moving(self.velocity_command_m_s)

    @cached_property
    def judged(self) -> slice:
        """The rows that count: all after the start has settled, from the first motion on. How an axis came to rest
        before is not known."""
        first = min(int(np.argmax(self.moving)), self.motor.size // 2)
        return slice(max(round(SETTLE_S / self.period_s), first), None)


def moving(velocity: FloatArray) -> NDArray[np.bool_]:
    """Where a set velocity (n,) is one: above a thousandth of the highest, below which lies noise."""
    speed = np.abs(velocity)
    return np.asarray(speed > 1e-3 * np.max(speed, initial=0.0))


def take(recording: Recording, bench: Bench) -> Measured:
    """The channels of a recording that the twin of `bench` needs.

    Raises InputError: another kind of axis or another period than the bench, a missing channel, too short.
    """
    names, gains = recording.axis, bench.gains
    if (recording.kind is AxisKind.LINEAR) != bench.axis.linear:
        raise InputError(
            f"{recording.name}: given a recording of a {recording.kind} axis, allowed a "
            f"{'linear' if bench.axis.linear else 'rotary'} one, as in the bench {bench.name}; "
            "give the bench of this axis"
        )
    if abs(recording.period_s - gains.period_s) > 0.01 * gains.period_s:
        raise InputError(
            f"{recording.name}: given a period of {recording.period_s:g} s, allowed velocity_period_s of "
            f"the bench {bench.name}, {gains.period_s:g} s; record one row per tick of the velocity loop"
        )
    if len(recording) * recording.period_s < 4.0 * SETTLE_S:
        raise InputError(
            f"{recording.name}: given {len(recording)} rows, allowed {4.0 * SETTLE_S:g} s or more; "
            "give a longer recording"
        )
    if bench.has_table_encoder and names.table_position not in recording.columns:
        raise InputError(
            f"{recording.name}: {names.table_position} is not recorded, but the bench {bench.name} has a "
            "linear encoder; record it, or write 'table: null' under encoders in the bench file"
        )
    motor, torque = _column(recording, names.motor_position), _column(recording, names.torque)
    position, velocity = _column(recording, names.position_command), _column(recording, names.velocity_command)
    if bench.drive is not None and bench.drive.mode is DriveMode.CSP:
        velocity = np.diff(position, prepend=2.0 * position[0] - position[1]) / gains.period_s
    has_command = names.torque_command in recording.columns
    command = _column(recording, names.torque_command) if has_command else torque
    table = _column(recording, names.table_position) if bench.has_table_encoder else np.empty(0)
    if table.size and gains.position_from_table:
        # the loop goes by the linear encoder: the motor's datum is the one that is free
        motor = motor + float(np.mean(table - gains.ratio_m_rad * motor)) / gains.ratio_m_rad
    feedback = table if table.size else gains.ratio_m_rad * motor
    first = _first_tick(gains, (position, velocity, motor, feedback), command)
    position, velocity, motor, feedback, table, command, torque = (
        values[first:] for values in (position, velocity, motor, feedback, table, command, torque)
    )
    return Measured(
        recording.name,
        recording.kind,
        recording.period_s,
        position,
        velocity,
        motor,
        table,
        command,
        torque,
        bool(np.array_equal(command, torque)),
        _start(gains, (position, velocity, motor, feedback), command),
        _noise(bench, velocity, motor, table, command, torque, recording.period_s),
        first,
    )


def bench_of(recording: Recording) -> Bench:
    """The bench that a run of the project's own recorded in its metadata. Raises InputError where there is none."""
    described = recording.metadata.get("bench")
    if not isinstance(described, dict):
        raise InputError(f"{recording.name}: no bench is recorded in it; give one: --bench FILE or a shipped name")
    return Bench.model_validate(described)


def _column(recording: Recording, name: str) -> FloatArray:
    return np.ascontiguousarray(recording[name], dtype=np.float64)


def _first_tick(gains: cascade.Gains, channels: Channels, command: FloatArray) -> int:
    """The first row at which the position loop ran: of all, the one whose replay gives the commands best.

    Replayed is the beginning of the first motion: at rest, every phase gives the same.
    """
    _, velocity, motor, _ = channels
    begin = max(int(np.argmax(moving(velocity))), 2)

    def misfit(row: int) -> float:
        rows = slice(row, row + _REPLAYED_ROWS)
        state = _state_at(gains, channels, command, row, (motor[row - 1] - motor[row - 2]) / gains.period_s)
        replayed, _ = cascade.replay(gains, state, *(values[rows] for values in channels))
        return float(np.mean((replayed - command[rows]) ** 2))

    rows = range(begin, begin + gains.position_ticks)
    return min(rows, key=misfit) % gains.position_ticks


def _state_at(gains: cascade.Gains, channels: Channels, command: FloatArray, row: int, speed: float) -> cascade.State:
    """State of the controller at a tick of the position loop: its integrator is the command there less the
    proportional part. A P velocity loop has none."""
    _, _, motor, _ = channels
    state = cascade.init(motor[row], speed, 0.0, gains.period_s)
    if row > 0:
        state = state._replace(previous_motor_rad=motor[row - 1], previous2_motor_rad=motor[max(row - 2, 0)])
    if gains.integral_gain_n_m_rad == 0.0:
        return state
    proportional, _ = cascade.replay(gains, state, *(values[row : row + 1] for values in channels))
    return state._replace(integral_n_m=float(command[row] - proportional[0]))


def _start(gains: cascade.Gains, channels: Channels, command: FloatArray) -> Start:
    """Position and velocity of the first row, by the first few; the torque of the integrator."""
    motor = channels[2]
    rows = motor[:_FITTED_ROWS]
    speed = 0.0
    if np.ptp(rows) > 0.0:  # at rest the polynomial leaves rounding behind
        speed = float(np.polyfit(np.arange(rows.size), rows, 2)[1]) / gains.period_s
    state = _state_at(gains, channels, command, 0, speed)
    return Start(float(gains.ratio_m_rad * motor[0]), gains.ratio_m_rad * speed, state.integral_n_m)


def _noise(
    bench: Bench,
    velocity: FloatArray,
    motor: FloatArray,
    table: FloatArray,
    command: FloatArray,
    torque: FloatArray,
    period_s: float,
) -> Noise:
    motor_noise, table_noise = max(_white(motor), bench.motor_count / np.sqrt(12.0)), 0.0
    if table.size and bench.encoders.table is not None:
        ratio_m = bench.axis.ratio_m_rad
        counting = np.hypot(bench.encoders.table.resolution_m, ratio_m * bench.motor_count) / np.sqrt(12.0)
        table_noise = max(_white(table - ratio_m * motor), float(counting))
    of_torque = _white(torque) if np.array_equal(command, torque) else _coloured(torque - command)
    return Noise(motor_noise, table_noise, of_torque, _jitter_s(motor, velocity, motor_noise, period_s))


def _white(signal: FloatArray) -> float:
    """White noise of a smooth signal: fourth differences, of variance 70 sigma^2, see nothing slower.

    The median over blocks keeps events, such as reversals, out of it.
    """
    return float(np.sqrt(np.median(_white_blocks(signal))))


def _white_blocks(signal: FloatArray) -> FloatArray:
    """Variance of the white noise in each block of 64 rows."""
    differences = np.diff(signal, 4)
    blocks = differences[: differences.size // 64 * 64].reshape(-1, 64)
    return np.asarray(np.mean(blocks**2, axis=1) / 70.0, dtype=np.float64)


def _jitter_s(motor: FloatArray, velocity: FloatArray, noise: float, period_s: float) -> float:
    """Jitter of the instants of reading: by how much noise at constant feed exceeds `noise`, over the speed.

    Known from six blocks of 64 rows in which the set velocity is constant, from half of the fastest such feed on; with
    less of them 0. Less than three times the noise is not told from counting, which at half a count per row makes 2.7.
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


def _coloured(signal: FloatArray) -> float:
    """Noise of a signal that is next to zero, of any colour: what varies about a straight line within 64 rows.

    A current measurement is filtered: its noise is no longer white. The median again keeps events out of it.
    """
    rows = np.arange(64) - 31.5
    blocks = signal[: signal.size // 64 * 64].reshape(-1, 64)
    blocks = blocks - blocks.mean(axis=1, keepdims=True)
    blocks = blocks - np.outer(blocks @ rows / (rows @ rows), rows)
    return float(np.sqrt(np.median(np.sum(blocks**2, axis=1)) / 62.0))
