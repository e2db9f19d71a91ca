"""The plain model of an axis: its torque by linear least squares over its measured motion alone.

    T = J a + D v + Fc sign(v) + T0   (+ k q)   (+ S sin(r q) + C cos(r q))

J inertia, D viscous friction, Fc Coulomb friction, T0 offset, k spring, S and C gravity over the angle r q of a load
that turns; motor units (kg m^2, N m s/rad, N m, N m, N m/rad, N m, or kg, N s/m, N, N, N/m). Without a twin, a control
law or a bench it tells values with standard errors, at any rate of rows: fitted are the rows about which the axis
slides one way throughout the window of their derivatives, so that the sign of the velocity is known in each.

A term is kept where the rows earn it. Beside a coefficient b +- s the Bayesian information criterion
n log(R0 / R1) - log n is about (b / s)^2 - log n for n independent samples and residual sums R. Three standard errors
are evidence below n = 8000, 9 = log n; s is that of the jackknife, which counts correlation, so that n is that of its
blocks. The blocks that are left out in turn must be predicted better too. Beside a term in question friction may bend
at low and at high speed: what a bend explains as well is no spring, and no delay. Where a bend is earned itself, errors
count what it changes: values of a law that bends depend on the speeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.special import ndtri, stdtrit

from hil.arrays import FloatArray
from hil.identification.derivatives import (
    MeasuredMotion,
    later_motion,
    matched,
    matched_motion,
    noise_gains,
    window_rows,
)
from hil.identification.least_squares import SIGMAS, Columns, Estimate, LinearFit, least_squares
from hil.identification.parallel import one_blas_thread
from hil.identification.torque_lag import shift_of_torque
from hil.identification.windows import LONGEST_S, NOISE_SHARE, position_noise, quiet_window

MOTION = ("inertia", "viscous", "coulomb", "offset")  # names of the coefficients without a torque over the position
LEAST_ANGLE_RAD = 0.5  # of the load: over less, a sine is a straight line to 1 %, and gravity is a spring
_SLIDING = 0.02  # of the top speed: below, an axis may stick, and its motion does not tell its friction
_OTHER_WAY = 2.0  # independent samples that tell the friction of slow motion the other way
_FEWEST = len(MOTION) + 2  # independent samples: two more than coefficients
_LAW = ("slow", "fast")  # coefficients of a friction that bends at low and at high speed
_BEND = 0.1  # of the top speed: range of speed in which a friction that falls from rest is felt
_FARTHEST_ROWS, _FARTHEST_S = 8, 0.04  # lateness of a torque that is sought; the larger of both
_KEPT = 0.5  # of the sliding rows, at least: others tell the accelerations
_LESS = 0.5  # of the torque that a window of half the rows leaves: white noise of the torque falls to 0.7
_LOGGED = "logged"  # coefficient of the time of the torque's rows against those of the position


def plain_columns(moved: MeasuredMotion, load_ratio: float | None = None, spring: bool = False) -> Columns:
    """Regressors (n,) of a motion; with `load_ratio` [load rad per motor rad] those of gravity."""
    columns = {
        "inertia": moved.acceleration,
        "viscous": moved.velocity,
        "coulomb": moved.direction,
        "offset": np.ones_like(moved.velocity),
    }
    if spring:
        columns["spring"] = moved.position
    if load_ratio is not None:
        angle = load_ratio * moved.position
        columns |= {"sine": np.sin(angle), "cosine": np.cos(angle)}
    return columns


class SlowestSliding(NamedTuple):
    """Least speeds of rows that count as sliding, away from home and back [motor units/s]."""

    away: float
    back: float


@dataclass(frozen=True, eq=False)
class MotionData:
    """Motion of a recording, its torque (n,) smoothed alike, the rows (n,) that are evaluated, and the window in rows.

    `noise` is that of the position.
    """

    moved: MeasuredMotion
    torque: FloatArray
    rows: NDArray[np.bool_]
    period_s: float
    window: int
    noise: float = 0.0

    def sliding(self, slowest: SlowestSliding, more: int = 0) -> NDArray[np.bool_]:
        """Evaluated rows (n,) about which the axis moves one way, faster than `slowest`, throughout the window.

        A row more on both sides is what a logger's row may hold: a mean until the next one, or the value before. So are
        `more` rows for a torque that is recorded late.
        """
        width = self.window + 2 + 2 * more
        low, high = (extreme(self.moved.velocity, width) for extreme in (minimum_filter1d, maximum_filter1d))
        return np.asarray(self.rows & ((low > slowest.away) | (high < -slowest.back)))


def motion_data(position: FloatArray, torque: FloatArray, period_s: float, judged: slice = slice(None)) -> MotionData:
    """Data of motor position and torque (n,), of the rows `judged` without half a window at both ends."""
    noise, rms = position_noise(position)
    window = _quiet_beside(torque, position, period_s, quiet_window(position, rms, period_s))
    rows, half = np.zeros(position.size, dtype=bool), window // 2 + 1
    rows[judged] = True
    rows[:half] = rows[-half:] = False
    return MotionData(
        matched_motion(position, period_s, window), matched(torque, window), rows, period_s, window, noise
    )


def _quiet_beside(torque: FloatArray, position: FloatArray, period_s: float, window: int) -> int:
    """Rows of the window, `window` or longer, in which the acceleration has little that the torque has not.

    Noise that is not white, as that of uneven stamps, leaves more of it than white noise does. It is what the next
    window takes from the acceleration and not from the torque, and the model then leaves less of the torque.
    """

    def fitted(rows: int) -> tuple[FloatArray, FloatArray, float, float]:
        moved = matched_motion(position, period_s, rows)
        table = np.column_stack([one[longest:-longest] for one in plain_columns(moved).values()])
        wanted = matched(torque, rows)[longest:-longest]
        values = np.linalg.lstsq(table, wanted, rcond=None)[0]
        return table[:, 0], wanted, float(values[0]), float(np.std(wanted - table @ values))

    longest = min(position.size // 4, round(LONGEST_S / period_s))
    own = fitted(window) if 2 * window - 1 <= longest else None
    while own and 2 * window - 1 <= longest:
        longer = fitted(2 * window - 1)
        bend, effort = longer[2] * (own[0] - longer[0]), own[1] - longer[1]
        noise = float(np.var(bend)) - float(np.cov(bend, effort)[0, 1])
        if noise <= NOISE_SHARE * float(np.var(longer[2] * own[0])) or longer[3] > _LESS * own[3]:
            break
        own, window = longer, 2 * window - 1
    return window


@dataclass(frozen=True, eq=False)
class PlainModel:
    """Fit of the plain model, the least speeds of the rows that were fitted, and the ratio of a load that turns.

    `early_rows`: rows by which the torque is recorded before its motion; a mean until the next row has 0.5.
    """

    fit: LinearFit
    slowest: SlowestSliding
    load_ratio: float | None = None
    early_rows: float = 0.0
    early_error_rows: float = 0.0  # standard error

    def __getitem__(self, name: str) -> Estimate:
        return self.fit[name]

    def predict(self, moved: MeasuredMotion) -> FloatArray:
        """Torque (n,) of the model on a motion."""
        return self.fit.predict(plain_columns(later_motion(moved, self.early_rows), self.load_ratio, spring=True))


@one_blas_thread
def fit_plain_model(
    data: Sequence[MotionData], load_ratio: float | None = None, spring: bool = False
) -> PlainModel | None:
    """Fit the plain model to the sliding rows of recordings of one axis; None without sliding motion.

    A `spring`, or gravity on a load that turns (`load_ratio`), and the time of the torque against the position, within
    the window about a sliding row, are fitted where the rows earn them.
    """
    top = max((float(np.max(np.abs(one.moved.velocity[one.rows]), initial=0.0)) for one in data), default=0.0)
    slowest = _slowest(data, top)
    # half the shortest window and a row: so far about a sliding row the axis moves the same way
    most = min(min(one.window, window_rows(one.period_s)) // 2 + 1 for one in data)
    far = _far(data, slowest, load_ratio)
    sliding = [one.sliding(slowest, abs(far)) for one in data]
    gains = [noise_gains(one.period_s, one.window) for one in data]
    samples = sum(gain[0] ** 2 * rows.sum() for gain, rows in zip(gains, sliding, strict=True))
    if samples < _FEWEST:
        return None
    # neighbours in a long window say the same
    used = [(one, np.flatnonzero(rows)[:: max(one.window // 4, 1)]) for one, rows in zip(data, sliding, strict=True)]
    torque = np.concatenate([one.torque[rows] for one, rows in used])
    count = torque.size
    turned_rad = abs(load_ratio or 0.0) * max(float(np.ptp(one.moved.position)) for one in data)
    more: list[tuple[str, ...]] = [("spring",)] if spring else []
    more += [("sine", "cosine")] if load_ratio is not None and turned_rad >= LEAST_ANGLE_RAD else []
    weighed = list(zip(used, gains, strict=True))
    noise = {
        name: float(np.sqrt(sum((one.noise * gain[at]) ** 2 * rows.size for (one, rows), gain in weighed) / count))
        for name, at in (("inertia", 2), ("viscous", 1))
    }

    def stacked(names: Sequence[str], early_rows: float, slope: LinearFit | None = None) -> dict[str, FloatArray]:
        found = []
        for one, rows in used:
            every = {**plain_columns(later_motion(one.moved, early_rows), load_ratio, spring=True)}
            speed = every["viscous"] / top
            every |= {"slow": every["coulomb"] * np.exp(-np.abs(speed) / _BEND), "fast": speed * np.abs(speed)}
            if slope is not None:  # change of the torque per row
                every[_LOGGED] = np.gradient(slope.predict({**every, "coulomb": np.zeros(one.torque.size)}))
            found.append({name: every[name][rows] for name in (*names, *([_LOGGED] if slope else []))})
        return {name: np.concatenate([every[name] for every in found]) for name in found[0]}

    def fitted(columns: Columns) -> LinearFit:
        fit = least_squares(columns, torque, rows_per_sample=count / samples, noise=noise)
        free = max(samples - len(columns), 1.0)
        wider = float(stdtrit(free, 0.975) / ndtri(0.975))
        return replace(fit, std_errors=wider * fit.std_errors, covariance=wider**2 * fit.covariance)

    def structure(early_rows: float) -> LinearFit:
        plain = fitted(stacked((*MOTION, *_LAW), early_rows))
        tried = [fitted(stacked((*MOTION, *_LAW, *names), early_rows)) for names in more]
        earned = [
            one
            for one, names in zip(tried, more, strict=True)
            if one.differs(names) and one.held_out < plain.held_out and one["inertia"].value > 0.0
        ]
        return min(earned, key=lambda one: one.held_out, default=plain)

    best, early_rows = structure(0.0), float(far)
    begin = structure(early_rows) if far else best
    for _ in range(8):
        timed = fitted(stacked(begin.names, early_rows, begin))
        early_rows = float(np.clip(early_rows + timed[_LOGGED].value, far - most, far + most))
        if abs(timed[_LOGGED].value) < 0.1 * timed[_LOGGED].std_error:
            break
    again = structure(early_rows)
    error_rows = timed[_LOGGED].std_error
    if abs(early_rows) > SIGMAS * error_rows and again.held_out >= best.held_out:
        error_rows = float(np.hypot(error_rows, early_rows))  # refuted by held-out rows
    if not (abs(early_rows) > SIGMAS * error_rows):
        again, early_rows = best, 0.0

    def final(names: Sequence[str]) -> LinearFit:
        """The fit with errors that count the delay and the bend; without a term that they do not leave."""
        fit, bent = (fitted(stacked((*names, *law), early_rows)) for law in ((), _LAW))
        errors = fit.std_errors
        if early_rows:
            errors = np.maximum(errors, fitted(stacked(names, early_rows, fit)).std_errors[:-1])
        if bent.differs(_LAW) and bent.held_out < fit.held_out:
            errors = np.hypot(errors, bent.values[: len(names)] - fit.values)
        scale = np.ones(len(names))
        np.divide(errors, fit.std_errors, out=scale, where=(fit.std_errors > 0.0) & np.isfinite(errors))
        fit = replace(fit, std_errors=errors, covariance=fit.covariance * np.outer(scale, scale))
        return fit if len(names) == len(MOTION) or fit.differs(names[len(MOTION) :]) else final(MOTION)

    fit = final([name for name in again.names if name not in _LAW])
    return PlainModel(fit, slowest, load_ratio, early_rows, error_rows)


def _far(data: Sequence[MotionData], slowest: SlowestSliding, load_ratio: float | None) -> int:
    """Whole rows by which the torque is recorded before its motion, see `shift_of_torque`."""
    farthest = max(_FARTHEST_ROWS, round(_FARTHEST_S / data[0].period_s))
    thin = [max(one.window // 4, 1) for one in data]
    rows = [np.flatnonzero(one.sliding(slowest, farthest))[::every] for one, every in zip(data, thin, strict=True)]
    sliding = sum(np.count_nonzero(one.sliding(slowest)) // every for one, every in zip(data, thin, strict=True))
    samples = sum(4.0 * at.size * every / one.window for one, at, every in zip(data, rows, thin, strict=True))
    if samples < 10 * _FEWEST or sum(at.size for at in rows) < _KEPT * sliding:
        return 0
    tables = [np.column_stack([*plain_columns(one.moved, load_ratio, spring=True).values()]) for one in data]
    step = max(min(one.window for one in data) // 8, 1)
    return shift_of_torque([one.torque for one in data], tables, rows, range(-farthest, farthest + 1, step), samples)


def _slowest(data: Sequence[MotionData], top: float) -> SlowestSliding:
    """A share of the top speed `top` of both ways; of its own top where an axis only creeps back, above its noise.

    Motion one way would not tell Coulomb friction from a load.
    """
    both = SlowestSliding(_SLIDING * top, _SLIDING * top)
    sliding = np.concatenate([one.moved.velocity[one.sliding(both)] for one in data])
    if not sliding.size or (sliding.min() < 0.0 < sliding.max()):
        return both
    way = float(np.sign(sliding[0]))
    noise = max(SIGMAS * one.noise * noise_gains(one.period_s, one.window)[1] for one in data)
    least = max(_SLIDING * max(float(np.max(-way * one.moved.velocity[one.rows], initial=0.0)) for one in data), noise)
    other = both._replace(**{"back" if way > 0.0 else "away": least})
    samples = sum(
        float(noise_gains(one.period_s, one.window)[0]) ** 2
        * float(np.sum(way * one.moved.velocity[one.sliding(other)] < 0.0))
        for one in data
    )
    return other if samples >= _OTHER_WAY else both
