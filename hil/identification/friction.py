"""Identify friction at constant feed, as in Sec. 3.2.3 of the source.

Without acceleration the mean torque is friction (Eq. 24, with an offset for constant loads such as weight):

    tau = tau_C sign(omega) + c omega + tau_0

Least squares over one point per stretch of constant feed, transients cut, in both directions. On a linear axis the
units are N, N s/m and m/s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AxisKind
from hil.errors import InputError
from hil.identification.least_squares import least_squares
from hil.recording.recording import Recording

if TYPE_CHECKING:
    from hil.figures.drawing import Drawing

FEED_TOLERANCE = 1e-3  # relative deviation from a constant feed: above the rounding of printed set-points
FEED_RESOLUTION_M_S = 2e-6  # two of the last digits that recordings are usually printed with
SETTLING_S = 0.15  # transient after the feed is reached: several time constants of a position loop
ENDING_S = 0.01  # cut before the feed changes: a margin of several ticks
AVERAGED_MIN_S = 0.1  # least duration of a mean: in a shorter one the remaining transient dominates


class FrictionUnits(NamedTuple):
    """Name of the motor's effort, and units of Coulomb friction, viscous friction and speed."""

    quantity: str
    coulomb: str
    viscous: str
    speed: str


_UNITS = {
    AxisKind.ROTARY: FrictionUnits("torque", "N m", "N m s/rad", "rad/s"),
    AxisKind.LINEAR: FrictionUnits("force", "N", "N s/m", "m/s"),
}


@dataclass(frozen=True)
class FrictionPoint:
    """Means over one stretch of constant feed."""

    speed: float  # motor speed [rad/s], linear axis [m/s]
    torque: float  # [N m], linear axis [N]
    feed_m_s: float  # velocity set-point
    start_s: float  # of the averaged rows
    duration_s: float


@dataclass(frozen=True)
class FrictionResult:
    """Coulomb [N m], viscous [N m s/rad] and offset [N m], on a linear axis [N], [N s/m], [N].

    The errors are standard errors of the regression.
    """

    kind: AxisKind
    points: tuple[FrictionPoint, ...]
    coulomb: float
    viscous: float
    offset: float
    coulomb_std_error: float
    viscous_std_error: float
    offset_std_error: float
    residual_rms: float  # of the points about the line [N m] or [N]

    @property
    def units(self) -> FrictionUnits:
        """Units on this kind of axis."""
        return _UNITS[self.kind]

    def plot(self) -> Drawing:
        """Draw torque over speed with the regression line, and the residuals."""
        from hil.identification.figures import friction_figure

        return friction_figure(self)

    def torque(self, speed: FloatArray) -> FloatArray:
        """Friction of the line [N m] or [N] at speeds [rad/s] or [m/s]."""
        return np.asarray(self.coulomb * np.sign(speed) + self.viscous * speed + self.offset, dtype=np.float64)


def identify_friction(
    recording: Recording, *more: Recording, settling_s: float = SETTLING_S, speed_min: float = 0.0
) -> FrictionResult:
    """Fit Coulomb friction, viscous friction and offset to recordings with several feeds in both directions.

    `settling_s` is cut after each feed is reached; points below `speed_min` [rad/s] or [m/s] are omitted (Stribeck
    friction deviates from the line). The speed is that of the motor encoder.
    Raises InputError if constant feeds are too few, too short, or of one direction.
    """
    points = tuple(
        point
        for one in (recording, *more)
        for part in one.parts()
        for point in _points(part, settling_s)
        if abs(point.speed) >= speed_min and point.speed != 0.0
    )
    speed = np.array([point.speed for point in points])
    torque = np.array([point.torque for point in points])
    forward, backward = int((speed > 0).sum()), int((speed < 0).sum())
    # two speeds in one direction give the slope, a point in the other direction separates Coulomb friction and offset
    if min(forward, backward) < 1 or len(points) < 4 or np.ptp(np.abs(speed)) < 0.1 * np.abs(speed).max():
        raise InputError(
            f"{recording.name}: velocity_command_m_s: given {forward} forward and {backward} backward stretches of "
            f"constant feed, allowed 4 or more of different feeds and both directions, each longer than "
            f"{settling_s + ENDING_S + AVERAGED_MIN_S:g} s; record the profile friction_sweep"
        )
    columns = {"coulomb": np.sign(speed), "viscous": speed, "offset": np.ones_like(speed)}
    fit = least_squares(columns, torque, blocks=0)  # the means of separate stretches are independent
    figures = np.concatenate([fit.values, fit.std_errors, [np.sqrt(np.mean(fit.residual**2))]])
    return FrictionResult(recording.kind, points, *figures.tolist())


def constant_feed_stretches(velocity_command_m_s: FloatArray) -> list[tuple[int, int]]:
    """Stretches [first, end) in which the set-point stays within 0.1 % of its first value, without standstill."""
    velocity = velocity_command_m_s.tolist()
    stretches = []
    first = 0
    for k in range(1, len(velocity) + 1):
        feed = velocity[first]
        if k == len(velocity) or abs(velocity[k] - feed) > FEED_TOLERANCE * abs(feed) + FEED_RESOLUTION_M_S:
            if abs(feed) > FEED_RESOLUTION_M_S:
                stretches.append((first, k))
            first = k
    return stretches


def _points(recording: Recording, settling_s: float) -> list[FrictionPoint]:
    names, period_s = recording.axis, recording.period_s
    position, torque = recording[names.motor_position], recording[names.torque]
    feed = recording[names.velocity_command]
    cut, ending = round(settling_s / period_s), round(ENDING_S / period_s)
    points = []
    for first, end in constant_feed_stretches(feed):
        first, end = first + cut, end - ending
        if end - first < 2 or (end - first) * period_s < AVERAGED_MIN_S:
            continue
        duration_s = (end - first - 1) * period_s
        speed = (position[end - 1] - position[first]) / duration_s
        points.append(
            FrictionPoint(
                float(speed),
                float(torque[first:end].mean()),
                float(feed[first]),
                float(recording["time_s"][first]),
                duration_s,
            )
        )
    return points
