"""Prepare recordings for the twin: channels of the axis, initial state, noise of the sensors.

The set-points, the first samples and the control law determine the initial state of a closed-loop simulation. The ticks
of the position loop are found by replaying the controller over the first motion: the phase that reproduces the torque
commands best. Rows before the first such tick are omitted, since their velocity reference is unknown.

A drive in CSP gets positions only: its velocity feed-forward is their difference from SYNC to SYNC.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.channels import SPEED_SET_POINT, AxisKind
from hil.control import cascade
from hil.errors import InputError
from hil.identification.derived_channels import completed
from hil.identification.laps import Laps, find_laps
from hil.identification.observability import Observability, observability
from hil.identification.parabola import first_step
from hil.identification.sensor_noise import Noise, estimate_noise, moving, white_noise
from hil.recording.recording import Recording
from hil.recording.stamps import check_finite
from hil.twin.axis import Response, Start

Channels = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # as control.replay takes them

SETTLE_S = 0.05  # not evaluated at the start: several time constants of the observer, for errors of the initial state
SETTLE_IN_MOTION_S = 0.3  # modes of a machine axis have decayed
LEAD_IN = "lead_in_rows"  # metadata: rows at the start that belong to another part and only give the twin its state
_REPLAYED_ROWS = 200  # to find the phase of the position loop: many of its ticks
_FITTED_ROWS = 11  # motor positions fitted by a parabola for the first velocity, at most: averages encoder counts


_CHANNELS = (
    "position_command_m", "velocity_command_m_s", "motor", "table_m", "torque_command", "torque", "speed_set_point",
    "feedforward",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Measured:
    """A recording prepared for the comparison, channels (n,) in motor units: rad and N m, or m and N.

    The set-points are those that the control law used, with the correction of a compensation.
    """

    name: str
    kind: AxisKind
    period_s: float
    position_command_m: FloatArray
    velocity_command_m_s: FloatArray
    motor: FloatArray
    table_m: FloatArray  # empty without a linear encoder
    torque_command: FloatArray
    torque: FloatArray
    start: Start
    noise: Noise
    observability: Observability
    speed_set_point: FloatArray = field(default_factory=lambda: np.empty(0))  # of unknown scale; empty if not recorded
    feedforward: FloatArray = field(default_factory=lambda: np.empty(0))  # torque of a compensation; empty: none
    lead_in: int = 0  # first rows, which give the twin its state and are not evaluated

    @cached_property
    def torque_gap(self) -> FloatArray:
        """Standard deviation (n,) of the mean torque from a row to the next one, given samples of it at both.

        The torque changes between them at a time that is not known: the mean is uniform between both values.
        """
        return np.asarray(np.abs(np.diff(self.torque_command, append=self.torque_command[-1])) / np.sqrt(12.0))

    @cached_property
    def time_s(self) -> FloatArray:
        """Time from the first row of the whole recording, tick x period."""
        return np.asarray(self.start.time_s + np.arange(self.motor.size) * self.period_s, dtype=np.float64)

    @cached_property
    def motor_noise(self) -> FloatArray:
        """Noise of the motor position at each row (n,), with that of the instant of its reading."""
        speed = np.gradient(self.motor) / self.period_s
        return np.asarray(np.hypot(self.noise.motor, self.noise.jitter_s * speed), dtype=np.float64)

    @cached_property
    def laps(self) -> Laps | None:
        """Repeated motion; None where no motion is made twice."""
        return find_laps(self.position_command_m, self.velocity_command_m_s, self.period_s)

    @property
    def response(self) -> Response:
        """The measured channels in the twin's order."""
        return Response(self.motor, self.table_m, self.torque_command, self.torque)

    @property
    def own_command(self) -> FloatArray:
        """Torque command (n,) of the control law itself, without that of a compensation."""
        return self.torque_command - self.feedforward if self.feedforward.size else self.torque_command

    def until(self, row: int) -> "Measured":
        """The rows before `row`."""
        cut = {name: values[:row] for name, values in vars(self).items() if name in _CHANNELS and values.size}
        return replace(self, **cut)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Rows (n,) at which the set-points move."""
        return moving(self.velocity_command_m_s)

    @cached_property
    def evaluated(self) -> slice:
        """Rows that are evaluated: from the first motion on, and after the start has settled.

        Before the first motion the state of friction is unknown. In a recording that begins in motion elastic modes
        swing at first.
        """
        first = min(int(np.argmax(self.moving)), self.motor.size // 2)
        settle_s = SETTLE_IN_MOTION_S if self.moving[0] else SETTLE_S
        return slice(max(min(round(settle_s / self.period_s), self.motor.size // 4), first, self.lead_in), None)


def take(recording: Recording, bench: Bench) -> Measured:
    """Take the channels of a recording that the twin of `bench` needs; without a control law, complete it first.

    Raises InputError for another kind of axis or period than the bench, gaps, a missing channel, NaN, or too few rows.
    """
    if len(recording.parts()) > 1:
        raise InputError(
            f"{recording.name}: given a recording with gaps in time, allowed one without; give one of its "
            f"{len(recording.parts())} parts: recording.parts()"
        )
    recording, bench = completed(recording, bench), bench.sampled(recording.period_s)
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
    feedforward = np.empty(0)
    if "compensation_position_m" in recording.columns:  # the loop records all three
        position = position + _column(recording, "compensation_position_m")
        velocity = velocity + _column(recording, "compensation_velocity_m_s")
        feedforward = _column(recording, f"compensation_{names.torque}")
    if bench.differences_setpoints:
        velocity = last_difference(position, gains.period_s)
    if bench.setpoint_delay_s:
        position, velocity = (later(one, bench.setpoint_delay_s / gains.period_s) for one in (position, velocity))
    has_command = names.torque_command in recording.columns
    command = _column(recording, names.torque_command) if has_command else torque
    table = _column(recording, names.table_position) if bench.has_table_encoder else np.empty(0)
    if table.size and gains.position_from_table:
        # the linear encoder closes the position loop: the datum of the motor encoder is arbitrary
        motor = motor + float(np.mean(table - gains.ratio_m_rad * motor)) / gains.ratio_m_rad
    feedback = table if table.size else gains.ratio_m_rad * motor
    own = command - feedforward if feedforward.size else command  # that of the law itself
    first = _first_tick(gains, (position, velocity, motor, feedback), own) if bench.law_known else 0
    position, velocity, motor, feedback, table, command, torque, own, feedforward = (
        values[first:] for values in (position, velocity, motor, feedback, table, command, torque, own, feedforward)
    )
    speed = _column(recording, SPEED_SET_POINT)[first:] if SPEED_SET_POINT in recording.columns else np.empty(0)
    noise = estimate_noise(bench, velocity, motor, table, command, torque, recording.period_s)
    known = observability(recording, bench)
    if not known.position_measured:
        noise = replace(noise, motor=recording.period_s * white_noise(_column(recording, names.motor_velocity)))
    least = noise.motor if bench.law_known else np.inf  # the integrator of a law is set from the first speed
    start = _start(gains, (position, velocity, motor, feedback), own, least)
    return Measured(
        name=recording.name,
        kind=recording.kind,
        period_s=recording.period_s,
        position_command_m=position,
        velocity_command_m_s=velocity,
        motor=motor,
        table_m=table,
        torque_command=command,
        torque=torque,
        start=start._replace(time_s=recording.start_s + first * recording.period_s),
        noise=noise,
        observability=known,
        speed_set_point=speed if np.any(speed) else np.empty(0),
        feedforward=feedforward,
        lead_in=max(int(recording.metadata.get(LEAD_IN, 0)) - first, 0),
    )


def bench_of(recording: Recording) -> Bench:
    """Return the bench stored in the metadata of a recorded run. Raises InputError if there is none."""
    described = recording.metadata.get("bench")
    if not isinstance(described, dict):
        raise InputError(f"{recording.name}: no bench is recorded in it; give one: --bench FILE or a shipped name")
    try:
        return Bench.model_validate(described)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise InputError(
            f"{recording.name}: bench.{'.'.join(map(str, first['loc']))}: {first['msg']}: the bench recorded in it is "
            "damaged; give one: --bench FILE or a shipped name"
        ) from None


def last_difference(position: FloatArray, period_s: float) -> FloatArray:
    """Velocity (n,) of position set-points, as a loop computes it that knows none of the future."""
    return np.asarray(np.diff(position, prepend=2.0 * position[0] - position[1]) / period_s, dtype=np.float64)


def later(values: FloatArray, rows: float) -> FloatArray:
    """Delay samples (n,) by a number of rows; both ends are continued by straight lines.

    Cubic convolution (Keys, IEEE Trans. Acoustics, Speech, and Signal Processing 29 (1981) 1153, a = -1/2), which
    averages the counts of an encoder: they would make the gains of a law that is fitted to them too small.
    """
    whole = math.floor(rows)
    f = rows - whole
    # weights of the samples 1 after to 2 before the whole delay
    weights = (
        0.5 * f * (-1.0 + f * (2.0 - f)),
        1.0 + 0.5 * f * f * (3.0 * f - 5.0),
        0.5 * f * (1.0 + f * (4.0 - 3.0 * f)),
        0.5 * f * f * (f - 1.0),
    )
    more = abs(whole) + 2
    beyond = np.arange(1, more + 1)
    before = values[0] - beyond[::-1] * (values[1] - values[0])
    longer = np.concatenate([before, values, values[-1] + beyond * (values[-1] - values[-2])])
    shifted = [
        weight * longer[more - whole - late : more - whole - late + values.size]
        for late, weight in zip((-1, 0, 1, 2), weights, strict=True)
    ]
    return np.asarray(np.sum(shifted, axis=0), dtype=np.float64)


def _column(recording: Recording, name: str) -> FloatArray:
    check_finite({name: recording[name]}, lambda row: f"{recording.name}: row {row}")  # those in memory are unchecked
    return np.ascontiguousarray(recording[name], dtype=np.float64)


def _first_tick(gains: cascade.Gains, channels: Channels, command: FloatArray) -> int:
    """Find the first tick of the position loop: the row whose replay reproduces the commands best.

    The first change of the set velocity is replayed: at rest and at constant feed every phase gives the same.
    """
    _, velocity, motor, _ = channels
    begin = max(int(np.argmax(moving(np.diff(velocity, append=velocity[-1])))), 2)

    def misfit(row: int) -> float:
        rows = slice(row, row + _REPLAYED_ROWS)
        state = _state_at(gains, channels, command, row, (motor[row - 1] - motor[row - 2]) / gains.period_s)
        replayed, _ = cascade.replay(gains, state, *(values[rows] for values in channels))
        return float(np.mean((replayed - command[rows]) ** 2))

    rows = range(begin, begin + gains.position_ticks)
    return min(rows, key=misfit) % gains.position_ticks


def _state_at(gains: cascade.Gains, channels: Channels, command: FloatArray, row: int, speed: float) -> cascade.State:
    """State of the controller at a tick of the position loop: the integrator is the command less the proportional part.

    A P velocity loop has no integrator.
    """
    _, _, motor, _ = channels
    state = cascade.init(motor[row], speed, 0.0, gains.period_s)
    if row > 0:
        state = state._replace(previous_motor_rad=motor[row - 1], previous2_motor_rad=motor[max(row - 2, 0)])
    if gains.integral_gain_n_m_rad == 0.0:
        return state
    proportional, _ = cascade.replay(gains, state, *(values[row : row + 1] for values in channels))
    return state._replace(integral_n_m=float(command[row] - proportional[0]))


def _start(gains: cascade.Gains, channels: Channels, command: FloatArray, noise_rad: float) -> Start:
    """Initial position and velocity from a parabola through the first rows, and the torque of the integrator."""
    motor = channels[2]
    speed = first_step(motor[:_FITTED_ROWS], noise_rad) / gains.period_s
    state = _state_at(gains, channels, command, 0, speed)
    return Start(float(gains.ratio_m_rad * motor[0]), gains.ratio_m_rad * speed, state.integral_n_m)
