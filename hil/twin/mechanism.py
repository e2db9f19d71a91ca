"""What a mechanism is: a piece of physics the nominal twin leaves out, and where it enters the twin.

Each file of `hil.twin.mechanisms` describes one. Its contribution is a small compiled function of
one signature, whatever the stage:

    contribution(value, at, parameters, memory) -> value

`value` is what the stage hands on (see `Stage`), `at` is the moment (see `Moment`), `parameters` the
mechanism's own values in the order it declares them, `memory` its own WIDTH numbers of state. Units
are those of the motor side: rad and N m, or m and N on a linear axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

PARAMETERS = 8  # the most parameters a mechanism may have; the last place tells its variant
WIDTH = 16  # numbers of state a mechanism may keep


class Block(StrEnum):
    """Block of the bench in which a mismatch can live."""

    CONTROLLER = "controller"
    DRIVE = "drive"
    MOTOR_SIDE = "motor_side"
    TRANSMISSION = "transmission"
    TABLE = "table"
    SENSOR = "sensor"


class Stage(StrEnum):
    """Where a contribution enters the twin, and what its value is there."""

    CURRENT = "current"  # torque command -> torque of the current, as measured
    TORQUE = "torque"  # that torque -> torque on the motor shaft
    MOTOR_TORQUE = "motor_torque"  # + torque on the motor beside the drive's and friction
    COULOMB = "coulomb"  # Coulomb friction level of the axis -> changed level
    FRICTION_SCALE = "friction_scale"  # x factor on all friction: Coulomb, viscous, drag
    DRAG = "drag"  # + torque opposing motion beyond Coulomb and viscous, signed as velocity
    BIAS = "bias"  # + shift of the band [-Fc, Fc] of Coulomb friction
    BRISTLE = "bristle"  # + stiffness of the contact before sliding; 0 is rigid contact
    TABLE_SHARE = "table_share"  # + share of the friction that acts on the table
    TRANSMISSION = "transmission"  # deflection of the transmission [motor units] -> the deflection its
    # nominal spring would need for the same torque
    SCREW = "screw"  # x factor on the stiffness of the screw between its bearing and the nut
    TABLE_FORCE = "table_force"  # + force on the table [N]
    MOTOR_READING = "motor_reading"  # motor position -> what its encoder reads
    TABLE_READING = "table_reading"  # table position -> what its encoder reads
    VELOCITY_FILTER = "velocity_filter"  # time constant of the controller's velocity filter [s]
    CHAIN = "chain"  # changes the chain itself, before its modes are taken
    CHANNEL = "channel"  # changes recorded channels after the simulation


class Moment(NamedTuple):
    """What a contribution may look at: the present state of the axis."""

    time_s: float
    within_s: float  # since the last control tick; 0 at the first internal step of a tick
    period_s: float  # of the control tick
    step_s: float  # internal step
    angle_rad: float  # motor angle, also on a linear axis (screw lead)
    velocity: float  # of the motor, rad/s or m/s
    table_position_m: float
    ratio_m: float  # m of the table per unit of the motor
    viscous_speed: float  # of the motor, at which viscous friction equals Coulomb friction; 0: there is none


class Dimension(StrEnum):
    """What a parameter measures; decides its unit on rotary and on linear axes."""

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

    def unit(self, linear: bool) -> str:
        """The SI unit on a rotary or on a linear axis."""
        return _LINEAR_UNITS.get(self, self.value) if linear else self.value


_LINEAR_UNITS = {
    Dimension.TORQUE: "N",
    Dimension.MOTOR_SPEED: "m/s",
    Dimension.MOTOR_STIFFNESS: "N/m",
    Dimension.MOTOR_DRAG: "N s^2/m^2",
    Dimension.INVERSE_TORQUE_SQUARED: "1/N^2",
}


@dataclass(frozen=True)
class Parameter:
    """A parameter of a mechanism: its name with unit, what it measures, its physical bounds, and what it is where
    nobody gives it (None: it must be given)."""

    name: str
    dimension: Dimension
    low: float
    high: float
    default: float | None = None


@dataclass(frozen=True)
class Mechanism:
    """One piece of physics. `contribution` is compiled (`numba.njit`) for stages in the stepping
    kernel; for Stage.CHAIN it is `(chain, parameters, variant) -> chain`, for Stage.CHANNEL
    `(channels, parameters, variant, period_s) -> channels`, both plain Python."""

    id: str
    block: Block
    element: str  # the part of the axis an engineer would point at
    sentence: str  # what an engineer would say; may name parameters in braces
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    stage: Stage
    contribution: Callable[..., Any]
    variants: tuple[str, ...] = ("",)  # ways it may show: each is weighed in its own right
    softens: bool = False  # whether it changes the stiffness of a spring of the chain
    play: bool = False  # in the second variant the flanks of the transmission push only
    slips: bool = False  # in the second variant the contact is of Maxwell slip elements
    second_stage: Stage | None = None  # where the second variant enters, if elsewhere
    most: int = 1  # times that it may act at once, with periods or orders of their own
    second_sentence: str = ""  # of the second variant, if it says something else; may name viscous_speed too

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    def complete(self, values: Sequence[float]) -> tuple[float, ...]:
        """Values of the first parameters, and the defaults of the others; raises ValueError if one has none."""
        rest = [parameter.default for parameter in self.parameters[len(values) :]]
        if any(value is None for value in rest):
            raise ValueError(f"{self.id}: given {len(values)} values, allowed {', '.join(self.names)}")
        return (*values, *(value for value in rest if value is not None))
