"""A recording as the twin meets it: channels of its axis, where the axis starts, how noisy the sensors are.

The set-points, the first samples and the control law fix the start of a closed-loop simulation. Which rows are
ticks of the position loop comes from replaying the controller over the first motion: of all phases, the one that
reproduces the torque commands best. The rows before the first such tick are left out, since the velocity reference
they were controlled with is not known.

A drive in CSP gets positions only: the velocity that its loops feed forward is their difference from SYNC to SYNC.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode
from hil.channels import AxisKind
from hil.control import cascade
from hil.errors import InputError
from hil.identification.laps import Laps, find_laps
from hil.identification.sensor_noise import Noise, estimate_noise, moving
from hil.recording.recording import Recording
from hil.twin.axis import Response, Start

Channels = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # as control.replay takes them

SETTLE_S = 0.05  # the start is only roughly known: this much of it is not judged
_REPLAYED_ROWS = 200  # to find the phase of the position loop
_FITTED_ROWS = 11  # of the motor position, for its velocity at the first row

# Torque that the motor channel is trusted to tell, over the noise of the torque channel. A fine encoder tells much
# less, but details below the material size lie there too: friction at zero speed, the side force of a lead error.
TORQUE_ACCURACY = 1.0
# Model discrepancy (Kennedy and O'Hagan 2001): correct simulations of one axis differ by this share of the deflection
# of the transmission. Calibrated on simulated axes with nothing but wrong parameters, where the refitted twin leaves
# 0.1 to 0.6 % in accelerations. On the motor, TORQUE_ACCURACY stands for it.
DISCREPANCY = 0.005
# Time constants of the motor's observer. Fast: stick-slip is forgotten within a few ticks, so that even a poor start
# leads to the right valley; faster than two ticks, the sampled observer is unstable on an elastic axis. Slow: a coarse
# encoder still tells the torque.
FASTEST_OBSERVER_TICKS, FASTEST_OBSERVER_S, SLOWEST_OBSERVER_S = 2.0, 0.002, 0.008


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

    @cached_property
    def laps(self) -> Laps | None:
        """Repeated motion; None where no motion is made twice."""
        return find_laps(self.position_command_m, self.velocity_command_m_s, self.period_s)

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
        estimate_noise(bench, velocity, motor, table, command, torque, recording.period_s),
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


@dataclass(frozen=True, eq=False)
class Dataset:
    """Recordings of one axis prepared for a fit, with everything that does not depend on the hypothesis.

    `observer_s` is the time constant of the motor's observer in the block residuals, `travel_m` the largest range of
    the position set-points.
    """

    runs: tuple[Measured, ...]
    bench: Bench
    observer_s: float = FASTEST_OBSERVER_S
    travel_m: float = 0.1
    _scales: dict[tuple[float, float], tuple[dict[str, FloatArray], ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    def over(self, runs: Sequence[Measured]) -> "Dataset":
        """Other recordings of the same axis with the same observer and travel."""
        return Dataset(tuple(runs), self.bench, self.observer_s, self.travel_m)

    def scales(
        self, torque_accuracy: float = TORQUE_ACCURACY, discrepancy: float = DISCREPANCY
    ) -> tuple[dict[str, FloatArray], ...]:
        """Size of one unit of weighted residual at each row, (n,) per channel, for each run."""
        key = torque_accuracy, discrepancy
        if key not in self._scales:
            self._scales[key] = tuple(
                scales(run, self.bench, self.observer_s, torque_accuracy, discrepancy) for run in self.runs
            )
        return self._scales[key]

    @property
    def noise(self) -> tuple[dict[str, FloatArray], ...]:
        """Noise of the residuals at each row, (n,) per channel, for each run: scales without model discrepancy."""
        return self.scales(discrepancy=0.0)

    @property
    def rows(self) -> int:
        """Rows of all runs that are judged."""
        return sum(run.motor[run.judged].size for run in self.runs)

    @property
    def laps(self) -> list[tuple[int, Laps]]:
        """Index and laps of the runs in which motion repeats."""
        return [(index, run.laps) for index, run in enumerate(self.runs) if run.laps is not None]


def prepare_dataset(runs: Sequence[Measured], bench: Bench) -> Dataset:
    """The data set of recordings, its observer chosen so that the encoder's counts resolve the torque noise.

    The time constant is that at which the motor encoder's noise moves the observed torque as much as the noise of the
    torque channel does.
    """
    wanted = max(np.sqrt(run.noise.motor * inertia(bench) / (TORQUE_ACCURACY * run.noise.torque)) for run in runs)
    observer_s = float(np.clip(wanted, FASTEST_OBSERVER_TICKS * runs[0].period_s, SLOWEST_OBSERVER_S))
    return Dataset(tuple(runs), bench, observer_s, max(float(np.ptp(run.position_command_m)) for run in runs))


def inertia(bench: Bench) -> float:
    """Inertia of the whole axis in motor units."""
    modes = bench.twin().modal
    return float(modes.shape[modes.motor, 0] ** -2)


def scales(
    run: Measured, bench: Bench, observer_s: float, torque_accuracy: float, discrepancy: float
) -> dict[str, FloatArray]:
    """Size of one unit of weighted residual at each row (n,), per channel: noise and model discrepancy.

    A torque d that the twin misses moves its motor by d tau^2 / J before the correction takes hold, with tau the
    observer's time constant: the motor counts from the torque that the torque channel can still see. White noise e
    of its encoder comes back through the observer as (1 - z^-1)^2 / (1 - a z^-1)^2 e, a = 1 - T / tau.
    """
    seen = torque_accuracy * run.noise.torque * observer_s**2 / inertia(bench)
    a = 1.0 - run.period_s / observer_s
    impulse = np.zeros(round(20.0 * observer_s / run.period_s) + 3)
    impulse[0] = 1.0
    passed = lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * a, a * a], impulse)
    rows = run.motor.shape
    table, torque = (np.broadcast_to(noise, rows) for noise in (run.noise.table_m, run.noise.torque))
    if run.table_m.size:
        deflection_m = run.table_m - bench.axis.ratio_m_rad * run.motor
        table = np.hypot(table, discrepancy * (deflection_m - np.median(deflection_m)))
    return {
        "motor": np.hypot(run.motor_noise * np.linalg.norm(passed), seen),
        "table": table,
        "torque": torque,
        "command": torque,
    }
