"""Does the axis obey? The sign of feedback and torque, and the effect of a controlled stop; compiled.

A loop around a wrong sign accelerates the axis the more, the more it brakes it; so does the stop that it plans. Against
its torque an axis gets faster otherwise only where weight, friction and process exceed that torque, which no usable
axis has at `load_torque`. The first motion is judged by its way as well: set-point and feedback must go the same way.
"""

from __future__ import annotations

from numba import njit

from hil.loop.limits import Limit, Memory

STOP_OVERSHOOT = 0.25  # of the speed of a stop, beyond its end or its begin, in a usable loop
_M = Memory
_SIGN, _STOP_FAILS = int(Limit.SIGN), int(Limit.STOP_FAILS)


@njit(_nrt=False, error_model="numpy", inline="never")
def sign(b, m, f, velocity_m_s):  # type: ignore[no-untyped-def]
    """Limit.SIGN where the axis gets faster against its torque, or begins to move against its set-points.

    velocity_m_s: mean of the motor, over the period in which the torque was measured."""
    passed, speed_m_s = 0, abs(velocity_m_s)
    if f.torque * velocity_m_s < 0.0 and abs(f.torque) > b.load_torque:
        slowest = m[_M.SLOWEST]
        m[_M.SLOWEST] = speed_m_s if slowest == 0.0 else min(slowest, speed_m_s)
        if speed_m_s - m[_M.SLOWEST] > b.runaway_m_s:
            passed |= _SIGN
    else:
        m[_M.SLOWEST] = 0.0
    if m[_M.SIGN_KNOWN] == 0.0:
        if f.velocity_m_s == 0.0:
            m[_M.COMMAND_AT_REST], m[_M.FED_BACK_AT_REST] = f.position_m, f.fed_back_m
        commanded, moved = f.position_m - m[_M.COMMAND_AT_REST], f.fed_back_m - m[_M.FED_BACK_AT_REST]
        if min(abs(commanded), abs(moved)) > b.sign_m:
            if commanded * moved > 0.0:
                m[_M.SIGN_KNOWN] = 1.0
            else:
                passed |= _SIGN
    return passed


@njit(_nrt=False, error_model="numpy", inline="never")
def stop_fails(b, m, f, velocity_m_s):  # type: ignore[no-untyped-def]
    """Limit.STOP_FAILS where the axis is faster than it and its set-points were since the stop began, or turns back.

    A position error at its begin is made good at the speed that the position loop asks for it."""
    if not f.stopping:
        m[_M.STOP_SPEED] = 0.0
        return 0
    if m[_M.STOP_SPEED] == 0.0:
        m[_M.STOP_SPEED] = abs(velocity_m_s)
        m[_M.STOP_MARGIN] = b.runaway_m_s + b.position_gain_1_s * abs(f.position_m - f.fed_back_m)
    m[_M.STOP_SPEED] = max(m[_M.STOP_SPEED], abs(f.velocity_m_s))
    along_m_s = velocity_m_s if f.velocity_m_s >= 0.0 else -velocity_m_s
    margin_m_s = m[_M.STOP_MARGIN] + STOP_OVERSHOOT * m[_M.STOP_SPEED]
    return _STOP_FAILS if along_m_s > m[_M.STOP_SPEED] + margin_m_s or -along_m_s > margin_m_s else 0
