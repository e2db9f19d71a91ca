"""The compiled checks of one tick: measured values against bounds and against each other.

All positions are at the table [m]; encoders are compared by their travel since the first tick, because their zeros
differ. Where a sample is late nothing is compared with it. `hil.loop.supervision` says what follows from each bit.
"""

from __future__ import annotations

import math

from numba import njit

from hil.loop.limits import Bounds, Limit, Memory
from hil.loop.sign_check import sign, stop_fails

SMOOTHING = 0.125  # share of a new value: noise of one count in one period is no speed
TORQUE_TICKS = 3  # in a row beyond the torque bound: one sample may be an impact
RESIDUAL_TICKS = 20  # a force shows at the table first, then in the motor and the torque: some ms of an axis
FRESH_PERIODS = 2.0  # what two encoders may be apart in time: a serial one is a period late, and jitters by one

_M = Memory
# numba knows integers, not flags
_FOLLOWING_ERROR = int(Limit.FOLLOWING_ERROR)
_TRAVEL = int(Limit.TRAVEL)
_NOT_FINITE = int(Limit.NOT_FINITE)
_MOTOR_JUMP = int(Limit.MOTOR_JUMP)
_TABLE_JUMP = int(Limit.TABLE_JUMP)
_MOTOR_FROZEN = int(Limit.MOTOR_FROZEN)
_TABLE_FROZEN = int(Limit.TABLE_FROZEN)
_MOTOR_REVERSED = int(Limit.MOTOR_REVERSED)
_TABLE_REVERSED = int(Limit.TABLE_REVERSED)
_ENCODER_DIFFERENCE = int(Limit.ENCODER_DIFFERENCE)
_VELOCITY = int(Limit.VELOCITY)
_TORQUE = int(Limit.TORQUE)
_TORQUE_TIME = int(Limit.TORQUE_TIME)
_STOPPING_DISTANCE = int(Limit.STOPPING_DISTANCE)
_ACTING_TORQUE = int(Limit.ACTING_TORQUE)
_RESIDUAL_ENCODER = int(Limit.RESIDUAL_ENCODER)
_RESIDUAL_DRIVE = int(Limit.RESIDUAL_DRIVE)
_RESIDUAL_LOAD = int(Limit.RESIDUAL_LOAD)


@njit(_nrt=False, error_model="numpy")
def _unpacked(a):  # type: ignore[no-untyped-def]
    """Bounds from an array: a tuple as argument of the compiled cycle costs 50 ns for each field."""
    return Bounds(
        a[0] != 0.0, a[1] != 0.0, a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13], a[14],
        a[15], a[16], a[17], a[18], a[19], a[20], a[21], a[22],
    )  # fmt: skip


@njit(_nrt=False, error_model="numpy", inline="never")
def check(bounds, memory, facts):  # type: ignore[no-untyped-def]
    """Bits of `Limit` that this tick passes; updates the memory (len(Memory),). bounds: `Bounds` as an array."""
    b, m, f = _unpacked(bounds), memory, facts
    total = abs(f.position_m) + abs(f.motor_m) + abs(f.torque) + abs(f.command) + abs(f.reference)
    total += abs(f.twin_motor_m) + abs(f.twin_table_m) + abs(f.twin_torque) + abs(f.table_m)
    if not total < math.inf:
        return _NOT_FINITE
    if m[_M.PRIMED] == 0.0:
        m[_M.PRIMED], m[_M.COMMAND_ALIKE], m[_M.TORQUE_COMMAND] = 1.0, f.position_m, f.command
        m[_M.MOTOR_START] = m[_M.MOTOR] = m[_M.MOTOR_AT_TABLE] = m[_M.MOTOR_ALIKE] = f.motor_m
        m[_M.TABLE_START] = m[_M.TABLE] = m[_M.TABLE_AT_MOTOR] = m[_M.TABLE_ALIKE] = f.table_m
        m[_M.TORQUE_AT_MOTOR] = m[_M.TWIN_TORQUE] = f.torque
        m[_M.COMMAND_AT_REST], m[_M.FED_BACK_AT_REST] = f.position_m, f.fed_back_m
    passed = 0
    periods = 1.0 + f.skipped - m[_M.SKIPPED]
    m[_M.SKIPPED] = f.skipped
    m[_M.MOTOR_PERIODS] += periods
    m[_M.TABLE_PERIODS] += periods
    if abs(f.position_m - f.fed_back_m) > b.following_error_m + b.following_error_s * abs(f.velocity_m_s):
        passed |= _FOLLOWING_ERROR
    if not b.travel_low_m <= f.fed_back_m <= b.travel_high_m:
        passed |= _TRAVEL
    if f.motor_age == 0:
        span_s = m[_M.MOTOR_PERIODS] * f.period_s
        moved = f.motor_m - m[_M.MOTOR]
        if abs(moved) > b.velocity_m_s * span_s + b.frozen_m:
            passed |= _MOTOR_JUMP
        passed |= sign(b, m, f, moved / span_s) | stop_fails(b, m, f, moved / span_s)
        m[_M.VELOCITY] += SMOOTHING * (moved / span_s - m[_M.VELOCITY])
        m[_M.MOTOR], m[_M.MOTOR_PERIODS] = f.motor_m, 0.0
        if moved != 0.0:
            m[_M.TABLE_AT_MOTOR], m[_M.TORQUE_AT_MOTOR] = f.table_m, f.torque
        elif b.commands_torque and abs(f.torque - m[_M.TORQUE_AT_MOTOR]) > b.frozen_torque:
            passed |= _MOTOR_FROZEN
    velocity = m[_M.VELOCITY]
    if abs(velocity) > b.velocity_m_s:
        passed |= _VELOCITY
    stop_m = f.fed_back_m + velocity * abs(velocity) / (2.0 * b.deceleration_m_s2)
    if not b.travel_low_m - b.following_error_m <= stop_m <= b.travel_high_m + b.following_error_m:
        passed |= _STOPPING_DISTANCE
    if b.has_table and f.table_age == 0:
        moved = f.table_m - m[_M.TABLE]
        if abs(moved) > b.velocity_m_s * m[_M.TABLE_PERIODS] * f.period_s + b.frozen_m:
            passed |= _TABLE_JUMP
        m[_M.TABLE], m[_M.TABLE_PERIODS] = f.table_m, 0.0
        if moved != 0.0:
            m[_M.MOTOR_AT_TABLE] = f.motor_m
    if b.has_table and f.table_age == 0 and f.motor_age == 0:
        passed |= _compare(b, m, f, FRESH_PERIODS * f.period_s * abs(velocity))
    passed |= _torque(b, m, f)
    return passed


