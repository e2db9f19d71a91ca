"""Replay of a cascaded control law on measured inputs, loop by loop where the speed set-point between them is recorded.

    position loop   s w = Kv (x_cmd(t - d) - x) + ff v_cmd(t - d)
    velocity loop   T   = Kp (s w / r - v) + Kp / Ti (integral of the same)

w is the recorded speed set-point and s its scale, which need not be known; d is the delay of the recorded set-points,
and x and v may be those of some rows ago. Without w both loops are one chain from set-points to torque command. The
integrator follows the recorded command (`hil.twin.stepping.loops.replay_law`), so offsets and slow rounding do not
count.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares, minimize
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.control.cascade import Gains
from hil.identification.measured import last_difference, later
from hil.twin.axis import Response, Start, Twin
from hil.twin.stepping.loops import INTEGRATOR_S

# Largest delays in rows: buffer and look-ahead of a logger; bus and drive.
SETPOINT_ROWS, FEEDBACK_ROWS = 40.0, 12.0
_SCANNED = 6000  # rows in which delays are looked for: seconds of motion at a usual rate
_EACH = 8.0  # rows: delays that are tried one by one, longer ones by two
_BEFORE = 50  # rows before the first evaluated one
_SAME = 0.01  # relative difference of the squares that two solutions leave, up to which they count as equal


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

    def until(self, row: int) -> "LawRows":
        """The rows before `row`."""
        return replace(
            self,
            position_command_m=self.position_command_m[:row],
            velocity_command_m_s=self.velocity_command_m_s[:row],
            measured=Response(*(values[:row] for values in self.measured)),
            speed_set_point=self.speed_set_point[:row],
        )

    def since(self, row: int) -> "LawRows":
        """The rows from `row` on."""
        return replace(
            self,
            position_command_m=self.position_command_m[row:],
            velocity_command_m_s=self.velocity_command_m_s[row:],
            measured=Response(*(values[row:] for values in self.measured)),
            speed_set_point=self.speed_set_point[row:],
            first_evaluated=max(self.first_evaluated - row, 0),
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
    law, motor = whole.since(cut), rows.measured.motor_position
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


def closed_form(runs: Sequence[LawRows], base: Settings, cuts: Sequence[int]) -> Settings | None:
    """Settings with gains from least squares of the rows alone, with the delays of `base`; None if one is not positive.

    T = Kp x + Ki integral(x) with x = Kv e / r + ff v_c / r - v is linear in Kp Kv, Kp ff, Kp and Ki Kv, Ki ff, Ki; all
    pass the high-pass of an integrator that follows the command. A recorded speed set-point takes the place of e and
    v_c, which then give it. The integral is left out if `base` has none.
    """
    gains, (of_command, of_speed) = base.gains, _tables(runs, base, cuts)
    k = (of_command.shape[1] - 1) // 2
    integral, chained = gains.integral_gain_n_m_rad > 0.0, not of_speed.size
    columns = of_command[:, :-1] if integral else of_command[:, :k]
    found = _least_squares(columns, of_command[:, -1])[0]
    if chained and integral:
        found = _one_law(found, of_command)
    if chained and found[1] < 0.0:  # the feed-forward
        kept = np.arange(columns.shape[1]) % k != 1
        found[kept] = _least_squares(columns[:, kept], of_command[:, -1])[0]
        found[~kept] = 0.0
    kp, ki = float(found[k - 1]), float(found[-1]) if integral else 0.0
    scale, outer = 1.0, found[:2]
    if of_speed.size:
        outer = _least_squares(of_speed[:, :2], of_speed[:, 2])[0]
        scale, outer = float(found[0]) / kp if kp else 0.0, outer * found[0]
    if kp <= 0.0 or ki < 0.0 or outer[0] <= 0.0 or scale <= 0.0:
        return None
    learnt = gains._replace(
        position_gain_1_s=float(outer[0] / kp),
        velocity_feedforward=max(float(outer[1] / kp), 0.0),
        velocity_gain_n_m_s_rad=kp,
        integral_gain_n_m_rad=ki,
    )
    return base._replace(gains=learnt, scale=scale)


def _tables(runs: Sequence[LawRows], base: Settings, cuts: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Columns of both loops, what they give as the last: (n, 2 k + 1) of the command, (n, 3) of the speed set-point.

    The second table is empty where no speed set-point is recorded.
    """
    gains = base.gains
    of_command, of_speed = [], []
    for run, cut in zip(runs, cuts, strict=True):
        law = run.delayed(base).since(cut)
        motor = law.measured.motor_position
        step = 2 if gains.two_sample_mean else 1  # rows of a difference: the first ones have none
        keep = slice(max(law.first_evaluated - step, 0), None)
        held = np.arange(motor.size) // gains.position_ticks * gains.position_ticks
        inputs = np.stack([law.position_command_m - law.feedback_m(gains), law.velocity_command_m_s], axis=1)[held]
        if law.speed_set_point.size:
            of_speed.append(np.column_stack([inputs, law.speed_set_point])[step:][keep])
            inputs = law.speed_set_point[:, None]
        speed = (motor[step:] - motor[:-step]) / (step * gains.period_s)
        x = np.column_stack([inputs[step:] / gains.ratio_m_rad, -speed])
        both = np.column_stack([x, np.cumsum(x, axis=0) * gains.period_s, law.measured.torque_command[step:]])
        of_command.append(high_pass(both, gains.period_s)[keep])
    return np.concatenate(of_command), np.concatenate(of_speed) if of_speed else np.empty((0, 3))


