"""The plain model of an axis: its torque by linear least squares over its measured motion alone.

    T = J a + D v + Fc sign(v) + T0   (+ k q)   (+ S sin(r q) + C cos(r q))

J inertia, D viscous friction, Fc Coulomb friction, T0 offset, k spring, S and C gravity over the angle r q of a load
that turns; motor units (kg m^2, N m s/rad, N m, N m, N m/rad, N m, or kg, N s/m, N, N, N/m). Without a twin, a control
law or a bench it tells values with standard errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.identification.derivatives import MeasuredMotion, motion, rows_per_sample, smoothed, window_rows
from hil.identification.least_squares import Columns, Estimate, LinearFit, least_squares

MOTION = ("inertia", "viscous", "coulomb", "offset")  # names of the coefficients without a torque over the position
_SLIDING = 0.02  # of the top speed: below, an axis may stick, and its motion does not tell its friction
_FEWEST_WINDOWS = 4  # of sliding motion: one for each coefficient of the motion
# Residual with a torque over the position over that without, up to which it is kept: on 80 white rows two parameters
# without effect remove 1 %.
OVER_POSITION_GAIN = 0.85
# Least low-passed sign of the velocity of a row that is fitted: below, the filter mixes the friction of both directions
# and of rest, and its change near a reversal, where the acceleration is largest, looks like an inertia.
_SLIDES = 0.9
LEAST_ANGLE_RAD = 0.5  # of the load: over less, a sine is a straight line to 1 %, and gravity is a spring


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


def least_structure(
    columns: Columns, torque: FloatArray, fewest: int, turned_rad: float, *, samples: float = 1.0, how: str = ""
) -> LinearFit:
    """Fit a torque (n,) by motion alone, or with a torque over the position where that leaves clearly less.

    It is a spring, or gravity where the load turned far, by `turned_rad`, and that leaves less; of those whose columns
    are given. Rows about a reversal are left out where at least `fewest` others are left. `samples` is the number of
    rows for an independent one.
    """
    slides = np.abs(columns["coulomb"]) > _SLIDES
    if np.count_nonzero(slides) >= fewest:
        columns, torque = {name: column[slides] for name, column in columns.items()}, torque[slides]

    def fit(text: str, *more: str) -> LinearFit:
        used = {name: columns[name] for name in (*MOTION, *more)}
        return least_squares(used, torque, rows_per_sample=samples, how=how + text)

    plain = fit("")
    tried = [fit(", with a spring", "spring")] if "spring" in columns else []
    if "sine" in columns and turned_rad >= LEAST_ANGLE_RAD:
        tried.append(fit(", with gravity", "sine", "cosine"))
    best = min(tried, key=lambda one: one.left, default=plain)
    return best if best.left < OVER_POSITION_GAIN * plain.left and best["inertia"].value > 0.0 else plain


@dataclass(frozen=True, eq=False)
class MotionData:
    """Motion of a recording, its torque (n,) smoothed alike, and the rows (n,) that are evaluated."""

    moved: MeasuredMotion
    torque: FloatArray
    rows: NDArray[np.bool_]
    period_s: float

    def sliding(self, slowest: float) -> NDArray[np.bool_]:
        """Evaluated rows (n,) in which the axis is faster than `slowest`."""
        return np.asarray(self.rows & (np.abs(self.moved.velocity) > slowest))


def motion_data(position: FloatArray, torque: FloatArray, period_s: float, judged: slice = slice(None)) -> MotionData:
    """Data of motor position and torque (n,), of the rows `judged` without a window at both ends.

    Of a recording shorter than four windows no row is evaluated.
    """
    window, rows = window_rows(period_s), np.zeros(position.size, dtype=bool)
    if position.size >= _FEWEST_WINDOWS * window:
        rows[judged] = True
        rows[:window] = rows[-window:] = False
    moved = motion(position, period_s)
    moved = replace(moved, direction=np.sign(moved.velocity))  # an axis that creeps has friction too
    return MotionData(moved, smoothed(torque, period_s), rows, period_s)


@dataclass(frozen=True, eq=False)
class PlainModel:
    """Fit of the plain model, the least speed of the rows that were fitted, and the ratio of a load that turns."""

    fit: LinearFit
    slowest: float
    load_ratio: float | None = None

    def __getitem__(self, name: str) -> Estimate:
        return self.fit[name]

    def predict(self, moved: MeasuredMotion) -> FloatArray:
        """Torque (n,) of the model on a motion."""
        return self.fit.predict(plain_columns(moved, self.load_ratio, spring=True))


def fit_plain_model(
    data: Sequence[MotionData], load_ratio: float | None = None, spring: bool = False
) -> PlainModel | None:
    """Fit the plain model to the sliding rows of recordings; None without sliding motion.

    A `spring`, and gravity on a load that turns (`load_ratio`), are fitted where they leave clearly less.
    """
    period_s, fewest = data[0].period_s, _FEWEST_WINDOWS * window_rows(data[0].period_s)
    slowest = _SLIDING * max(float(np.max(np.abs(one.moved.velocity))) for one in data)
    sliding = [one.sliding(slowest) for one in data]
    if sum(rows.sum() for rows in sliding) < fewest:
        return None
    alike = [replace(one.moved, direction=smoothed(one.moved.direction, period_s)) for one in data]
    found = [plain_columns(moved, load_ratio, spring) for moved in alike]
    columns = {
        name: np.concatenate([one[name][rows] for one, rows in zip(found, sliding, strict=True)]) for name in found[0]
    }
    torque = np.concatenate([one.torque[rows] for one, rows in zip(data, sliding, strict=True)])
    turned_rad = abs(load_ratio or 0.0) * max(float(np.ptp(one.moved.position)) for one in data)
    fit = least_structure(columns, torque, fewest, turned_rad, samples=rows_per_sample(period_s))
    return PlainModel(fit, slowest, load_ratio)
