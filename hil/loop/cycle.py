"""The compiled part of one tick: the controller, the live twin beside it, and the row of the recording.

    samples of tick k -> set-point for the drive;   twin: read -> the same law -> its own torque -> advance

The twin runs its own closed loop along the same set-points, so that what it says depends on nothing measured. The
torque of tick k is measured as the mean until tick k + 1, hence a row is complete one tick later: two take turns.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np
from numba import njit

from hil.channels import AXIS_CHANNELS, AxisKind
from hil.compiled.source_digest import source_digest
from hil.control import cascade
from hil.motion.trajectory import Trajectory
from hil.twin.axis import Start, Twin
from hil.twin.stepping import kernel

# Columns in the order the compiled part writes them; `_names` names them.
(
    TIME,
    POSITION_COMMAND,
    VELOCITY_COMMAND,
    ACCELERATION_COMMAND,
    MOTOR,
    TABLE,
    TORQUE_COMMAND,
    TORQUE,
    VELOCITY_REFERENCE,
    TWIN_MOTOR,
    TWIN_TABLE,
    TWIN_TORQUE,
    DRIVE_STATE,
    ERROR_CODE,
    SEGMENT,
    LATENESS,
    CYCLE,
) = range(17)

# Entries of `watch`: what the drive takes, and the limits of the axis.
SETPOINT, FOLLOWING_ERROR, TRAVEL_LOW, TRAVEL_HIGH = range(4)


class Setpoint(IntEnum):
    """What the drive is given at each tick: both loops here, the position loop here, none here."""

    TORQUE = 0
    VELOCITY = 1
    POSITION = 2


class Limit(IntFlag):
    """Which limits of the axis are passed."""

    NONE = 0
    FOLLOWING_ERROR = 1
    TRAVEL = 2


_read, _advance, _step = kernel.read, kernel.advance, cascade.step
_TO_TORQUE, _TO_VELOCITY = int(Setpoint.TORQUE), int(Setpoint.VELOCITY)
_FOLLOWING_ERROR, _TRAVEL = int(Limit.FOLLOWING_ERROR), int(Limit.TRAVEL)


@njit(_nrt=False, error_model="numpy")  # no references counted: see hil.twin.stepping.kernel
def _controller(law, state, position, velocity, motor, table):  # type: ignore[no-untyped-def]
    """One step of `hil.control.cascade` on arrays: gains (11,), state (6,)."""
    gains = cascade.Gains(
        law[0], law[1], law[2], law[3], law[4], law[5], law[6], int(law[7]), law[8] != 0.0, law[9] != 0.0, law[10]
    )
    before = cascade.State(int(state[0]), state[1], state[2], state[3], state[4], state[5])
    after, out = _step(gains, before, cascade.Inputs(position, velocity, motor, table))
    state[0], state[1], state[2] = after.tick, after.velocity_reference_m_s, after.integral_n_m
    state[3], state[4] = after.previous_motor_rad, after.previous2_motor_rad
    state[5] = after.filtered_velocity_rad_s
    return out.torque_n_m, out.velocity_reference_m_s


def _build_cycle(digest: str) -> Any:
    @njit(cache=True, _nrt=False, error_model="numpy")
    def cycle(  # type: ignore[no-untyped-def]
        tick,
        index,
        motor,
        table,
        torque,
        drive_state,
        error_code,
        lateness,
        cycle_s,
        setpoints,
        watch,
        laws,
        states,
        constants,
        modes,
        values,
        codes,
        delta,
        memory,
        rows,
        place,
    ):
        """Tick `tick` with the set-points of row `index`: completes the row before (torque, cycle time) and fills this
        one; set-point for the drive, and the limits passed."""
        assert digest
        law = laws[0]
        ratio, period = law[5], law[6]
        position, velocity = setpoints[index, 0], setpoints[index, 1]
        command, reference = _controller(law, states[0], position, velocity, motor, table)
        twin_motor, twin_table = _read(constants, modes, values, codes, delta, memory)
        twin_command, _ = _controller(laws[1], states[1], position, velocity, twin_motor, twin_table)
        twin_torque = _advance(twin_command, constants, modes, values, codes, delta, memory)
        before, row = rows[(tick + 1) & 1], rows[tick & 1]
        before[place[TORQUE]] = torque
        before[place[CYCLE]] = cycle_s
        row[place[TIME]] = tick * period
        row[place[POSITION_COMMAND]] = position
        row[place[VELOCITY_COMMAND]] = velocity
        row[place[ACCELERATION_COMMAND]] = setpoints[index, 2]
        row[place[SEGMENT]] = setpoints[index, 3]
        row[place[MOTOR]] = motor
        row[place[TABLE]] = table
        row[place[TORQUE_COMMAND]] = command
        row[place[VELOCITY_REFERENCE]] = reference
        row[place[TWIN_MOTOR]] = twin_motor
        row[place[TWIN_TABLE]] = twin_table
        row[place[TWIN_TORQUE]] = twin_torque
        row[place[DRIVE_STATE]] = drive_state
        row[place[ERROR_CODE]] = error_code
        row[place[LATENESS]] = lateness
        actual = ratio * motor
        passed = 0
        if abs(position - actual) > watch[FOLLOWING_ERROR]:
            passed |= _FOLLOWING_ERROR
        if not watch[TRAVEL_LOW] <= actual <= watch[TRAVEL_HIGH]:
            passed |= _TRAVEL
        kind = int(watch[SETPOINT])
        if kind == _TO_TORQUE:
            return command, passed
        return (reference if kind == _TO_VELOCITY else position) / ratio, passed

    return cycle


compiled_cycle = _build_cycle(source_digest())


@dataclass(frozen=True)
class Watch:
    """What the drive takes, whether a linear encoder is there, and the limits of the axis [m]."""

    setpoint: Setpoint
    has_table: bool
    following_error_m: float
    travel_m: tuple[float, float]


def _names(kind: AxisKind, watch: Watch) -> tuple[str, ...]:
    """Channel of each column; "" where this bench has none: CSV and CSP have the velocity loop in the drive."""
    axis = AXIS_CHANNELS[kind]
    table = axis.table_position if watch.has_table else ""
    return (
        "time_s", axis.position_command, axis.velocity_command, "acceleration_command_m_s2", axis.motor_position,
        table, axis.torque_command if watch.setpoint is Setpoint.TORQUE else "", axis.torque,
        "velocity_reference_m_s" if watch.setpoint is not Setpoint.POSITION else "",
        f"twin_{axis.motor_position}", f"twin_{table}" if table else "", f"twin_{axis.torque}",
        "drive_state", "drive_error_code", "segment", "lateness_s", "cycle_s",
    )  # fmt: skip


class Cycle:
    """Controller, live twin and rows of one run, for an axis at rest at `motor_position` [rad or m]."""

    def __init__(self, twin: Twin, kind: AxisKind, watch: Watch, motor_position: float) -> None:
        names = _names(kind, watch)
        self.channels = tuple(name for name in names if name)
        width = len(self.channels)
        self._place = np.array([self.channels.index(name) if name else width for name in names], dtype=np.int64)
        self._rows = np.zeros((2, width + 1))  # the last value is thrown away
        self._views = tuple(memoryview(row)[:width] for row in self._rows)  # type: ignore[arg-type]
        gains, ratio = twin.gains, twin.gains.ratio_m_rad
        delta, memory = twin.state(Start(ratio * motor_position))
        start = cascade.init(motor_position, period_s=gains.period_s)
        laws = np.array([gains, twin.loop_gains], dtype=np.float64)
        states = np.array([start, start], dtype=np.float64)
        limits = np.array([watch.setpoint, watch.following_error_m, *watch.travel_m], dtype=np.float64)
        self.state_arrays = (states, delta, memory, self._rows)  # what a step changes
        self.arrays = (limits, laws, states, *twin.arrays(), delta, memory, self._rows, self._place)
        self.setpoints = np.array([[ratio * motor_position, 0.0, 0.0, 0.0]])

    def follow(self, trajectory: Trajectory, segment: int | None = None) -> None:
        """Set-points from here on; index 0 is its first. segment: number recorded instead of the trajectory's own."""
        segments = trajectory.segment if segment is None else np.full(len(trajectory), segment)
        self.setpoints = np.column_stack(
            (trajectory.position_m, trajectory.velocity_m_s, trajectory.acceleration_m_s2, segments)
        )

    @property
    def velocity_m_s(self) -> float:
        """Of the motor at the last step, as the controller sees it, at the table."""
        laws, states = self.arrays[1:3]
        return float(states[0, 5] * laws[0, 5])

    def step(
        self, tick: int, index: int, motor: float, table: float, torque: float, drive_state: int, error_code: int,
        lateness_s: float, cycle_s: float,
    ) -> tuple[float, int]:  # fmt: skip
        """Tick `tick`: motor [rad or m], table [m], and of the tick before its torque [N m or N] and cycle time.

        Set-point for the drive in its unit, and the limits passed (`Limit`).
        """
        result: tuple[float, int] = compiled_cycle(
            tick,
            index,
            motor,
            table,
            torque,
            drive_state,
            error_code,
            lateness_s,
            cycle_s,
            self.setpoints,
            *self.arrays,
        )
        return result

    def row(self, tick: int) -> memoryview:
        """The row of a tick, complete after the step of the next one or `complete`."""
        return self._views[tick & 1]

    def complete(self, tick: int, torque: float, cycle_s: float) -> memoryview:
        """The row of the last tick, with what came after it."""
        row = self._rows[tick & 1]
        row[self._place[TORQUE]], row[self._place[CYCLE]] = torque, cycle_s
        return self._views[tick & 1]
