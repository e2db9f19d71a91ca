"""Facts of an axis and of its recordings that values of a mechanism are scaled by."""

import math
from collections.abc import Callable
from dataclasses import dataclass

_PERIODS = 12  # of a delay: as far as the simulated drive remembers its commands


def _always(level: float) -> float:
    return math.inf


def _all(level: float) -> float:
    return 1.0


def _never(value: float) -> bool:
    return False


def _none(line_hz: float) -> float:
    return 0.0


@dataclass(frozen=True)
class AxisFacts:
    """Facts of an axis that typical values and limits of validity are scaled by; motor units."""

    coulomb: float  # friction [N m]
    ratio: float  # [m/rad]
    angle_per_unit: float  # motor angle per motor unit
    rated_torque: float  # [N m]
    table_count_m: float | None  # resolution of the linear encoder; None without one
    duration_s: float  # of the longest recording
    travel_m: float = math.inf  # of the longest motion
    positions_m: tuple[float, float] = (-math.inf, math.inf)  # first and last position of the table
    lost_m: float = math.inf  # largest lost motion that the encoders can hide, beside their lateness
    turn_known: bool = True  # False on a linear axis without a lead
    torque_delay_s: float = 0.0  # by which a torque acts after it is recorded
    held_s: Callable[[float], float] = _always  # longest time for which |torque command| is at a level or above
    # share of the rows in which the axis moves whose |torque command| is above a level
    driven: Callable[[float], float] = _all
    swings: Callable[[float], float] = _none  # share of the motion's energy in a line [Hz]
    grows_with_speed: Callable[[float], bool] = _never  # a line [Hz] of the torque that the motion needs

    @property
    def friction(self) -> float:
        """Coulomb friction, above zero [N m]."""
        return max(self.coulomb, 1e-6)

    @property
    def middle_m(self) -> float:
        """Middle of the motion of the table [m]; 0 where it is not known."""
        first_m, last_m = self.positions_m
        return 0.5 * (first_m + last_m) if math.isfinite(last_m - first_m) else 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """Measured sizes that starting values are scaled by; motor units."""

    coulomb: float  # friction, above zero [N m]
    peak_torque: float  # [N m]
    peak_speed: float  # [rad/s]
    viscous_speed: float  # [rad/s] at which viscous friction equals Coulomb friction
    travel_m: float
    positions_m: tuple[float, float]  # first and last position of the table
    duration_s: float
    period_s: float  # of the rows
    ratio: float  # [m/rad]
    lead_m: float  # of the screw
    orders: list[float]  # of the disturbance torque, per revolution
    ripple_orders: list[float]  # of a disturbance that grows with the torque
    friction_periods: list[float]  # [m]
    friction_zones: list[tuple[float, float, float]]  # from, to [m], share of friction above the rest of the travel
    torque_zones: list[tuple[float, float, float]]  # from, to [m], share of the torque above the rest of the travel
    scale_periods: list[float]  # of the table residual [m]
    lines_hz: list[float]  # of the disturbance torque over time
    windows: list[tuple[float, float, float]]  # start, end, level [N m], the most significant first; at least one
    rest_m: float  # position at which a straight line through the disturbance torque over the position is 0
    stretch: float  # table against motor [m], typical
    most_stretch: float  # and largest

    def delays_s(self, least_s: float, most_s: float) -> list[float]:
        """Delays of whole periods between two bounds, up to twelve periods.

        A command with noise fits best where it is late by whole periods, and worse between: a fit of a delay goes to
        the nearest of these minima, so that it is begun at each of them.
        """
        found = [number * self.period_s for number in range(-_PERIODS, _PERIODS + 1) if number]
        return [delay_s for delay_s in found if least_s <= delay_s <= most_s]
