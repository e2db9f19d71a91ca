"""Gains of the control law from a recording: the law is replayed on measured inputs and compared with the command.

    min over gains, p of  sum ((T_command - law(set-points, positions; gains, p)) / noise)^2

p are parameters of mechanisms that change what the controller reads, such as a filter of the velocity. The integrator
follows the recorded command (`hil.twin.stepping.loops.replay_law`), so offsets and slow rounding do not count. Only the
controller is simulated: nothing is assumed of the plant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.control.cascade import Gains
from hil.identification.inference import correlation_time
from hil.identification.measured import Measured
from hil.identification.terms import Term
from hil.twin.axis import Response, Twin
from hil.twin.library import BY_ID
from hil.twin.physics import Active
from hil.twin.stepping.loops import INTEGRATOR_S

_FARTHEST = 20.0  # factor of a gain over that of the bench: beyond, another unit is meant
_MOST_FEEDFORWARD = 3.0  # of the set velocity; 1 is exact
_STEPS = 40  # of a fit with up to six parameters, nearly linear in the logarithms of the gains


@dataclass(frozen=True, eq=False)
class LawFit:
    """A control law on recordings.

    `parts` are the command less that of the law, in units of its noise, over the judged rows of each run; `errors` the
    standard errors of position gain, feed-forward, velocity gain and integral gain, relative but for the feed-forward;
    0 for gains that were kept.
    """

    gains: Gains
    terms: tuple[Term, ...]
    parts: tuple[FloatArray, ...]
    errors: tuple[float, float, float, float]
    free: int  # number of parameters fitted
    left: float  # rms of the rest over that of the command about its mean

    @cached_property
    def ratio(self) -> float:
        """Largest mean square over noise of all runs."""
        return max(float(part @ part) / part.size for part in self.parts)

    @cached_property
    def cost(self) -> float:
        """Sum of squares over noise of all runs."""
        return sum(float(part @ part) for part in self.parts)

    @cached_property
    def independent_rows(self) -> float:
        """Number of rows over the correlation time of the residual."""
        return sum(part.size / correlation_time(part) for part in self.parts)

    def bic(self, rows: float) -> float:
        """Bayesian information criterion with so many independent `rows`, the noise estimated (Schwarz 1978)."""
        return float(rows * np.log(max(self.cost, 1e-12)) + self.free * np.log(rows))


@dataclass(frozen=True, eq=False)
class _Law:
    """The law of a bench with free gains and terms: y -> gains, values of the terms."""

    bench: Bench
    terms: tuple[Term, ...]
    free: bool

    def values(self, y: FloatArray) -> tuple[Gains, tuple[Term, ...]]:
        """Gains and terms of y (p,)."""
        gains, scales = self.bench.gains, y
        if self.free:
            kv, feedforward, kp, ki = np.exp(y[0]), y[1], np.exp(y[2]), np.exp(y[3])
            gains = gains._replace(
                position_gain_1_s=gains.position_gain_1_s * kv,
                velocity_feedforward=float(feedforward),
                velocity_gain_n_m_s_rad=gains.velocity_gain_n_m_s_rad * kp,
                integral_gain_n_m_rad=gains.integral_gain_n_m_rad * ki,
            )
            scales = y[4:]
        scaled = zip(self.terms, np.split(scales, len(self.terms)) if self.terms else (), strict=True)
        return gains, tuple(replace(t, values=tuple(np.multiply(t.values, s).tolist())) for t, s in scaled)

    @property
    def start(self) -> FloatArray:
        gains = [0.0, self.bench.gains.velocity_feedforward, 0.0, 0.0] if self.free else []
        return np.array([*gains, *(1.0 for term in self.terms for _ in term.values)])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        most = np.log(_FARTHEST)
        low, high = ([-most, 0.0, -most, -most], [most, _MOST_FEEDFORWARD, most, most]) if self.free else ([], [])
        for term in self.terms:
            for parameter, value in zip(BY_ID[term.effect].parameters, term.values, strict=True):
                low.append(parameter.low / value)
                high.append(parameter.high / value)
        return np.array(low), np.array(high)

    @property
    def count(self) -> int:
        """Number of parameters; a P velocity loop has no integral gain."""
        return self.start.size - (1 if self.free and self.bench.gains.integral_gain_n_m_rad == 0.0 else 0)


def counting_noise(run: Measured, gains: Gains) -> float:
    """Standard deviation of the command that noise of the recorded positions makes in a replay [command unit].

    The loop may have seen finer positions: its velocity is a difference of two samples, its position error one.
    """
    span_s = gains.period_s * (2.0 if gains.two_sample_mean else 1.0)
    of_velocity = 2.0**0.5 * run.noise.motor / span_s
    table_m = run.noise.table_m if gains.position_from_table else gains.ratio_m_rad * run.noise.motor
    of_position = gains.position_gain_1_s * table_m / gains.ratio_m_rad
    return float(gains.velocity_gain_n_m_s_rad * np.hypot(of_velocity, of_position))


def fit_law(runs: Sequence[Measured], bench: Bench, terms: Sequence[Term] = (), *, free: bool = True) -> LawFit:
    """Fit the gains of a bench (if `free`) and the values of `terms` to the commands of recordings.

    Every tick of the position loop is tried as the first one. Without anything to fit the law is evaluated.
    """
    law = _Law(bench, tuple(terms), free)
    peak = max(float(np.max(np.abs(run.torque_command))) for run in runs)
    gains = bench.gains
    if free and peak < gains.torque_limit_n_m:  # it never acted; gains that are far off would make it act
        gains = gains._replace(torque_limit_n_m=np.inf)
    twin = Twin(bench.axis.physics(), gains)
    if not free or gains.position_ticks == 1:
        return _fitted(law, twin, runs, [0] * len(runs))
    cuts = range(gains.position_ticks)
    found = [min(cuts, key=lambda cut, run=run: _fitted(law, twin, [run], [cut]).ratio) for run in runs]  # type: ignore[misc]
    return _fitted(law, twin, runs, found)


def _fitted(law: _Law, twin: Twin, runs: Sequence[Measured], cuts: Sequence[int]) -> LawFit:
    def parts(y: FloatArray) -> tuple[FloatArray, ...]:
        gains, terms = law.values(y)
        added = tuple(Active(term.effect, term.values, term.variant) for term in terms)
        active = (*(entry.active() for entry in law.bench.mechanisms), *added)
        moved = replace(twin, gains=gains._replace(torque_limit_n_m=twin.gains.torque_limit_n_m), active=active)
        return tuple(_residual(moved, run, cut) for run, cut in zip(runs, cuts, strict=True))

    y, errors = law.start, np.zeros(law.start.size)
    if y.size:
        low, high = law.bounds
        starts = [np.clip(one, low, high) for one in ([y, _closed_form(law, runs, cuts)] if law.free else [y])]
        first = min(starts, key=lambda one: sum(float(part @ part) for part in parts(one)))
        fit = least_squares(lambda y: np.concatenate(parts(y)), first, bounds=(low, high), max_nfev=_STEPS)
        y = fit.x
    found = parts(y)
    gains, terms = law.values(y)
    if y.size:
        rows = sum(part.size / correlation_time(part) for part in found)
        variance = float(np.sum(fit.fun**2)) / max(rows - law.count, 1.0) * rows / fit.fun.size
        errors = np.sqrt(variance * np.maximum(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)), 0.0))
    of_gains = tuple(float(one) for one in errors[:4]) if law.free else (0.0, 0.0, 0.0, 0.0)
    commands = np.concatenate(
        [run.torque_command[run.judged] - np.mean(run.torque_command[run.judged]) for run in runs]
    )
    noise = np.concatenate([part * run.noise.torque for part, run in zip(found, runs, strict=True)])
    left = float(np.sqrt(np.mean(noise**2) / max(np.mean(commands**2), 1e-300)))
    return LawFit(gains, terms, found, of_gains, law.count, left)  # type: ignore[arg-type]


def _closed_form(law: _Law, runs: Sequence[Measured], cuts: Sequence[int]) -> FloatArray:
    """First gains from linear least squares, the terms at their start.

    T = Kp x + Ki integral(x) with x = Kv e / r + ff v_c / r - v is linear in Kp Kv, Kp ff, Kp and Ki Kv, Ki ff, Ki; all
    pass the high-pass of an integrator that follows the command. The start is that of the bench if a gain is negative.
    """
    gains = law.bench.gains
    keep = np.exp(-gains.period_s / INTEGRATOR_S)
    columns, commands = [], []
    for run, cut in zip(runs, cuts, strict=True):
        rows = slice(cut, None)
        feedback = run.table_m if gains.position_from_table and run.table_m.size else gains.ratio_m_rad * run.motor
        held = np.arange(run.motor[rows].size) // gains.position_ticks * gains.position_ticks
        error, feed = (run.position_command_m - feedback)[rows][held], run.velocity_command_m_s[rows][held]
        speed = np.diff(run.motor, prepend=run.motor[0])[rows] / gains.period_s
        x = np.stack([error / gains.ratio_m_rad, feed / gains.ratio_m_rad, -speed], axis=1)
        both = np.hstack([x, np.cumsum(x, axis=0) * gains.period_s])
        columns.append(lfilter([1.0, -1.0], [1.0, -keep], both, axis=0)[run.judged.start :])
        commands.append(lfilter([1.0, -1.0], [1.0, -keep], run.torque_command[rows])[run.judged.start :])
    regressors = np.concatenate(columns)
    if gains.integral_gain_n_m_rad == 0.0:
        regressors[:, 3:] = 0.0
    a, b, kp, _, _, ki = np.linalg.lstsq(regressors, np.concatenate(commands), rcond=None)[0]
    ki = ki if gains.integral_gain_n_m_rad > 0.0 else 1.0
    if min(a, kp, ki) <= 0.0:
        return law.start
    ratios = np.log([a / kp / gains.position_gain_1_s, kp / gains.velocity_gain_n_m_s_rad])
    integral = np.log(ki / gains.integral_gain_n_m_rad) if gains.integral_gain_n_m_rad > 0.0 else 0.0
    return np.concatenate([[ratios[0], max(b / kp, 0.0), ratios[1], integral], law.start[4:]])


def _residual(twin: Twin, run: Measured, cut: int) -> FloatArray:
    """Command less that of the law, over the noise, at the judged rows (n,) of a run without its first `cut` rows."""
    rows = slice(cut, None)
    measured = twin.undelayed(run.response)
    measured = Response(*(values[rows] for values in measured))
    speed_m_s = float(twin.gains.ratio_m_rad * (run.motor[cut] - run.motor[cut - 1]) / run.period_s) if cut else None
    start = run.start._replace(
        position_m=float(twin.gains.ratio_m_rad * run.motor[cut]),
        velocity_m_s=run.start.velocity_m_s if speed_m_s is None else speed_m_s,
        torque=0.0,
    )
    commands = run.position_command_m[rows], run.velocity_command_m_s[rows]
    if twin.gains.integral_gain_n_m_rad > 0.0:  # at first, the integrator holds what the proportional part does not
        proportional = twin.command(commands[0][:1], commands[1][:1], Response(*(one[:1] for one in measured)), start)
        start = start._replace(torque=float(measured.torque_command[0] - proportional[0]))
    wanted = twin.command(*commands, measured, start)
    judged = slice(max(run.judged.start - cut, 0), None)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.nan_to_num((measured.torque_command - wanted)[judged] / run.noise.torque, posinf=1e6, neginf=-1e6)
