"""Columns of a row of a run, each with the condition under which a run has it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from hil.loop.limits import Bounds


class Setpoint(IntEnum):
    """Quantity commanded to the drive: torque (both loops here), velocity (position loop here), or position."""

    TORQUE = 0
    VELOCITY = 1
    POSITION = 2


@dataclass(frozen=True)
class Watch:
    """Quantity commanded to the drive, and bounds of the checks."""

    setpoint: Setpoint
    bounds: Bounds
    compensated: bool = False


def _always(watch: Watch) -> bool:
    return True


def _with_table(watch: Watch) -> bool:
    return watch.bounds.has_table


def _with_velocity_loop(watch: Watch) -> bool:
    return watch.setpoint is Setpoint.TORQUE


def _compensated(watch: Watch) -> bool:
    return watch.compensated


def _with_position_loop(watch: Watch) -> bool:
    return watch.setpoint is not Setpoint.POSITION


class Column(IntEnum):
    """Columns of a row, in order: channel (fields of `hil.channels.AxisChannels` in braces) and its condition.

    A new channel is one line here and one line in `cycle`.
    """

    channel: str
    present: Callable[[Watch], bool]

    def __new__(cls, channel: str, present: Callable[[Watch], bool] = _always) -> Column:
        column = int.__new__(cls, len(cls.__members__))
        column._value_ = len(cls.__members__)
        column.channel, column.present = channel, present
        return column

    TIME = "time_s"
    POSITION_COMMAND = "{position_command}"
    VELOCITY_COMMAND = "{velocity_command}"
    ACCELERATION_COMMAND = "acceleration_command_m_s2"
    MOTOR = "{motor_position}"
    TABLE = "{table_position}", _with_table
    TORQUE_COMMAND = "{torque_command}", _with_velocity_loop
    TORQUE = "{torque}"
    VELOCITY_REFERENCE = "velocity_reference_m_s", _with_position_loop
    ADDED_POSITION = "compensation_position_m", _compensated
    ADDED_VELOCITY = "compensation_velocity_m_s", _compensated
    ADDED_TORQUE = "compensation_{torque}", _compensated
    TWIN_MOTOR = "twin_{motor_position}"
    TWIN_TABLE = "twin_{table_position}", _with_table
    TWIN_TORQUE = "twin_{torque}"
    DRIVE_STATE = "drive_state"
    ERROR_CODE = "drive_error_code"
    SEGMENT = "segment"
    LATENESS = "lateness_s"
    CYCLE = "cycle_s"
