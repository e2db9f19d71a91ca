"""Recordings as the diagnosis uses them: the channels a twin predicts, where the run starts, its noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil import control
from hil.bench import Bench
from hil.errors import InputError
from hil.recording import Recording
from hil.twin.axis import Response, Start

FloatArray = NDArray[np.float64]

SETTLE_S = 0.05      # of the start of a recording is not judged: its initial state is only roughly known
MINIMUM_S = 1.0      # a shorter recording holds no motion to learn from


@dataclass(frozen=True)
class Floor:
    """Standard deviation of what no model can predict, per residual channel: motor units, table in m."""

    motor: float
    table_m: float
    torque: float


@dataclass(frozen=True, eq=False)
class Run:
    """One recording, ready to be compared: channels (n,) in motor units (rad, N m or m, N)."""

    name: str
    period_s: float
    position_command_m: FloatArray
    velocity_command_m_s: FloatArray
    motor: FloatArray
    table_m: FloatArray            # empty where there is no linear encoder
    torque_command: FloatArray
    torque: FloatArray
    start: Start
    floor: Floor

    @property
    def measured(self) -> Response:
        """The measured channels in the twin's order."""
        return Response(self.motor, self.table_m, self.torque_command, self.torque)

    @property
    def samples(self) -> int:
        """Number of rows."""
        return int(self.motor.size)

    @property
    def time_s(self) -> FloatArray:
        """Time from the first row."""
        return np.arange(self.samples) * self.period_s


def prepare(recording: Recording, bench: Bench) -> Run:
    """A recording of this bench as a Run.

    Raises InputError where a channel that the twin needs is missing, or the recording is too short or was
    sampled at another rate than the velocity loop.
    """
    names = recording.axis
    if (recording.kind == "linear") != bench.axis.linear:
        raise InputError(f"{recording.name}: a {recording.kind} recording, but the bench describes a "
                         f"{'linear' if bench.axis.linear else 'rotary'} axis; use the bench of this axis")
    gains = bench.gains
    if abs(recording.period_s - gains.period_s) > 0.01 * gains.period_s:
        raise InputError(f"{recording.name}: sampled every {recording.period_s:g} s, but the velocity loop of the "
                         f"bench runs every {gains.period_s:g} s; record one row per velocity-loop tick")
    if len(recording) * recording.period_s < MINIMUM_S:
        raise InputError(f"{recording.name}: {len(recording) * recording.period_s:.3f} s long, at least "
                         f"{MINIMUM_S:g} s with motion are needed to tell causes apart")

    def channel(name: str) -> FloatArray:
        return np.ascontiguousarray(recording[name], dtype=np.float64)

    motor, torque = channel(names.motor_position), channel(names.torque)
    position = channel(names.position_command)
    columns = recording.columns
    velocity = (channel(names.velocity_command) if names.velocity_command in columns
                else np.gradient(position, recording.period_s))
    command = channel(names.torque_command) if names.torque_command in columns else torque
    table = channel(names.table_position) if bench.has_table_encoder else np.empty(0)
    measured = table if table.size else gains.ratio_m_rad * motor
    start = _start(gains, position, velocity, motor, measured, command)
    return Run(recording.name, recording.period_s, position, velocity, motor, table, command, torque, start,
               _floor(bench, motor, table, torque, command))


def _start(gains: control.Gains, position: FloatArray, velocity: FloatArray, motor: FloatArray,
           table: FloatArray, command: FloatArray) -> Start:
    """State at the first row, and the phase of the position loop: the one whose replay fits best."""
    head = slice(0, min(motor.size, 2000))
    lead_in = min(10, motor.size - 1)
    speed = float(np.polyfit(np.arange(lead_in + 1) * gains.period_s, motor[:lead_in + 1], 2)[1])
    if np.ptp(motor[:lead_in + 1]) == 0.0:
        speed = 0.0

    def misfit(tick: int) -> tuple[float, float]:
        state = control.init(motor[0], speed, 0.0, gains.period_s, tick)
        first, _ = control.replay(gains, state, position[:1], velocity[:1], motor[:1], table[:1])
        integral = float(command[0] - first[0])
        state = state._replace(integral_n_m=integral)
        replayed, _ = control.replay(gains, state, position[head], velocity[head], motor[head], table[head])
        return float(np.mean((replayed - command[head]) ** 2)), integral

    misfits = [misfit(tick) for tick in range(gains.position_ticks)]
    tick = int(np.argmin([value for value, _ in misfits]))
    return Start(float(gains.ratio_m_rad * motor[0]), gains.ratio_m_rad * speed, misfits[tick][1], tick)


def _floor(bench: Bench, motor: FloatArray, table: FloatArray, torque: FloatArray,
           command: FloatArray) -> Floor:
    """Noise of the sensors, from what a sample differs from its neighbours by and from the counts."""
    encoder = bench.encoders.motor
    count = encoder.resolution_m if bench.axis.linear and encoder.resolution_m else 2.0 * np.pi / encoder.counts_per_rev
    motor_floor = max(_white(motor), count / np.sqrt(12.0))
    table_floor = 0.0
    if table.size and bench.encoders.table is not None:
        quantum = bench.encoders.table.resolution_m
        table_floor = max(_white(table - bench.axis.ratio_m_rad * motor), quantum / np.sqrt(12.0))
    return Floor(motor_floor, table_floor, max(_white(torque - command), 1e-12))


def _white(signal: FloatArray) -> float:
    """White noise of a smooth signal: fourth differences, of variance 70, see nothing slower.

    The median over blocks keeps events, such as reversals, out of it.
    """
    differences = np.diff(signal, 4)
    blocks = differences[: differences.size // 64 * 64].reshape(-1, 64)
    if not blocks.size:
        return 0.0
    return float(np.sqrt(np.median(np.mean(blocks**2, axis=1)) / 70.0))


def judged(run: Run) -> slice:
    """Rows that count."""
    return slice(int(SETTLE_S / run.period_s), None)


def total_duration_s(runs: Sequence[Run]) -> float:
    """Length of all runs together."""
    return sum(run.samples * run.period_s for run in runs)
