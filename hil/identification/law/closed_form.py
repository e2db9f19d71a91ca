"""Gains, first tick and delays of a control law from least squares of recorded rows, without a replay."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.optimize import least_squares, minimize

from hil.arrays import FloatArray
from hil.identification.law.replay import LawRows, Settings, high_pass

# Largest delays in rows: buffer and look-ahead of a logger; bus and drive.
SETPOINT_ROWS, FEEDBACK_ROWS = 40.0, 12.0
_SCANNED = 6000  # rows in which delays are looked for: seconds of motion at a usual rate
_EACH = 8.0  # rows: delays that are tried one by one, longer ones by two
_BEFORE = 50  # rows before the first evaluated one
_SAME = 0.01  # relative difference of the squares that two solutions leave, up to which they count as equal


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
    coefficients = _least_squares(columns, of_command[:, -1])
    if chained and integral:
        coefficients = _one_law(coefficients, of_command)
    if chained and coefficients[1] < 0.0:  # the feed-forward
        kept = np.arange(columns.shape[1]) % k != 1
        coefficients[kept] = _least_squares(columns[:, kept], of_command[:, -1])
        coefficients[~kept] = 0.0
    kp, ki = float(coefficients[k - 1]), float(coefficients[-1]) if integral else 0.0
    scale, outer = 1.0, coefficients[:2]
    if of_speed.size:
        outer = _least_squares(of_speed[:, :2], of_speed[:, 2])
        scale, outer = float(coefficients[0]) / kp if kp else 0.0, outer * coefficients[0]
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
        law = run.delayed(base).part(slice(cut, None))
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


def _one_law(free: FloatArray, table: FloatArray) -> FloatArray:
    """Coefficients (6,) of one law, from those of a free fit of the columns of `table`, of which the last is T.

    They are Kp (Kv, ff, 1) and Ki (Kv, ff, 1), four values. A free fit does not tell all six: e / r is the integral of
    v_c / r - v, but for ticks at which the position loop does not run. Without the last column they are Kp Kv + Ki,
    Kp ff, Kp, Ki Kv, Ki (ff - 1). The first and fourth give two values of Ki, between which only a feed-forward other
    than 1 decides: P (s + Kv)(s + Ki / Kp) / s is symmetric. If both leave the same, that of the faster velocity loop
    is taken.
    """
    small = np.asarray(np.linalg.qr(table, mode="r"), dtype=np.float64)
    both, forward, kp, product_, _ = _least_squares(small[:, :5], small[:, -1])
    if kp <= 0.0 or forward <= 0.0 or both <= 0.0:
        return free
    half, away = 0.5 * both, np.sqrt(max(0.25 * both**2 - product_ * kp, 0.0))

    def coefficients(law: FloatArray) -> FloatArray:
        outer = law[0] * np.array([law[1], law[2], 1.0])
        return np.concatenate([outer, law[3] * outer])

    def rest(law: FloatArray) -> FloatArray:
        return np.asarray(small[:, -1] - small[:, :-1] @ coefficients(law))

    starts = [np.array([kp, (both - ki) / kp, forward / kp, ki / kp]) for ki in (half + away, half - away)]
    faster, slower = (least_squares(rest, start, method="lm", x_scale="jac") for start in starts)
    return coefficients((slower if slower.cost < (1.0 - _SAME) * faster.cost else faster).x)


def _least_squares(columns: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(columns, values, rcond=None)[0], dtype=np.float64)


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
    first = max(run.first_evaluated - _BEFORE, 0)
    short = run.part(slice(first, first + _SCANNED))

    def left(late: float, old: float, cut: int) -> float:
        return _left([short], base._replace(setpoint_rows=late, feedback_rows=old), [cut])

    cuts = range(base.gains.position_ticks)
    each = np.arange(-SETPOINT_ROWS, SETPOINT_ROWS + 1.0)
    grid = product(each[(np.abs(each) <= _EACH) | (each % 2.0 == 0.0)], cuts)
    late, cut = min(grid, key=lambda one: left(one[0], 0.0, one[1]))

    def of_both(delays: FloatArray) -> float:
        return left(float(delays[0]), abs(float(delays[1])), cut)

    simplex = np.array([[late, 0.0], [late + 1.0, 1.0], [late, 1.0]])
    best = minimize(of_both, simplex[0], method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 80}).x
    return float(np.clip(best[0], -SETPOINT_ROWS, SETPOINT_ROWS)), float(min(abs(best[1]), FEEDBACK_ROWS))
