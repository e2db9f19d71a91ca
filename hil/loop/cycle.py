"""The compiled part of one tick: the controller, the live twin beside it, and the row of the recording.

    samples of tick k -> set-point for the drive;   twin: read -> the same law -> its own torque -> advance

The twin runs its own closed loop along the same set-points, independent of the measured values. The torque of tick k is
measured as the mean until tick k + 1, so a row is complete one tick later; two rows are used in turn.
"""

from __future__ import annotations

from dataclasses import asdict
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numba import njit, typeof

from hil.arrays import FloatArray
from hil.channels import AXIS_CHANNELS, AxisKind
from hil.control import cascade, compensation
from hil.control.compensation_tables import OFF, Compensation, Packed, pack
from hil.loop.checks import check
from hil.loop.columns import Column, Setpoint, Watch
from hil.loop.limits import Facts, Limit, Memory
from hil.motion.trajectory import Trajectory
from hil.twin.axis import Start, Twin
from hil.twin.stepping import kernel


class Samples(NamedTuple):
    """Inputs of a tick; torque [N m or N] and cycle time belong to the tick before. Ages: cycles since a position was
    sampled. skipped: ticks left out since the first one; the set-points and the time of the row go on with them."""

    motor: float  # rad or m
    table: float  # m
    torque: float
    drive_state: int
    error_code: int
    lateness_s: float
    cycle_s: float
    motor_age: int = 0
    table_age: int = 0
    skipped: int = 0


class Law(NamedTuple):
    """A controller: gains, and the values of `cascade.State` (6,), which a step changes."""

    gains: cascade.Gains
    state: FloatArray


class Loop(NamedTuple):
    """Arguments of the compiled cycle that stay the same objects during a run."""

    setpoint: int  # quantity commanded to the drive (`Setpoint`)
    bounds: FloatArray  # `Bounds`
    memory: FloatArray  # (len(Memory),) of the checks
    law: Law
    twin_law: Law
    twin: tuple[Any, ...]  # arrays of the kernel, with modal state and memory at the end
    rows: FloatArray  # (2, columns + 1): in turn; values of absent columns go to the last place
    place: np.ndarray[Any, np.dtype[np.int64]]  # (len(Column),): place of each column in a row
    tables: Packed  # of the compensation; without any, it is off
    added: FloatArray  # (len(compensation.Remembered),) its state


_read, _advance, _step, _compensate = kernel.read, kernel.advance, cascade.step, compensation.step
_Added = compensation.Added
STOP_SEGMENT = -1  # in the recording: set-points of a stop
_TO_TORQUE, _TO_VELOCITY = int(Setpoint.TORQUE), int(Setpoint.VELOCITY)
_NOT_FINITE = int(Limit.NOT_FINITE)


@njit(_nrt=False, error_model="numpy")
def _inputs(position, velocity, added, motor, table):  # type: ignore[no-untyped-def]
    return cascade.Inputs(position + added.position_m, velocity + added.velocity_m_s, motor, table, added.torque)


@njit(_nrt=False, error_model="numpy")
def _added(setpoints, index, loop):  # type: ignore[no-untyped-def]
    """What the compensation adds at a set-point; nothing more in a controlled stop."""
    if loop.tables.layout.shape[0] == 0:
        return _Added(0.0, 0.0, 0.0)
    wanted = setpoints[index, 3] != STOP_SEGMENT
    return _compensate(loop.tables, loop.added, setpoints[index, 0], setpoints[index, 1], setpoints[index, 2], wanted)


@njit(_nrt=False, error_model="numpy")  # no references counted: see hil.twin.stepping.kernel
def _control(law, position, velocity, added, motor, table):  # type: ignore[no-untyped-def]
    """Compute a step of `hil.control.cascade`, the state kept in an array."""
    state = law.state
    before = cascade.State(int(state[0]), state[1], state[2], state[3], state[4], state[5])
    after, out = _step(law.gains, before, _inputs(position, velocity, added, motor, table))
    state[0], state[1], state[2] = after.tick, after.velocity_reference_m_s, after.integral_n_m
    state[3], state[4] = after.previous_motor_rad, after.previous2_motor_rad
    state[5] = after.filtered_velocity_rad_s
    return out.torque_n_m, out.velocity_reference_m_s


