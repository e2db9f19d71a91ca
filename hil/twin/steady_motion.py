"""A twin in steady motion: torque that it needs, and position that its motor encoder reads, over place and speed."""

from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.twin.axis import Twin
from hil.twin.mechanism import Stage
from hil.twin.stepping.records import start_memory
from hil.twin.stepping.static_equilibrium import STROKE
from hil.twin.stepping.steady import at_rest, steady

_PRESSED = 1e-9  # deflection [motor units] of a flank that carries no load: it lies on without one


def needed_torque(twin: Twin, position_m: FloatArray, velocity_m_s: float) -> FloatArray:
    """Torque command (n,) that a constant velocity needs at positions (n,) of the motor, seen at the table."""
    ratio = twin.gains.ratio_m_rad
    needed, _ = steady(position_m / ratio, velocity_m_s / ratio, 0.0, *twin.arrays(), start_memory())
    return np.asarray(needed)


def motor_reading(twin: Twin, position_m: FloatArray, velocity_m_s: float) -> FloatArray:
    """Reading of the motor encoder [m at the table] (n,) while the table passes positions (n,) slowly in the direction
    of a velocity: lead errors, play, windup by friction and loads. `position_m` must ascend."""
    ratio = twin.gains.ratio_m_rad
    seen = replace(twin, active=tuple(one for one in twin.active if one.form.stage is not Stage.TABLE_READING))
    arrays, direction = seen.arrays(), float(np.sign(velocity_m_s))
    spring = max(float(arrays.constants[0]["spring"]), 1.0)
    _, on_table = steady(position_m / ratio, velocity_m_s / ratio, 0.0, *arrays, start_memory())
    delta, pushes = np.zeros((2, seen.modal.frequency_rad_s.size)), -(on_table + direction * _PRESSED * spring) / ratio
    motor, table = at_rest(position_m / ratio, pushes, direction * STROKE, *arrays, delta, start_memory())
    return np.asarray(position_m + np.interp(position_m, table, ratio * motor - table))
