"""Replay of a cascaded control law on measured inputs, loop by loop where the speed set-point between them is recorded.

    position loop   s w = Kv (x_cmd(t - d) - x) + ff v_cmd(t - d)
    velocity loop   T   = Kp (s w / r - v) + Kp / Ti (integral of the same)

w is the recorded speed set-point and s its scale, which need not be known; d is the delay of the recorded set-points,
and x and v may be those of some rows ago. Without w both loops are one chain from set-points to torque command. The
integrator follows the recorded command (`hil.twin.stepping.loops.replay_law`), so offsets and slow rounding do not
count.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.control.cascade import Gains
from hil.identification.measured import last_difference, later
from hil.twin.axis import Response, Start, Twin
from hil.twin.stepping.loops import INTEGRATOR_S


class Settings(NamedTuple):
    """Settings of a control law; `scale` of the recorded speed set-point, delays in rows."""

    gains: Gains
    scale: float = 1.0
    setpoint_rows: float = 0.0  # the law uses the recorded set-points so much later
    feedback_rows: float = 0.0  # the law uses positions that are so old
    differenced: bool = False  # the feed-forward is the last difference of the position set-points


@dataclass(frozen=True, eq=False)
class LawRows:
    """Inputs and output of a control law at the rows (n,) of a recording, in motor units."""

    position_command_m: FloatArray
    velocity_command_m_s: FloatArray
    measured: Response
    speed_set_point: FloatArray  # (0,) if it is not recorded, or not used
    start: Start
    first_evaluated: int
    noise: float  # standard deviation of the torque command

    def feedback_m(self, gains: Gains) -> FloatArray:
        """Position (n,) that the position loop gets."""
        if gains.position_from_table and self.measured.table_position_m.size:
            return self.measured.table_position_m
        return np.asarray(gains.ratio_m_rad * self.measured.motor_position)

    def delayed(self, settings: Settings) -> "LawRows":
        """The rows with the inputs that the law uses, by the delays of `settings`."""
        late, old = settings.setpoint_rows, settings.feedback_rows
        motor, table = self.measured.motor_position, self.measured.table_position_m
        velocity = self.velocity_command_m_s
        if settings.differenced:
            velocity = last_difference(self.position_command_m, settings.gains.period_s)
        if old:
            motor, table = later(motor, old), later(table, old) if table.size else table
        return replace(
            self,
            position_command_m=later(self.position_command_m, late) if late else self.position_command_m,
            velocity_command_m_s=later(velocity, late) if late else velocity,
            measured=self.measured._replace(motor_position=motor, table_position_m=table),
        )

    def part(self, rows: slice) -> "LawRows":
        """Some of the rows."""
        return replace(
            self,
            position_command_m=self.position_command_m[rows],
            velocity_command_m_s=self.velocity_command_m_s[rows],
            measured=Response(*(values[rows] for values in self.measured)),
            speed_set_point=self.speed_set_point[rows],
            first_evaluated=max(self.first_evaluated - (rows.start or 0), 0),
        )


class Parts(NamedTuple):
    """One channel for each loop: torque command, and speed set-point where it is recorded, over the noise."""

    command: FloatArray
    speed: FloatArray  # (0,) without a recorded speed set-point


def position_loop(gains: Gains, rows: LawRows) -> FloatArray:
    """Speed set-point (n,) [m/s] of the position loop, which runs at the first row."""
    ticks = np.arange(rows.position_command_m.size) // gains.position_ticks * gains.position_ticks
    error = (rows.position_command_m - rows.feedback_m(gains))[ticks]
    return np.asarray(
        gains.position_gain_1_s * error + gains.velocity_feedforward * rows.velocity_command_m_s[ticks],
        dtype=np.float64,
    )


def residuals(rows: LawRows, settings: Settings, twin: Twin, cut: int, weight: float) -> Parts:
    """Residuals of a control law: recorded less computed values at the evaluated rows, without the first `cut` rows.

    `twin` has the mechanisms on the inputs of the controller. `weight` is the velocity gain with which a deviation of
    the speed set-point counts as one of the command.
    """
    gains, period_s = settings.gains, settings.gains.period_s
    ratio = gains.ratio_m_rad
    whole = replace(rows, measured=twin.undelayed(rows.measured)).delayed(settings)
    law, motor = whole.part(slice(cut, None)), rows.measured.motor_position
    position, velocity, speed = law.position_command_m, law.velocity_command_m_s, np.empty(0)
    if law.speed_set_point.size:
        wanted = position_loop(gains, law)
        velocity = settings.scale * law.speed_set_point
        speed = weight / ratio * (velocity - wanted)
        gains = gains._replace(position_gain_1_s=0.0, velocity_feedforward=1.0, position_ticks=1)
    start = rows.start._replace(
        position_m=float(ratio * motor[cut]),
        velocity_m_s=float(ratio * (motor[cut] - motor[cut - 1]) / period_s) if cut else rows.start.velocity_m_s,
        torque=0.0,
    )
    controller = replace(twin, gains=gains)
    if gains.integral_gain_n_m_rad > 0.0:  # at first, the integrator holds what the proportional part does not
        first = Response(*(one[:1] for one in law.measured))
        proportional = controller.command(position[:1], velocity[:1], first, start)
        start = start._replace(torque=float(first.torque_command[0] - proportional[0]))
    command = law.measured.torque_command - controller.command(position, velocity, law.measured, start)
    with np.errstate(over="ignore", invalid="ignore"):
        return Parts(*(_finite(one[law.first_evaluated :] / rows.noise) for one in (command, speed)))


def _finite(values: FloatArray) -> FloatArray:
    return np.asarray(np.nan_to_num(values, posinf=1e6, neginf=-1e6))


def to_explain(rows: LawRows, gains: Gains) -> FloatArray:
    """Part of the command that a law has to explain, in the units of `residuals`.

    It is what passes the integrator that follows the command: a slow one is followed without any law.
    """
    return high_pass(rows.measured.torque_command, gains.period_s)[rows.first_evaluated :] / rows.noise


def high_pass(values: FloatArray, period_s: float) -> FloatArray:
    """Values (n,) or (n, k) less what an integrator follows that is corrected by them."""
    keep = np.exp(-period_s / INTEGRATOR_S)
    return np.asarray(lfilter([1.0, -1.0], [1.0, -keep], values - values[:1], axis=0))
