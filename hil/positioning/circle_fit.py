"""Circles through measured paths: by least squares, and the narrowest ring that holds them (minimum zone).

Deviations of the radius are thousands of times smaller than the radius, so that a shift (a, b) of the centre changes
the radius of a point at the angle p by - a cos p - b sin p, to the second order of a / R.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from hil.arrays import FloatArray


class NarrowestRing(NamedTuple):
    """The narrowest ring around points: centre, inner radius and width, all [m]."""

    x_m: float
    y_m: float
    inner_m: float
    width_m: float


class FittedCircle(NamedTuple):
    """Circle of least squares [m]."""

    x_m: float
    y_m: float
    radius_m: float


def least_squares_circle(x_m: FloatArray, y_m: FloatArray) -> FittedCircle:
    """Fit a circle to points (n,): least squares of their distances from it, by two steps of Gauss and Newton."""
    centre = np.array([x_m.mean(), y_m.mean()])
    radius = 0.0
    for _ in range(3):
        dx, dy = x_m - centre[0], y_m - centre[1]
        distance = np.hypot(dx, dy)
        rows = np.column_stack([dx / distance, dy / distance, np.ones_like(distance)])
        (shift_x, shift_y, radius), *_ = np.linalg.lstsq(rows, distance)
        centre += (shift_x, shift_y)
    return FittedCircle(float(centre[0]), float(centre[1]), float(radius))


def narrowest_ring(x_m: FloatArray, y_m: FloatArray) -> NarrowestRing:
    """Find the two concentric circles of least distance that enclose points (n,): a linear programme."""
    first = least_squares_circle(x_m, y_m)
    dx, dy = x_m - first.x_m, y_m - first.y_m
    distance = np.hypot(dx, dy)
    scale = max(float(np.ptp(distance)), 1e-15)
    deviation = (distance - first.radius_m) / scale
    cos, sin, one = dx / distance, dy / distance, np.ones_like(distance)
    # centre a, b, inner radius c, width w: c <= deviation - a cos - b sin <= c + w
    found = linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=np.vstack([np.column_stack([cos, sin, one, 0 * one]), np.column_stack([-cos, -sin, -one, -one])]),
        b_ub=np.concatenate([deviation, -deviation]),
        bounds=[(None, None), (None, None), (None, None), (0.0, None)],
        method="highs",
    )
    a, b, inner, width = (scale * float(value) for value in found.x)
    return NarrowestRing(first.x_m + a, first.y_m + b, first.radius_m + inner, width)
