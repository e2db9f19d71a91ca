"""What the checks of a tick compare: limits, bounds, values of the tick, and memory from tick to tick."""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple


class Limit(IntFlag):
    """Bounds that a tick passed."""

    NONE = 0
    FOLLOWING_ERROR = 1
    TRAVEL = 2
    NOT_FINITE = 4
    MOTOR_JUMP = 8
    TABLE_JUMP = 16
    MOTOR_FROZEN = 32
    TABLE_FROZEN = 64
    MOTOR_REVERSED = 128
    TABLE_REVERSED = 256
    ENCODER_DIFFERENCE = 512
    VELOCITY = 1024
    TORQUE = 2048
    TORQUE_TIME = 4096
    STOPPING_DISTANCE = 8192
    ACTING_TORQUE = 16384
    RESIDUAL_ENCODER = 32768
    RESIDUAL_DRIVE = 65536
    RESIDUAL_LOAD = 131072
    SIGN = 262144
    STOP_FAILS = 524288


class Bounds(NamedTuple):
    """Bounds of the checks; inf: off. Torques in N m, linear axes N."""

    has_table: bool
    commands_torque: bool
    following_error_m: float
    following_error_s: float
    travel_low_m: float
    travel_high_m: float
    deceleration_m_s2: float  # of a controlled stop
    velocity_m_s: float
    encoder_difference_m: float
    frozen_m: float
    frozen_torque: float
    torque: float
    torque_difference: float
    drive_torque: float  # to which the drive limits its command
    continuous_torque: float
    thermal_time_s: float
    residual_motor_m: float
    residual_table_m: float
    residual_torque: float
    load_torque: float  # of weight and process: it may drive the axis against the motor
    runaway_m_s: float  # speed gained against the torque, or beyond a stop, by which an axis runs away
    position_gain_1_s: float
    sign_m: float  # way of the first motion within which set-point and feedback agree in sign


class Memory(IntEnum):
    """Places of what the checks remember from tick to tick."""

    PRIMED = 0
    MOTOR_START = 1
    TABLE_START = 2
    TORQUE_COMMAND = 3  # of the tick before
    MOTOR = 4  # last fresh sample
    TABLE = 5
    MOTOR_PERIODS = 6  # since the last fresh sample
    TABLE_PERIODS = 7
    TABLE_AT_MOTOR = 8  # position of the table encoder when the motor encoder changed last
    MOTOR_AT_TABLE = 9
    TORQUE_AT_MOTOR = 10  # measured torque when the motor encoder changed last
    VELOCITY = 11  # smoothed
    COMMAND_ALIKE = 12  # position set-point at MOTOR_ALIKE
    TWIN_TORQUE = 13  # of the tick before
    TORQUE_TICKS = 14  # in a row beyond the bound
    TORQUE_GAP = 15  # measured less commanded torque, smoothed
    HEAT = 16  # mean square of the torque over the thermal time
    SKIPPED = 17
    RESIDUAL_TICKS = 18  # in a row beyond a threshold
    MOTOR_ALIKE = 19  # where both encoders had last moved by frozen_m into the same direction
    TABLE_ALIKE = 20
    SLOWEST = 21  # speed since the torque opposes the motion; 0: it does not
    SIGN_KNOWN = 22  # the first motion had the sign of the set-points
    COMMAND_AT_REST = 23  # set-point and feedback where the set-points stood still last
    FED_BACK_AT_REST = 24
    STOP_SPEED = 25  # highest of the controlled stop: at its begin, or of its set-points; 0: no stop
    STOP_MARGIN = 26


class Facts(NamedTuple):
    """Values of a tick that are checked; torque was measured over the period before. skipped: ticks since the start."""

    position_m: float  # set-points
    velocity_m_s: float
    motor_m: float
    table_m: float
    fed_back_m: float
    torque: float
    command: float
    reference: float
    twin_motor_m: float
    twin_table_m: float
    twin_torque: float
    motor_age: int
    table_age: int
    skipped: int
    period_s: float
    stopping: bool = False  # the set-points are those of a controlled stop