@njit(cache=True, _nrt=False, error_model="numpy")
def compiled_cycle(tick, first, samples, setpoints, loop):  # type: ignore[no-untyped-def]
    """Row `tick` with set-points (n, 4) that begin at tick `first`: completes the row before (torque, cycle time)
    and fills this one. Returns the set-point for the drive and the limits passed."""
    gains, place = loop.law.gains, loop.place
    index = min(tick + samples.skipped - first, setpoints.shape[0] - 1)
    position, velocity = setpoints[index, 0], setpoints[index, 1]
    before, row = loop.rows[(tick + 1) & 1], loop.rows[tick & 1]
    motor, table, torque = samples.motor, samples.table, samples.torque
    finite = abs(motor) + abs(table) + abs(torque) < np.inf
    if not finite:  # the row repeats the one before: the recording stays readable, the law's state a number
        motor, table, torque = before[place[Column.MOTOR]], before[place[Column.TABLE]], row[place[Column.TORQUE]]
    added = _added(setpoints, index, loop)
    command, reference = _control(loop.law, position, velocity, added, motor, table)
    twin_motor, twin_table = _read(*loop.twin)
    twin_command, _ = _control(loop.twin_law, position, velocity, added, twin_motor, twin_table)
    twin_torque = _advance(twin_command, *loop.twin)
    before[place[Column.TORQUE]] = torque
    before[place[Column.CYCLE]] = samples.cycle_s
    row[place[Column.TIME]] = (tick + samples.skipped) * gains.period_s
    row[place[Column.POSITION_COMMAND]] = position
    row[place[Column.VELOCITY_COMMAND]] = velocity
    row[place[Column.ACCELERATION_COMMAND]] = setpoints[index, 2]
    row[place[Column.SEGMENT]] = setpoints[index, 3]
    row[place[Column.MOTOR]] = motor
    row[place[Column.TABLE]] = table
    row[place[Column.TORQUE_COMMAND]] = command
    row[place[Column.VELOCITY_REFERENCE]] = reference
    row[place[Column.ADDED_POSITION]] = added.position_m
    row[place[Column.ADDED_VELOCITY]] = added.velocity_m_s
    row[place[Column.ADDED_TORQUE]] = added.torque
    row[place[Column.TWIN_MOTOR]] = twin_motor
    row[place[Column.TWIN_TABLE]] = twin_table
    row[place[Column.TWIN_TORQUE]] = twin_torque
    row[place[Column.DRIVE_STATE]] = samples.drive_state
    row[place[Column.ERROR_CODE]] = samples.error_code
    row[place[Column.LATENESS]] = samples.lateness_s
    ratio = gains.ratio_m_rad
    actual = ratio * motor
    fed_back = table if gains.position_from_table else actual
    position, velocity = position + added.position_m, velocity + added.velocity_m_s  # what the loop follows
    facts = Facts(position, velocity, actual, table, fed_back, torque, command, reference,
                  ratio * twin_motor, twin_table, twin_torque,
                  samples.motor_age, samples.table_age, samples.skipped, gains.period_s,
                  setpoints[index, 3] == STOP_SEGMENT)  # fmt: skip
    passed = check(loop.bounds, loop.memory, facts) if finite else _NOT_FINITE
    if loop.setpoint == _TO_TORQUE:
        return (0.0 if passed & _NOT_FINITE else command), passed
    if loop.setpoint == _TO_VELOCITY:
        return (0.0 if passed & _NOT_FINITE else reference / ratio), passed
    return position / ratio, passed


@njit(cache=True, _nrt=False, error_model="numpy")
def compiled_skip(first, last, begin, motor, setpoints, loop):  # type: ignore[no-untyped-def]
    """Pass the ticks first .. last, for which there are no samples: the twin moves on along their set-points, the
    position loop keeps its ticks, and the motor's travel counts as evenly spread over them, since the velocity loop
    divides by one period."""
    for tick in range(first, last + 1):
        index = min(tick - begin, setpoints.shape[0] - 1)
        twin_motor, twin_table = _read(*loop.twin)
        added = _added(setpoints, index, loop)
        command, _ = _control(loop.twin_law, setpoints[index, 0], setpoints[index, 1], added, twin_motor, twin_table)
        _advance(command, *loop.twin)
    state, count = loop.law.state, last + 1 - first
    state[0] += count
    step = (motor - state[3]) / (count + 1)
    state[3], state[4] = motor - step, motor - 2.0 * step


