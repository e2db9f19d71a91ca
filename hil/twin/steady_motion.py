"""A twin in steady motion: torque that it needs, position that its motor encoder reads, and torque after a reversal."""

from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.twin.axis import Start, Twin
from hil.twin.mechanism import Stage
from hil.twin.stepping.records import start_memory
from hil.twin.stepping.static_equilibrium import STROKE
from hil.twin.stepping.steady import at_rest, steady

# Time in which the speed after a reversal grows e times: so many of the position loop, whose lag is then 1/20; and s.
_SLOW, _LONGEST_S = 20.0, 1.0
_GENTLE = 0.25  # of the position gain: a loop near its limit swings, and friction does not depend on it
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


def torque_after_reversal(twin: Twin, position_m: float, direction: float, way_m: FloatArray) -> FloatArray:
    """Torque (n,) beyond that of steady motion that the axis needs at ways (n,) since a slow reversal at a position.

    The twin follows x = x0 (cosh(t / tau) - 1) in closed loop: the speed grows with the way, so that each way is passed
    as slowly as its size asks for. direction: of the motion after the reversal, 1 or -1; `way_m` must ascend from above
    0. Zero where no position loop is known, or where it swings.
    """
    gains = twin.gains._replace(position_gain_1_s=_GENTLE * twin.gains.position_gain_1_s)
    if not gains.position_gain_1_s > 0.0:
        return np.zeros(way_m.size)
    least_m, tau_s = 0.1 * float(way_m[0]), min(_SLOW / gains.position_gain_1_s, _LONGEST_S)
    ticks = round(tau_s * np.arccosh(1.0 + 1.1 * way_m[-1] / least_m) / gains.period_s)
    phase = np.arange(-ticks, ticks) * gains.period_s / tau_s
    command_m = position_m + direction * least_m * (np.cosh(phase) - 1.0)
    speed_m_s = direction * least_m / tau_s * np.sinh(phase)
    moved = replace(twin, gains=gains).simulate(command_m, speed_m_s, Start(float(command_m[0]), float(speed_m_s[0])))
    place_m = moved.table_position_m if gains.position_from_table else gains.ratio_m_rad * moved.motor_position
    turned = int(np.argmin(direction * place_m))
    since_m = direction * (place_m[turned:] - place_m[turned])
    passed_m = np.maximum.accumulate(since_m)
    follows = np.max(passed_m - since_m) < way_m[0] and passed_m[-1] > 0.5 * way_m[-1]
    if not (follows and np.max(np.abs(moved.torque_command)) < gains.torque_limit_n_m):
        return np.zeros(way_m.size)
    first = np.append(True, np.diff(passed_m) > 0.0)
    torque = np.interp(way_m, passed_m[first], moved.torque_command[turned:][first])
    inertia = float(twin.chain.inertia_kg_m2.sum()) / gains.ratio_m_rad
    speeds = np.sqrt((way_m / least_m + 1.0) ** 2 - 1.0) * least_m / tau_s
    steady_torque = [
        float(needed_torque(twin, np.array([position_m + direction * way]), direction * speed)[0])
        for way, speed in zip(way_m, speeds, strict=True)
    ]
    return np.asarray(torque - steady_torque - direction * inertia * (way_m + least_m) / tau_s**2)
