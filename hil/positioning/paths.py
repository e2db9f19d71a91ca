"""Circular paths of two axes, from their recordings: whole turns in each sense, commanded and measured."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.positioning.circle_fit import least_squares_circle
from hil.recording.recording import Recording

ROUND = 1e-3  # of the curvature, by differences: rows on no circle, or one that grows or shrinks, are left out
EXACT = 1e-7  # of the radius: rows on the circle; below the counts of encoders
EVEN = 1e-2  # of the feed: rows at constant feed
SLOW = 0.1  # of the largest feed: the curvature of slower rows is that of the rounding
LEAST_ROWS = 100
SENSES = {1: "anticlockwise", -1: "clockwise"}  # x to the right, y upwards
_CLOCK = 1e-6  # of the period: two recordings of one rate


class CircularPath(NamedTuple):
    """One turn [m]: centre and radius that were commanded; angle (n,) [rad], going on; measured x and y (n,) about it.

    sense: 1 anticlockwise, -1 clockwise.
    """

    sense: int
    radius_m: float
    feed_m_s: float
    angle_rad: FloatArray
    x_m: FloatArray
    y_m: FloatArray

    @property
    def name(self) -> str:
        """Sense in words."""
        return SENSES[self.sense]


def circular_paths(x: Recording, y: Recording) -> dict[int, CircularPath]:
    """The last whole turn of each sense: the servo loops have settled in the turns before it.

    The recordings run from one moment. Raises InputError for other rates, without linear encoders, or without a turn.
    """
    if abs(x.period_s - y.period_s) > _CLOCK * x.period_s:
        raise InputError(
            f"{x.name}, {y.name}: given periods of {1e3 * x.period_s:g} and {1e3 * y.period_s:g} ms, allowed one; "
            "record both axes at one rate"
        )
    rows = min(len(x), len(y))
    command, table = (
        np.stack([one[name][:rows] for one in (x, y)]) for name in ("position_command_m", "table_position_m")
    )
    feed, curvature = _feed_and_curvature(command, x.period_s)
    paths = dict[int, CircularPath]()
    for sense in SENSES:
        turn = _last_turn(command, feed, sense * curvature)
        if turn is not None:
            paths[sense] = _path(sense, command[:, turn], table[:, turn], x.period_s)
    if not paths:
        raise InputError(
            f"{x.name}, {y.name}: given no whole turn of a circle, allowed one or more; record such as "
            "hil run profiles/circle_x.yaml on one axis and profiles/circle_y.yaml on the other"
        )
    return paths


def _feed_and_curvature(place: FloatArray, period_s: float) -> tuple[FloatArray, FloatArray]:
    """Feed [m/s] and signed curvature [1/m] (n,) of a path (2, n), positive anticlockwise; 0 where it hardly moves."""
    speed = np.gradient(place, period_s, axis=1)
    bend = np.gradient(speed, period_s, axis=1)
    feed = np.hypot(*speed)
    curvature = np.zeros_like(feed)
    np.divide(speed[0] * bend[1] - speed[1] * bend[0], feed**3, out=curvature, where=feed > SLOW * feed.max())
    return feed, curvature


def _last_turn(place: FloatArray, feed: FloatArray, curvature: FloatArray) -> slice | None:
    """Rows of the last whole turn of the longest stretch on one circle at constant feed."""
    turning = curvature[curvature > 0.0]
    if turning.size == 0:
        return None
    steady = np.abs(feed / np.median(feed[curvature > 0.0]) - 1.0) < EVEN
    first, last = _longest(steady & (np.abs(curvature / np.median(turning) - 1.0) < ROUND))
    if last - first < LEAST_ROWS:
        return None
    middle = slice(first + (last - first) // 4, last - (last - first) // 4)
    circle = least_squares_circle(*place[:, middle])
    dx, dy = place[0] - circle.x_m, place[1] - circle.y_m
    exact = np.abs(np.hypot(dx, dy) / circle.radius_m - 1.0) < EXACT
    first, last = _longest(steady & exact, around=(first + last) // 2)
    if last - first < LEAST_ROWS:
        return None
    angle = np.unwrap(np.arctan2(dy[first:last], dx[first:last]))
    whole = np.flatnonzero(np.abs(angle - angle[-1]) > 2.0 * np.pi)
    return slice(first + int(whole[-1]) + 1, last) if whole.size else None


def _longest(wanted: NDArray[np.bool_], around: int | None = None) -> tuple[int, int]:
    """First row and row after the last of the longest stretch of rows, or of that around a row; (0, 0): none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(np.int8)))
    stretches = [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]
    if around is not None:
        stretches = [one for one in stretches if one[0] <= around < one[1]]
    return max(stretches, key=lambda one: one[1] - one[0], default=(0, 0))


def _path(sense: int, command: FloatArray, table: FloatArray, period_s: float) -> CircularPath:
    circle = least_squares_circle(*command)
    dx, dy = command[0] - circle.x_m, command[1] - circle.y_m
    angle = np.unwrap(np.arctan2(dy, dx))
    feed = circle.radius_m * abs(angle[-1] - angle[0]) / (period_s * (angle.size - 1))
    return CircularPath(sense, circle.radius_m, float(feed), angle, table[0] - circle.x_m, table[1] - circle.y_m)