@njit(_nrt=False, error_model="numpy", inline="never")
def _compare(b, m, f, apart_m):  # type: ignore[no-untyped-def]
    """Compare the two encoders."""
    passed = 0
    if abs(f.table_m - m[_M.TABLE_AT_MOTOR]) > b.frozen_m + apart_m:
        passed |= _MOTOR_FROZEN
    if abs(f.motor_m - m[_M.MOTOR_AT_TABLE]) > b.frozen_m + apart_m:
        passed |= _TABLE_FROZEN
    motor, table = f.motor_m - m[_M.MOTOR_ALIKE], f.table_m - m[_M.TABLE_ALIKE]
    if min(abs(motor), abs(table)) > b.frozen_m + apart_m:
        if motor * table > 0.0:
            m[_M.MOTOR_ALIKE], m[_M.TABLE_ALIKE], m[_M.COMMAND_ALIKE] = f.motor_m, f.table_m, f.position_m
        else:
            follows = motor * (f.position_m - m[_M.COMMAND_ALIKE]) > 0.0
            passed |= _TABLE_REVERSED if follows else _MOTOR_REVERSED
    motor, table = f.motor_m - m[_M.MOTOR_START], f.table_m - m[_M.TABLE_START]
    if abs(motor - table) > b.encoder_difference_m + apart_m:
        passed |= _ENCODER_DIFFERENCE
    return passed


@njit(_nrt=False, error_model="numpy", inline="never")
def _torque(b, m, f):  # type: ignore[no-untyped-def]
    """Check torque, torque over time, acting set-point and the residual of the twin."""
    passed = 0
    m[_M.TORQUE_TICKS] = m[_M.TORQUE_TICKS] + 1.0 if abs(f.torque) > b.torque else 0.0
    if m[_M.TORQUE_TICKS] >= TORQUE_TICKS:
        passed |= _TORQUE
    m[_M.HEAT] += f.period_s / b.thermal_time_s * (f.torque * f.torque - m[_M.HEAT])
    if m[_M.HEAT] > b.continuous_torque * b.continuous_torque:
        passed |= _TORQUE_TIME
    unlike_command = 0.0
    if b.commands_torque and f.motor_age == 0:
        unlike_command = f.torque - min(max(m[_M.TORQUE_COMMAND], -b.drive_torque), b.drive_torque)
        m[_M.TORQUE_GAP] += SMOOTHING * (unlike_command - m[_M.TORQUE_GAP])
        if abs(m[_M.TORQUE_GAP]) > b.torque_difference:
            passed |= _ACTING_TORQUE
    if f.motor_age == 0 and f.table_age == 0:
        motor = abs(f.motor_m - f.twin_motor_m) / b.residual_motor_m
        table = abs(f.table_m - f.twin_table_m) / b.residual_table_m
        torque = abs(f.torque - m[_M.TWIN_TORQUE]) / b.residual_torque
        m[_M.RESIDUAL_TICKS] = m[_M.RESIDUAL_TICKS] + 1.0 if max(motor, table, torque) > 1.0 else 0.0
        if m[_M.RESIDUAL_TICKS] >= RESIDUAL_TICKS:  # half: nearly beyond counts as beyond beside another that is
            if abs(unlike_command) > b.residual_torque:
                passed |= _RESIDUAL_DRIVE
            elif torque <= 0.5 and b.has_table and min(motor, table) <= 0.5:
                passed |= _RESIDUAL_ENCODER
            else:
                passed |= _RESIDUAL_LOAD
    m[_M.TORQUE_COMMAND], m[_M.TWIN_TORQUE] = f.command, f.twin_torque
    return passed