class Cycle:
    """Controller, live twin and rows of one run, for an axis at rest at `motor_position` [rad or m]."""

    def __init__(
        self, twin: Twin, kind: AxisKind, watch: Watch, motor_position: float, tables: Compensation = OFF
    ) -> None:
        names = asdict(AXIS_CHANNELS[kind])
        present = [column for column in Column if column.present(watch)]
        self.channels = tuple(column.channel.format(**names) for column in present)
        width = len(present)
        place = np.array([present.index(column) if column in present else width for column in Column], dtype=np.int64)
        rows = np.zeros((2, width + 1))
        rows[:, place[Column.MOTOR]] = motor_position
        self._views = tuple(memoryview(row)[:width] for row in rows)  # type: ignore[arg-type]
        self.bounds = watch.bounds
        gains, ratio = twin.gains, twin.gains.ratio_m_rad
        delta, memory = twin.state(Start(ratio * motor_position))
        start = np.array(cascade.init(motor_position, period_s=gains.period_s), dtype=np.float64)
        self.loop = Loop(
            int(watch.setpoint),
            np.array(watch.bounds, dtype=np.float64),
            np.zeros(len(Memory)),
            Law(gains, start.copy()),
            Law(twin.loop_gains, start.copy()),
            (*twin.arrays(), delta, memory),
            rows,
            place,
            pack(tables, gains.period_s),
            compensation.start(),
        )
        self._start_m = ratio * motor_position
        law, twin_law = self.loop.law.state, self.loop.twin_law.state
        self.state_arrays = (law, twin_law, delta, memory, rows, self.loop.memory, self.loop.added)  # changed by a step
        self.first_tick = 0  # of the set-points
        self.setpoints = np.array([[ratio * motor_position, 0.0, 0.0, 0.0]])
        # Compiled for these types here; a call of the result omits the look-up of types, which takes 3 us for records.
        arguments = (0, 0, Samples(0.0, 0.0, 0.0, 0, 0, 0.0, 0.0), self.setpoints, self.loop)
        self._compiled = compiled_cycle.compile(tuple(typeof(argument) for argument in arguments))
        passing = (0, 0, 0, 0.0, self.setpoints, self.loop)
        self._skip = compiled_skip.compile(tuple(typeof(argument) for argument in passing))

    def follow(self, trajectory: Trajectory, first_tick: int = 0, segment: int | None = None) -> None:
        """Take set-points that begin at `first_tick`. segment: number recorded instead of the trajectory's own."""
        segments = trajectory.segment if segment is None else np.full(len(trajectory), segment)
        self.first_tick = first_tick
        if self.loop.law.gains.position_from_table and first_tick == 0:  # the zero of the motor encoder is another one
            self.loop.added[compensation.Remembered.DATUM] = trajectory.position_m[0] - self._start_m
        self.setpoints = np.column_stack(
            (trajectory.position_m, trajectory.velocity_m_s, trajectory.acceleration_m_s2, segments)
        ).astype(np.float64, order="C", copy=False)

    def hold(self, tick: int, segment: int) -> None:
        """Hold the set-point of a tick from this tick on."""
        self.setpoints = np.array([[self.setpoint(tick)[0], 0.0, 0.0, segment]])
        self.first_tick = tick

    def skip(self, first: int, last: int, motor: float) -> None:
        """Pass ticks without samples; motor: its position at the tick after them [rad or m]."""
        self._skip(first, last, self.first_tick, motor, self.setpoints, self.loop)

    def setpoint(self, tick: int) -> tuple[float, float, float]:
        """Position, velocity and acceleration set-point of a tick [m, m/s, m/s^2]; the last ones are held."""
        position, velocity, acceleration, _ = self.setpoints[min(tick - self.first_tick, len(self.setpoints) - 1)]
        return float(position), float(velocity), float(acceleration)

    @property
    def velocity_m_s(self) -> float:
        """Motor velocity at the last step as the controller estimates it, at the table."""
        velocity_rad_s = cascade.State(*self.loop.law.state.tolist()).filtered_velocity_rad_s
        return velocity_rad_s * self.loop.law.gains.ratio_m_rad

    def step(self, tick: int, samples: Samples) -> tuple[float, int]:
        """Compute tick `tick`: set-point for the drive in its unit, and the limits passed (`Limit`)."""
        result: tuple[float, int] = self._compiled(tick, self.first_tick, samples, self.setpoints, self.loop)
        return result

    def row(self, tick: int) -> memoryview:
        """Return the row of a tick, complete after the step of the next one or `complete`."""
        return self._views[tick & 1]

    def complete(self, tick: int, torque: float, cycle_s: float) -> memoryview:
        """Complete and return the row of the last tick with its torque and cycle time."""
        row, place = self.loop.rows[tick & 1], self.loop.place
        row[place[Column.TORQUE]], row[place[Column.CYCLE]] = torque if isfinite(torque) else 0.0, cycle_s
        return self._views[tick & 1]
