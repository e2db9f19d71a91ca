"""Settings of the control law from a recording: the law is replayed on measured inputs and compared with the command.

    min over settings, p of  sum ((T_command - law(set-points, positions; settings, p)) / noise)^2

Settings are gains and delays; where the speed set-point is recorded, each loop has its own sum (`law_replay`). p are
parameters of mechanisms that change what the controller reads, such as a filter of the velocity. Only the controller is
simulated: nothing is assumed of the plant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.control.cascade import Gains
from hil.identification.inference import correlation_time
from hil.identification.law.closed_form import FEEDBACK_ROWS, SETPOINT_ROWS, closed_form, find_delays, first_tick
from hil.identification.law.replay import LawRows, Parts, Settings, residuals, to_explain
from hil.identification.law.result import LawErrors, LawFit
from hil.identification.measured import Measured
from hil.identification.terms import Term
from hil.twin.axis import Twin
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage
from hil.twin.physics import Active
from hil.twin.stepping.loops import INTEGRATOR_S

_FARTHEST = 20.0  # factor of a gain over that of the bench: beyond, another unit is meant
_MOST_FEEDFORWARD = 3.0  # of the set velocity; 1 is exact
_STEP = 1e-6  # of logarithms of gains, and of delays in rows, for derivatives
_AT_BOUND = 1e-3  # distance to a bound, which the fit keeps from reaching it
_STEPS = 40  # of a fit with up to nine parameters, nearly linear in the logarithms of the gains


@dataclass(frozen=True, eq=False)
class _Law:
    """The law of settings with free gains, delays and terms: y -> settings, values of the terms."""

    base: Settings
    terms: tuple[Term, ...]
    gains: bool
    delays: int  # that are free: 0, 1 of the set-points, 2 and of the feedback
    scaled: bool  # a speed set-point of unknown scale is recorded

    def values(self, y: FloatArray) -> tuple[Settings, tuple[Term, ...]]:
        """Settings and terms of y (p,)."""
        settings = self.base
        if self.gains:
            gains, (kv, kp, ki) = settings.gains, np.exp(y[[0, 2, 3]]).tolist()
            gains = gains._replace(
                position_gain_1_s=gains.position_gain_1_s * kv,
                velocity_feedforward=float(y[1]),
                velocity_gain_n_m_s_rad=gains.velocity_gain_n_m_s_rad * kp,
                integral_gain_n_m_rad=gains.integral_gain_n_m_rad * ki,
            )
            settings, y = settings._replace(gains=gains), y[4:]
        if self.delays:
            rows = dict(zip(("setpoint_rows", "feedback_rows"), y[: self.delays].tolist(), strict=False))
            settings, y = settings._replace(**rows), y[self.delays :]
        if self.scaled:
            settings, y = settings._replace(scale=settings.scale * float(np.exp(y[0]))), y[1:]
        scaled = zip(self.terms, np.split(y, len(self.terms)) if self.terms else (), strict=True)
        return settings, tuple(replace(t, values=tuple(np.multiply(t.values, s).tolist())) for t, s in scaled)

    def at(self, settings: Settings) -> FloatArray:
        """y (p,) of settings, the terms at their start."""
        gains, base, y = settings.gains, self.base.gains, list[float]()
        if self.gains:
            ki = gains.integral_gain_n_m_rad / base.integral_gain_n_m_rad if base.integral_gain_n_m_rad else 1.0
            y += [
                np.log(gains.position_gain_1_s / base.position_gain_1_s),
                gains.velocity_feedforward,
                np.log(gains.velocity_gain_n_m_s_rad / base.velocity_gain_n_m_s_rad),
                np.log(max(ki, 1e-9)),
            ]
        y += [settings.setpoint_rows, settings.feedback_rows][: self.delays]
        y += [np.log(settings.scale / self.base.scale)] if self.scaled else []
        return np.array([*y, *(1.0 for term in self.terms for _ in term.values)])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        most = np.log(_FARTHEST)
        bounds = [(-most, most), (0.0, _MOST_FEEDFORWARD), (-most, most), (-most, most)] if self.gains else []
        bounds += [(-SETPOINT_ROWS, SETPOINT_ROWS), (0.0, FEEDBACK_ROWS)][: self.delays]
        bounds += [(-most, most)] if self.scaled else []
        for term in self.terms:
            for parameter, value in zip(BY_ID[term.effect].parameters, term.values, strict=True):
                # older positions are a delay of the loop
                causal = BY_ID[term.effect].variants[term.variant].stage is Stage.CHANNEL
                bounds.append(((max(parameter.low, 0.0) if causal else parameter.low) / value, parameter.high / value))
        low, high = np.array(bounds, dtype=np.float64).reshape(-1, 2).T
        return low, high

    @property
    def count(self) -> int:
        """Number of parameters; a P velocity loop has no integral gain."""
        kept = self.gains and self.base.gains.integral_gain_n_m_rad == 0.0
        return self.at(self.base).size - (1 if kept else 0)

    def errors(self, y: FloatArray) -> LawErrors:
        """Standard errors from those of y (p,)."""
        of_gains, rest = (y[:4], y[4:]) if self.gains else (np.zeros(4), y)
        return LawErrors(*(float(one) for one in (*of_gains, *rest[: self.delays])))


def counting_noise(run: Measured, gains: Gains) -> float:
    """Standard deviation of the command that noise of the recorded positions makes in a replay [command unit].

    The loop may have seen finer positions: its velocity is a difference of two samples, its position error one.
    """
    span_s = gains.period_s * (2.0 if gains.two_sample_mean else 1.0)
    of_velocity = 2.0**0.5 * run.noise.motor / span_s
    table_m = run.noise.table_m if gains.position_from_table else gains.ratio_m_rad * run.noise.motor
    of_position = gains.position_gain_1_s * table_m / gains.ratio_m_rad
    return float(gains.velocity_gain_n_m_s_rad * np.hypot(of_velocity, of_position))


def fit_law(
    runs: Sequence[Measured],
    bench: Bench,
    terms: Sequence[Term] = (),
    *,
    free: bool = True,
    delays: int = 0,
    by_loop: bool = False,
) -> LawFit:
    """Fit the gains of a bench (if `free`), `delays` (1: of the set-points, 2: and of the feedback) and the values of
    `terms` to the commands of recordings.

    `by_loop`: each loop on its own, from the recorded speed set-point. Without anything to fit the law is evaluated.
    """
    rows = [_law_rows(run, by_loop) for run in runs]
    peak = max(float(np.max(np.abs(run.torque_command))) for run in runs)
    gains = bench.gains
    if free and peak < gains.torque_limit_n_m:  # it never acted; gains that are far off would make it act
        gains = gains._replace(torque_limit_n_m=np.inf)
    base = Settings(gains, scale=_scale(rows, gains))
    fit = fit_settings(rows, base, bench.twin(), terms, free=free, delays=delays)
    kept = fit.gains._replace(torque_limit_n_m=bench.gains.torque_limit_n_m)
    return replace(fit, settings=fit.settings._replace(gains=kept))


def _law_rows(run: Measured, by_loop: bool) -> LawRows:
    return LawRows(
        run.position_command_m,
        run.velocity_command_m_s,
        run.response._replace(torque_command=run.own_command),
        run.speed_set_point if by_loop else np.empty(0),
        run.start,
        run.evaluated.start,
        run.noise.torque,
    )


def command_left(run: Measured, bench: Bench, settings: Settings) -> FloatArray:
    """Recorded command less that of a law (n,) [command unit], 0 at first if it has an integrator.

    The integrator of a replay follows the recording, so that a step of the command is forgotten; here it stays one.
    """
    rows = replace(_law_rows(run, False), first_evaluated=0)
    left = residuals(rows, settings, bench.twin(), 0, 1.0).command * rows.noise
    return np.asarray(left + settings.gains.period_s / INTEGRATOR_S * (np.cumsum(left) - left), dtype=np.float64)


def fit_settings(
    rows: Sequence[LawRows],
    base: Settings,
    twin: Twin,
    terms: Sequence[Term] = (),
    *,
    free: bool = True,
    delays: int = 0,
    start: Settings | None = None,
    most: int = _STEPS,
) -> LawFit:
    """Fit settings, from `base` or a closed form, and `terms`; `twin` has the known mechanisms of the axis.

    `delays`: 1 of the set-points, 2 and of the feedback.

    If gains or delays are free, the first tick of the position loop is that with which a closed form leaves least.
    Delays are looked for unless they `start` somewhere. `most`: evaluations.
    """
    law = _Law(base, tuple(terms), free, delays, all(run.speed_set_point.size > 0 for run in rows))
    if delays:
        if start is None:
            late, old = find_delays(rows[0], base)
            start = base._replace(setpoint_rows=late, feedback_rows=old if delays > 1 else 0.0)
        return _fitted(law, twin, rows, [first_tick(run, start) for run in rows], most, start)
    if not free or base.gains.position_ticks == 1:
        return _fitted(law, twin, rows, [0] * len(rows), most)
    return _fitted(law, twin, rows, [first_tick(run, base) for run in rows], most)


def _scale(rows: Sequence[LawRows], gains: Gains) -> float:
    """Scale of the recorded speed set-points from the speed of the motor; 1 without them."""
    if not all(run.speed_set_point.size for run in rows):
        return 1.0
    speeds = [gains.ratio_m_rad * np.gradient(run.measured.motor_position) / gains.period_s for run in rows]
    both = sum(float(run.speed_set_point @ speed) for run, speed in zip(rows, speeds, strict=True))
    own = sum(float(run.speed_set_point @ run.speed_set_point) for run in rows)
    return both / own if both > 0.0 else 1.0


def _fitted(
    law: _Law, twin: Twin, runs: Sequence[LawRows], cuts: Sequence[int], most: int, start: Settings | None = None
) -> LawFit:
    def parts(y: FloatArray, weight: float | None = None) -> tuple[Parts, ...]:
        settings, terms = law.values(y)
        added = tuple(Active(term.effect, term.values, term.variant) for term in terms)
        moved = replace(twin, gains=settings.gains, active=(*twin.active, *added))
        weight = weight or law.base.gains.velocity_gain_n_m_s_rad
        return tuple(residuals(run, settings, moved, cut, weight) for run, cut in zip(runs, cuts, strict=True))

    def stacked(y: FloatArray) -> FloatArray:
        return np.concatenate([one for run in parts(y) for one in run])

    def jac(y: FloatArray) -> FloatArray:
        # steps of equal size: those of scipy are relative to values that may be 0
        steps = np.where(y + _STEP < law.bounds[1], _STEP, -_STEP)
        now = stacked(y)
        return np.stack(
            [(stacked(y + step * one) - now) / step for step, one in zip(steps, np.eye(y.size), strict=True)], axis=1
        )

    y, errors = law.at(law.base), LawErrors()
    if y.size:
        low, high = law.bounds
        near = law.base if start is None else start
        learnt = closed_form(runs, near, cuts) if law.gains else None
        starts = [np.clip(law.at(one), low, high) for one in (law.base, near, learnt) if one is not None]
        first = starts[0] if len(starts) == 1 else min(starts, key=lambda one: float(np.sum(stacked(one) ** 2)))
        fit = least_squares(stacked, first, jac, bounds=(low, high), x_scale="jac", max_nfev=most)
        y = fit.x
    settings, terms = law.values(y)
    weight = settings.gains.velocity_gain_n_m_s_rad
    residual_parts = parts(y, weight)
    if y.size:
        rows = sum(part.size / correlation_time(part) for run in residual_parts for part in run if part.size)
        variance = float(np.sum(fit.fun**2)) / max(rows - law.count, 1.0) * rows / fit.fun.size
        # one at its bound is kept there: near a feed-forward of 0 a delay of the set-points acts as another one
        inside = (y > low + _AT_BOUND) & (y < high - _AT_BOUND)
        variances = np.zeros(y.size)
        variances[inside] = np.diag(np.linalg.pinv(fit.jac[:, inside].T @ fit.jac[:, inside]))
        errors = law.errors(np.sqrt(variance * np.maximum(variances, 0.0)))
    asked = _rms([to_explain(run, settings.gains) for run in runs])
    left = [_rms([run[loop] for run in residual_parts]) / max(asked, 1e-150) for loop in range(2)]
    return LawFit(settings, terms, residual_parts, errors, law.count, left[0], left[1])


def _rms(parts: Sequence[FloatArray]) -> float:
    values = np.concatenate(parts)
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
