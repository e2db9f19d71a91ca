"""Gains of a cascaded control law from set-points, motion and torque command.

The law of `hil.control.cascade` with continuous position loop is linear in combinations of its gains:

    T = Kp (Kv e / r + ff v_c / r - v) + Kp / Ti (integral of the same)

Least squares gives initial values; then the law is replayed over the recording at every period of the position loop and
with both velocity estimates, and the gains of the best are refined.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from hil.arrays import FloatArray
from hil.control import cascade
from hil.drafting.estimate import fit_blocks
from hil.recording.recording import Recording

REPLAYED = 0.05  # share of the torque command that a law may leave to be written into a bench
_TICKS = (1, 2, 4, 8)  # of the velocity loop per tick of the position loop, as drives have them
_LONGEST_S = 0.1  # period of a position loop that a bench allows
_FIRST_STEPS, _LAST_STEPS = 8, 40  # of the refinement of each variant, and of the best
_ROWS = 8000  # that are replayed: seconds of motion at a usual rate
_NO_INTEGRAL = 10.0  # s: an integral time above it acts no more within a recording
_ESTIMATES = ("backward_difference", "two_sample_mean")


Start4 = tuple[float, float, float, float]  # Kv, ff, Kp, Kp / Ti


@dataclass(frozen=True)
class LoopValues:
    """The law that leaves least of the torque command; errors are those of the refined fit, 0 for kept values."""

    position_gain_1_s: float
    velocity_feedforward: float
    velocity_gain: float
    integral_time_s: float | None
    errors: tuple[float, float, float, float]
    position_ticks: int
    velocity_estimate: str
    left: float  # share of the standard deviation of the torque command
    phase: int  # first row at which the position loop runs

    @property
    def start(self) -> Start4:
        """Kv, ff, Kp, Kp / Ti."""
        integral = 0.0 if self.integral_time_s is None else self.velocity_gain / self.integral_time_s
        return self.position_gain_1_s, self.velocity_feedforward, self.velocity_gain, integral


@dataclass(frozen=True, eq=False)
class _Loop:
    """Channels (n,) of the replayed rows."""

    position: FloatArray
    velocity: FloatArray
    motor: FloatArray
    feedback: FloatArray
    command: FloatArray
    ratio: float
    period_s: float


def loop_values(recording: Recording, ratio_m_rad: float) -> LoopValues | None:
    """Fit the control law; None without set-points or torque, or where no gains are found."""
    names = recording.axis
    if not {names.position_command, names.torque_command} <= set(recording.columns):
        return None
    position = recording[names.position_command]
    velocity = recording.columns.get(names.velocity_command)
    velocity = np.gradient(position, recording.period_s) if velocity is None else velocity
    motor = recording[names.motor_position]
    moving = np.flatnonzero(np.abs(velocity) > 1e-3 * np.max(np.abs(velocity), initial=0.0))
    if not moving.size:
        return None
    rows = slice(max(int(moving[0]) - 50, 0), max(int(moving[0]) - 50, 0) + _ROWS)
    loop = _Loop(
        position[rows], velocity[rows], motor[rows], ratio_m_rad * motor[rows], recording[names.torque_command][rows],
        ratio_m_rad, recording.period_s,
    )  # fmt: skip
    variants = [
        (start, ticks, phase, estimate)
        for start in _initial(loop)
        for ticks in _TICKS
        if ticks * recording.period_s <= _LONGEST_S
        for phase in range(ticks)
        for estimate in _ESTIMATES
    ]
    # the start is too far off to tell which variant is right
    tried = [_refined(loop, *variant, most=_FIRST_STEPS) for variant in variants]
    if not tried:
        return None
    best = min(tried, key=lambda one: one.left)
    return _refined(loop, best.start, best.position_ticks, best.phase, best.velocity_estimate, most=_LAST_STEPS)


def _initial(loop: _Loop) -> list[Start4]:
    """Values of Kv, ff, Kp, Kp/Ti from least squares, of a P and of a PI velocity loop."""
    r = loop.ratio
    error, feed = (loop.position - loop.feedback) / r, loop.velocity / r
    speed = np.diff(loop.motor, prepend=loop.motor[0]) / loop.period_s
    ones = np.ones_like(error)
    found = []
    proportional = fit_blocks([error, feed, speed, ones], loop.command).estimates
    kp = -proportional[2].value
    if kp > 0.0:
        found.append((proportional[0].value / kp, max(proportional[1].value / kp, 0.0), kp, 0.0))
    summed = np.cumsum(error) * loop.period_s
    c_e, c_v, c_speed, c_sum, _, _ = (
        one.value
        for one in fit_blocks([error, feed, speed, summed, loop.motor - loop.motor[0], ones], loop.command).estimates
    )
    kp = -c_speed
    if kp > 0.0:
        feedforward = max(c_v / kp, 0.0)
        root = c_e**2 - 4.0 * kp * c_sum * feedforward
        for sign in (-1.0, 1.0):
            x = 0.5 * (c_e + sign * np.sqrt(max(root, 0.0)))
            if x > 0.0 and c_sum > 0.0:
                found.append((x / kp, feedforward, kp, kp * c_sum / x))
    return [one for one in found if one[0] > 0.0]


def _left(loop: _Loop, values: Start4, ticks: int, phase: int, estimate: str) -> FloatArray:
    """Torque command less that of the replayed law, without its mean: the state of the integrator is not known."""
    kv, feedforward, kp, integral = values
    gains = cascade.make_gains(
        position_gain_1_s=kv,
        velocity_gain_n_m_s_rad=kp,
        ratio_m_rad=loop.ratio,
        velocity_feedforward=feedforward,
        velocity_integral_time_s=kp / integral if integral > 0.0 else None,
        velocity_period_s=loop.period_s,
        position_period_s=ticks * loop.period_s,
        two_sample_mean=estimate == "two_sample_mean",
    )
    rows = slice(phase, None)
    motor = loop.motor[rows]
    state = cascade.init(motor[0], 0.0, 0.0, gains.period_s)
    replayed, _ = cascade.replay(gains, state, loop.position[rows], loop.velocity[rows], motor, loop.feedback[rows])
    left = (loop.command[rows] - replayed)[10:]
    return np.asarray(left - left.mean())


def _refined(loop: _Loop, start: Start4, ticks: int, phase: int, estimate: str, most: int) -> LoopValues:
    scale = np.array([max(abs(one), 1e-6) for one in start])
    scale[1] = max(scale[1], 0.1)

    def misfit(x: FloatArray) -> FloatArray:
        kv, feedforward, kp, integral = (float(one) for one in np.maximum(x, 0.0) * scale)
        return _left(loop, (max(kv, 1e-9), feedforward, max(kp, 1e-12), integral), ticks, phase, estimate)

    x0 = np.array(start) / scale
    free = np.array([True, True, True, start[3] > 0.0])

    def of_free(y: FloatArray) -> FloatArray:
        x = x0.copy()
        x[free] = y
        return misfit(x)

    fit = least_squares(of_free, x0[free], max_nfev=most)
    values = x0.copy()
    values[free] = np.maximum(fit.x, 0.0)
    values *= scale
    errors = np.zeros(4)
    residual = of_free(fit.x)
    # least squares over rows that depend on each other: as many independent ones as blocks of ten
    variance = float(residual @ residual) / max(residual.size - 4, 1) * 10.0
    inverse = np.linalg.pinv(fit.jac.T @ fit.jac)
    errors[free] = np.sqrt(variance * np.diag(inverse)) * scale[free]
    kv, feedforward, kp, integral = (float(one) for one in values)
    time_s = kp / integral if integral > 0.0 and kp > 0.0 else None
    if time_s is not None and time_s > _NO_INTEGRAL:
        time_s = None
    error_time = 0.0 if time_s is None else float(time_s * np.hypot(errors[3] / integral, errors[2] / max(kp, 1e-300)))
    error_kv, error_feedforward, error_kp, _ = (float(one) for one in errors)
    return LoopValues(
        kv, feedforward, kp, time_s, (error_kv, error_feedforward, error_kp, error_time), ticks, estimate,
        float(np.std(residual) / np.std(loop.command)), phase,
    )  # fmt: skip
