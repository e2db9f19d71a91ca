"""A recording as the twin meets it: channels of its axis, where the axis starts, how noisy the sensors are.

The set-points, the first samples and the control law fix the start of a closed-loop simulation. The phase of
the position loop (which rows are its ticks) and the torque of the integrator come from replaying the
controller over the first second: of all phases, the one that reproduces the torque commands best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil import control
from hil.bench import Bench
from hil.channels import AxisKind
from hil.errors import InputError
from hil.recording import Recording
from hil.twin.axis import Start

FloatArray = NDArray[np.float64]

SETTLE_S = 0.05             # the start is only roughly known: this much of it is not judged
_REPLAYED_ROWS = 1000       # to find the phase of the position loop
_FITTED_ROWS = 11           # of the motor position, for its velocity at the first row


@dataclass(frozen=True)
class Noise:
    """Standard deviation of the white noise of a sensor: motor in rad (m), table in m, torque in N m (N).

    `table_m` is that of table position less r x motor position, 0 without a linear encoder.
    """

    motor: float
    table_m: float
    torque: float


@dataclass(frozen=True, eq=False)
class Measured:
    """One recording ready to be compared, channels (n,) in motor units: rad and N m, or m and N."""

    name: str
    kind: AxisKind
    period_s: float
    position_command_m: FloatArray
    velocity_command_m_s: FloatArray
    motor: FloatArray
    table_m: FloatArray                # empty without a linear encoder
    torque_command: FloatArray
    torque: FloatArray
    torque_is_command: bool            # only one of the two was recorded
    start: Start
    noise: Noise

    @property
    def time_s(self) -> FloatArray:
        """Time from the first row, tick x period."""
        return np.asarray(np.arange(self.motor.size) * self.period_s, dtype=np.float64)

    @property
    def judged(self) -> slice:
        """The rows that count: all after the start has settled."""
        return slice(round(SETTLE_S / self.period_s), None)


def take(recording: Recording, bench: Bench) -> Measured:
    """The channels of a recording that the twin of `bench` needs.

    Raises InputError: another kind of axis or another period than the bench, a missing channel, too short.
    """
    names, gains = recording.axis, bench.gains
    if (recording.kind is AxisKind.LINEAR) != bench.axis.linear:
        raise InputError(f"{recording.name}: given a recording of a {recording.kind} axis, allowed a "
                         f"{'linear' if bench.axis.linear else 'rotary'} one, as in the bench {bench.name}; "
                         "give the bench of this axis")
    if abs(recording.period_s - gains.period_s) > 0.01 * gains.period_s:
        raise InputError(f"{recording.name}: given a period of {recording.period_s:g} s, allowed velocity_period_s of "
                         f"the bench {bench.name}, {gains.period_s:g} s; record one row per tick of the velocity loop")
    if len(recording) * recording.period_s < 4.0 * SETTLE_S:
        raise InputError(f"{recording.name}: given {len(recording)} rows, allowed {4.0 * SETTLE_S:g} s or more; "
                         "give a longer recording")
    if bench.has_table_encoder and names.table_position not in recording.columns:
        raise InputError(f"{recording.name}: {names.table_position} is not recorded, but the bench {bench.name} has a "
                         "linear encoder; record it, or write 'table: null' under encoders in the bench file")
    motor, torque = _column(recording, names.motor_position), _column(recording, names.torque)
    position, velocity = _column(recording, names.position_command), _column(recording, names.velocity_command)
    has_command = names.torque_command in recording.columns
    command = _column(recording, names.torque_command) if has_command else torque
    table = _column(recording, names.table_position) if bench.has_table_encoder else np.empty(0)
    feedback = table if table.size else gains.ratio_m_rad * motor
    return Measured(recording.name, recording.kind, recording.period_s, position, velocity, motor, table, command,
                    torque, bool(np.array_equal(command, torque)),
                    _start(gains, position, velocity, motor, feedback, command),
                    _noise(bench, motor, table, command, torque))


def bench_of(recording: Recording) -> Bench:
    """The bench that a run of the project's own recorded in its metadata. Raises InputError where there is none."""
    described = recording.metadata.get("bench")
    if not isinstance(described, dict):
        raise InputError(f"{recording.name}: no bench is recorded in it; give one: --bench FILE or a shipped name")
    return Bench.model_validate(described)


def _column(recording: Recording, name: str) -> FloatArray:
    return np.ascontiguousarray(recording[name], dtype=np.float64)


def _start(gains: control.Gains, position: FloatArray, velocity: FloatArray, motor: FloatArray, feedback: FloatArray,
           command: FloatArray) -> Start:
    """Position and velocity of the first row; the phase and integrator that reproduce the torque commands."""
    first_rows = motor[:_FITTED_ROWS]
    speed = 0.0
    if np.ptp(first_rows) > 0.0:    # at rest the polynomial leaves rounding behind
        speed = float(np.polyfit(np.arange(first_rows.size), first_rows, 2)[1]) / gains.period_s
    channels = tuple(np.ascontiguousarray(values[:_REPLAYED_ROWS]) for values in (position, velocity, motor, feedback))

    def replay(tick: int, integral: float) -> FloatArray:
        state = control.init(motor[0], speed, integral, gains.period_s, tick)
        return np.asarray(control.replay(gains, state, *channels)[0])

    def misfit(tick: int) -> tuple[float, float]:
        # the first command less the proportional part is the integrator; a P velocity loop has none
        integral = float(command[0] - replay(tick, 0.0)[0]) if gains.integral_gain_n_m_rad else 0.0
        return float(np.mean((replay(tick, integral) - command[:_REPLAYED_ROWS]) ** 2)), integral

    misfits = [misfit(tick) for tick in range(gains.position_ticks)]
    tick = int(np.argmin([value for value, _ in misfits]))
    ratio = gains.ratio_m_rad
    return Start(float(ratio * motor[0]), ratio * speed, misfits[tick][1], tick)


def _noise(bench: Bench, motor: FloatArray, table: FloatArray, command: FloatArray, torque: FloatArray) -> Noise:
    encoder = bench.encoders.motor
    count = encoder.resolution_m if bench.axis.linear else 2.0 * np.pi / encoder.counts_per_rev
    table_noise = 0.0
    if table.size and bench.encoders.table is not None:
        table_noise = max(_white(table - bench.axis.ratio_m_rad * motor),
                          bench.encoders.table.resolution_m / np.sqrt(12.0))
    measured = torque if np.array_equal(command, torque) else torque - command
    return Noise(max(_white(motor), (count or 0.0) / np.sqrt(12.0)), table_noise, _white(measured))


def _white(signal: FloatArray) -> float:
    """White noise of a smooth signal: fourth differences, of variance 70 sigma^2, see nothing slower.

    The median over blocks keeps events, such as reversals, out of it.
    """
    differences = np.diff(signal, 4)
    blocks = differences[: differences.size // 64 * 64].reshape(-1, 64)
    return float(np.sqrt(np.median(np.mean(blocks**2, axis=1)) / 70.0))
