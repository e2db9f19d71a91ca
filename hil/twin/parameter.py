"""Parameters of mechanisms: dimension, role in a search, bounds, and the default values that follow from these."""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from hil.twin.scene import AxisFacts, Scene

# Largest place on the travel: a motor whose lead is not known may turn for hours [rad].
ANYWHERE = 1e6


class Dimension(StrEnum):
    """Dimension of a parameter; gives its unit on rotary and on linear axes."""

    TORQUE = "N m"
    MOTOR_SPEED = "rad/s"
    MOTOR_STIFFNESS = "N m/rad"
    MOTOR_DRAG = "N m s^2/rad^2"
    INVERSE_TORQUE_SQUARED = "1/(N m)^2"
    ANGLE = "rad"
    LENGTH = "m"
    TIME = "s"
    FORCE = "N"
    STIFFNESS = "N/m"
    FREQUENCY = "Hz"
    RATIO = "1"
    PER_LENGTH = "1/m"
    COUNT = "1/rev"

    def unit(self, drive: str = "N m", turns: bool = False) -> str:
        """SI unit on an axis whose motor is driven by N m, N or V (`drive`); `turns`: of a load that turns."""
        other = _LINEAR_UNITS if drive == "N" else _TURNING_UNITS if turns else {}
        unit = other.get(self, self.value)
        return unit.replace("(N m)", "V").replace("N m", "V") if drive == "V" else unit


_LINEAR_UNITS = {
    Dimension.TORQUE: "N",
    Dimension.MOTOR_SPEED: "m/s",
    Dimension.MOTOR_STIFFNESS: "N/m",
    Dimension.MOTOR_DRAG: "N s^2/m^2",
    Dimension.INVERSE_TORQUE_SQUARED: "1/N^2",
}
_TURNING_UNITS = {
    Dimension.LENGTH: "rad",
    Dimension.FORCE: "N m",
    Dimension.STIFFNESS: "N m/rad",
    Dimension.PER_LENGTH: "1/rad",
}


_IN_NAMES = str.maketrans({"^": None, "/": "_", " ": "_"})


class Role(StrEnum):
    """Role of a parameter in a search."""

    STRENGTH = "strength"  # size of the effect
    PHASE = "phase"  # angle at which the effect begins
    PERIOD = "period"  # along the travel
    ORDER = "order"  # cycles per revolution of the motor
    FREQUENCY = "frequency"  # of a mode
    LINE = "line"  # frequency of a force whose phase goes with the clock
    EDGE = "edge"  # start or end of a window of time
    SHAPE = "shape"  # any other


@dataclass(frozen=True)
class Parameter:
    """Parameter of a mechanism: name with unit, dimension, physical bounds, default (None: required) and role.

    `scale` is the size of a change that matters, where the value does not tell it: a position goes with its zero.
    """

    name: str
    dimension: Dimension
    low: float
    high: float
    default: float | None = None
    role: Role = Role.SHAPE
    scale: float | None = None

    @property
    def spoken(self) -> str:
        """The name in words without its unit, which is another one on a linear axis or of a load that turns."""
        ending = self.dimension.value.lower().replace("(n m)^2", "n2 m2").translate(_IN_NAMES)
        ending = {Dimension.COUNT: "per_rev", Dimension.RATIO: "m_m"}.get(self.dimension, ending)
        return self.name.removesuffix(f"_{ending}").replace("_", " ")


def default_starts(parameter: Parameter, scene: Scene) -> list[float]:
    """Default starting values of a parameter: small but visible."""
    by_role = {
        Role.PHASE: [0.0],
        Role.ORDER: scene.orders,
        Role.PERIOD: scene.friction_periods,
        Role.EDGE: [scene.windows[0][0]],
    }
    if parameter.role in by_role:
        return by_role[parameter.role]
    scales = _Scales(
        0.05 * scene.coulomb, 0.1 * scene.peak_speed, scene.stretch, scene.ratio, scene.travel_m, scene.duration_s
    )
    return [scales.of(parameter.dimension)]


def default_typical(parameter: Parameter, axis: AxisFacts) -> float:
    """Default of a value that is a defect: a fifth of friction, some micrometres."""
    by_role = {Role.PHASE: 0.0, Role.ORDER: 6.0, Role.PERIOD: 0.1, Role.EDGE: 0.5 * axis.duration_s}
    if parameter.role in by_role:
        return by_role[parameter.role]
    scales = _Scales(0.2 * axis.friction, 0.1 / axis.ratio, 3e-6, axis.ratio, 0.1, axis.duration_s)
    return scales.of(parameter.dimension)


class _Scales(NamedTuple):
    """Scales of an axis, in motor units, from which defaults of all dimensions follow."""

    torque: float
    speed: float
    length_m: float
    ratio_m: float
    travel_m: float
    duration_s: float

    def of(self, dimension: Dimension) -> float:
        """Scale of a dimension."""
        return {
            Dimension.TORQUE: self.torque,
            Dimension.MOTOR_SPEED: self.speed,
            Dimension.MOTOR_STIFFNESS: self.torque * self.ratio_m / self.length_m,
            Dimension.MOTOR_DRAG: self.torque / self.speed**2,
            Dimension.INVERSE_TORQUE_SQUARED: 1e-4 / self.torque**2,
            Dimension.ANGLE: 1e-4,
            Dimension.LENGTH: self.length_m,
            Dimension.TIME: 0.02 * self.duration_s,
            Dimension.FORCE: self.torque / self.ratio_m,
            Dimension.STIFFNESS: self.torque / self.ratio_m / self.travel_m,
            Dimension.FREQUENCY: 40.0,
            Dimension.RATIO: 0.05,
            Dimension.PER_LENGTH: 0.1 / self.travel_m,
            Dimension.COUNT: 6.0,
        }[dimension]