def _left(runs: Sequence[LawRows], base: Settings, cuts: Sequence[int]) -> float:
    """Share of command and speed set-point (rms) that the columns of both loops leave with the delays of `base`."""
    of_command, of_speed = _tables(runs, base, cuts)
    last = -1 if base.gains.integral_gain_n_m_rad > 0.0 else (of_command.shape[1] - 1) // 2
    left = _share_left(of_command[:, :last], of_command[:, -1])
    return float(np.hypot(left, _share_left(of_speed[:, :2], of_speed[:, 2]))) if of_speed.size else left


def _one_law(found: FloatArray, table: FloatArray) -> FloatArray:
    """Coefficients (6,) of one law, from those of a free fit of the columns of `table`, of which the last is T.

    They are Kp (Kv, ff, 1) and Ki (Kv, ff, 1), four values. A free fit does not tell all six: e / r is the integral of
    v_c / r - v, but for ticks at which the position loop does not run. Without the last column they are Kp Kv + Ki,
    Kp ff, Kp, Ki Kv, Ki (ff - 1). The first and fourth give two values of Ki, between which only a feed-forward other
    than 1 decides: P (s + Kv)(s + Ki / Kp) / s is symmetric. If both leave the same, that of the faster velocity loop
    is taken.
    """
    small = np.asarray(np.linalg.qr(table, mode="r"), dtype=np.float64)
    both, forward, kp, product_, _ = _least_squares(small[:, :5], small[:, -1])[0]
    if kp <= 0.0 or forward <= 0.0 or both <= 0.0:
        return found
    half, away = 0.5 * both, np.sqrt(max(0.25 * both**2 - product_ * kp, 0.0))

    def coefficients(law: FloatArray) -> FloatArray:
        outer = law[0] * np.array([law[1], law[2], 1.0])
        return np.concatenate([outer, law[3] * outer])

    def rest(law: FloatArray) -> FloatArray:
        return np.asarray(small[:, -1] - small[:, :-1] @ coefficients(law))

    starts = [np.array([kp, (both - ki) / kp, forward / kp, ki / kp]) for ki in (half + away, half - away)]
    faster, slower = (least_squares(rest, start, method="lm", x_scale="jac") for start in starts)
    return coefficients((slower if slower.cost < (1.0 - _SAME) * faster.cost else faster).x)


def _least_squares(columns: FloatArray, values: FloatArray) -> tuple[FloatArray, float]:
    found = np.linalg.lstsq(columns, values, rcond=None)[0]
    rest, size = values - columns @ found, float(values @ values)
    return np.asarray(found, dtype=np.float64), float(np.sqrt(rest @ rest / size)) if size else 1.0


def _share_left(columns: FloatArray, values: FloatArray) -> float:
    """Share of values (n,) (rms) that columns (n, k) leave."""
    size = float(np.linalg.norm(values))
    # the last diagonal entry is the distance of the last column from the others
    small = np.asarray(np.linalg.qr(np.column_stack([columns, values]), mode="r"), dtype=np.float64)
    return abs(float(small[-1, -1])) / size if size else 1.0


def first_tick(run: LawRows, start: Settings) -> int:
    """First row of the position loop: that at which a closed form leaves least."""
    return min(range(start.gains.position_ticks), key=lambda cut: _left([run], start, [cut]))


def find_delays(run: LawRows, base: Settings) -> tuple[float, float]:
    """Delays of set-points and feedback [rows] at which a closed form leaves least.

    The misfit has several minima over the delay of the set-points, and one valley near the least of them.
    """
    short = run.since(max(run.first_evaluated - _BEFORE, 0)).until(_SCANNED)

    def left(late: float, old: float, cut: int) -> float:
        return _left([short], base._replace(setpoint_rows=late, feedback_rows=old), [cut])

    cuts = range(base.gains.position_ticks)
    each = np.arange(-SETPOINT_ROWS, SETPOINT_ROWS + 1.0)
    grid = product(each[(np.abs(each) <= _EACH) | (each % 2.0 == 0.0)], cuts)
    late, cut = min(grid, key=lambda one: left(one[0], 0.0, one[1]))

    def of_both(delays: FloatArray) -> float:
        return left(float(delays[0]), abs(float(delays[1])), cut)

    simplex = np.array([[late, 0.0], [late + 1.0, 1.0], [late, 1.0]])
    found = minimize(of_both, simplex[0], method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 80}).x
    return float(np.clip(found[0], -SETPOINT_ROWS, SETPOINT_ROWS)), float(min(abs(found[1]), FEEDBACK_ROWS))
