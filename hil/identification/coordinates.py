"""Coordinates of the parameter vector of a hypothesis: scales, bounds and steps of the forward difference."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hil.bench.axis_fields import RATIOS
from hil.bench.bench_file import MechanismEntry
from hil.bench.control_section import MOST_TORQUE_DELAY_S
from hil.identification.derivatives import SMOOTH_S
from hil.twin.library import BY_ID
from hil.twin.parameter import Parameter, Role

# Steps of the forward difference for the edges of a window: first wide, to reach the edge, at last one tick at 1 kHz.
EDGE_STEP_S, LAST_EDGE_STEP_S = 0.03, 0.001
# Relative step with play: a light nut chatters in its gap, so residuals are noisy functions of the parameters, and only
# a wide step averages them (Moré and Wild 2012). Of 1e-4, 0.01 and 0.03 only the last converged from values 20 % wrong.
CHATTER_STEP = 0.03
# Bound of nominal parameters over the bench file, as a factor: beyond it lie minima in which implausible parameters
# compensate for a wrong structure.
TRUST = 3.0
# Friction that a bench file gives as 0 is not known. Its scale goes with the inertia, so that a fit does not depend on
# the unit of the torque: Coulomb friction that slows the axis by that many rad/s^2 or m/s^2, viscous friction that
# slows it by that share per second. Step of the forward difference over it, and largest value in its unit.
LITTLE, LITTLE_STEP, ANY = 0.1, 1e-2, 1e6
# Delay of a recorded torque whose rows are not the ticks of the drive. A mean over the tick before or after a row, or
# a sample of it, shifts it by up to a row and a half; the filter of the drive's current by what the plain model tells.
DELAY, MOST_DELAY = "torque_delay_s", 1.5


class MotionRange(NamedTuple):
    """Extent of the motion that recordings show: of the table, of the motor, and in time."""

    travel_m: float
    angle_rad: float
    duration_s: float


@dataclass(frozen=True)
class Coordinate:
    """One entry of the parameter vector: value = scale exp(x) if logarithmic, else scale x."""

    name: str
    scale: float
    logarithmic: bool
    low: float
    high: float
    parameter: Parameter | None = None  # of a mechanism; None for one of the axis
    least_step: float = 0.0  # of x in a forward difference

    def value(self, x: float) -> float:
        """Physical value of x."""
        return float(self.scale * np.exp(x)) if self.logarithmic else float(self.scale * x)

    def x(self, value: float) -> float:
        """x of a physical value."""
        return float(np.log(value / self.scale)) if self.logarithmic else value / self.scale

    @property
    def left_out(self) -> bool:
        """True for friction of the axis that the bench gives as 0."""
        return self.parameter is None and self.low == 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of x."""
        return self.x(self.low), self.x(self.high)

    @property
    def role(self) -> Role | None:
        """Role of a mechanism's parameter."""
        return self.parameter.role if self.parameter else None

    @property
    def edge(self) -> bool:
        """True for an instant at which a window begins or ends."""
        return self.role is Role.EDGE

    def step(self, start: float, least: float, edge_step_s: float, motion: MotionRange) -> float:
        """Step of x in a forward difference, for a parameter of a mechanism that begins at `start`."""
        step = least
        if self.role is Role.PERIOD:
            step = 0.01 * start / (2.0 * np.pi * max(motion.travel_m, start))
        elif self.edge:  # residuals change near the edge only: a wide step reaches it
            step = edge_step_s / max(abs(start), EDGE_STEP_S)
        elif self.role is Role.ORDER:
            step = 0.01 / (start * max(motion.angle_rad, 1.0))
        elif self.role is Role.LINE:
            step = 0.01 / (2.0 * np.pi * start * max(motion.duration_s, 1.0 / start))
        if self.logarithmic:
            return step
        return min(step if self.edge else max(step, 1e-3), 0.1 * (self.high - self.low) / self.scale)


def axis_coordinate(name: str, value: float, inertia: float) -> Coordinate:
    """The coordinate of a nominal parameter of an axis, by its value in the bench file and the inertia at the motor."""
    if name in RATIOS:
        return Coordinate(name, max(value, 0.01), True, 1e-4, 0.9, least_step=1e-3)
    if value > 0.0:
        return Coordinate(name, value, True, value / TRUST, value * TRUST)
    return Coordinate(name, LITTLE * inertia, False, 0.0, ANY, least_step=LITTLE_STEP)  # friction left out


def delay_coordinate(delay_s: float, period_s: float) -> Coordinate:
    """The coordinate of the delay of a recorded torque."""
    most_s = MOST_DELAY * period_s + 0.5 * SMOOTH_S
    low, high = max(delay_s - most_s, -MOST_TORQUE_DELAY_S), min(delay_s + most_s, MOST_TORQUE_DELAY_S)
    return Coordinate(DELAY, period_s, False, low, high, least_step=1e-3)


def coordinate_of(name: str, parameter: Parameter, start: float) -> Coordinate:
    """The coordinate of a mechanism's parameter, scaled by its starting value if it has no scale of its own."""
    positive = parameter.low > 0.0
    scale = parameter.scale or (start if positive else abs(start) or 1.0)
    return Coordinate(name, scale, positive, parameter.low, parameter.high, parameter)


def known_values(entries: Sequence[MechanismEntry]) -> list[tuple[int, str, float]]:
    """Index of the entry, name and value of each parameter that a bench file gives for its mechanisms, but for events.

    In the order of the entries; of one entry in the order of its mechanism's parameters.
    """
    return [
        (index, name, entry.parameters[name])
        for index, entry in enumerate(entries)
        for name in BY_ID[entry.effect].names
        if name in entry.parameters and BY_ID[entry.effect].over_time is None
    ]


def known_coordinates(entries: Sequence[MechanismEntry]) -> tuple[Coordinate, ...]:
    """Coordinates of `known_values`, named EFFECT.PARAMETER, of the second entry of an effect EFFECT_2.PARAMETER."""
    coordinates = []
    for index, name, value in known_values(entries):
        effect = entries[index].effect
        number = sum(other.effect == effect for other in entries[: index + 1])
        parameter = next(one for one in BY_ID[effect].parameters if one.name == name)
        coordinates.append(
            coordinate_of(f"{effect}_{number}.{name}" if number > 1 else f"{effect}.{name}", parameter, value)
        )
    return tuple(coordinates)


def with_values(entries: Sequence[MechanismEntry], values: Sequence[float]) -> tuple[MechanismEntry, ...]:
    """The mechanisms of a bench file with other `known_values`."""
    changed = [dict(entry.parameters) for entry in entries]
    for (index, name, _), value in zip(known_values(entries), values, strict=True):
        changed[index][name] = value
    return tuple(entry.model_copy(update={"parameters": given}) for entry, given in zip(entries, changed, strict=True))
