"""Definition of a mechanism: a piece of physics that the nominal twin leaves out, and its stage in the twin.

Each file of `hil.twin.mechanisms` describes one. Its contribution is a small compiled function of one signature:

    contribution(value, at, parameters, memory) -> value

with the value of the stage (see `Stage`), the moment (see `Moment`), the parameters of the mechanism in their declared
order, and its own WIDTH numbers of state. Units are those of the motor side: rad and N m, or m and N on a linear axis.
"""

import math
from collections.abc import Callable, MutableSequence, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from typing import Any, NamedTuple

from hil.arrays import FloatArray
from hil.twin.parameter import Dimension, Parameter, Role, default_starts, default_typical
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts, Scene

PARAMETERS = 8  # the most parameters a mechanism may have
WIDTH = 16  # numbers of state a mechanism may keep
Row = MutableSequence[float]  # (PARAMETERS,) or (WIDTH,), a row of an array


class Block(StrEnum):
    """Block of the bench in which a mismatch can live."""

    CONTROLLER = "controller"
    DRIVE = "drive"
    MOTOR_SIDE = "motor_side"
    TRANSMISSION = "transmission"
    TABLE = "table"
    SENSOR = "sensor"


class Stage(StrEnum):
    """Stage of the twin at which a contribution enters, and its value there."""

    CURRENT = "current"  # torque command -> torque of the current, as measured
    TORQUE = "torque"  # that torque -> torque on the motor shaft
    MOTOR_TORQUE = "motor_torque"  # + torque on the motor beside the drive's and friction
    COULOMB = "coulomb"  # Coulomb friction level of the axis -> changed level
    FRICTION_SCALE = "friction_scale"  # x factor on all friction: Coulomb, viscous, drag
    VISCOUS_SCALE = "viscous_scale"  # x factor on viscous friction alone
    DRAG = "drag"  # + torque opposing motion beyond Coulomb and viscous, signed as velocity
    BIAS = "bias"  # + shift of the band [-Fc, Fc] of Coulomb friction
    BRISTLE = "bristle"  # + stiffness of the contact before sliding; 0 is rigid contact
    TABLE_SHARE = "table_share"  # + share of the friction that acts on the table
    TABLE_VISCOUS_SHARE = "table_viscous_share"  # that share -> share of the viscous friction
    TRANSMISSION = "transmission"  # deflection [motor units] -> that of the nominal spring for the same torque
    SCREW = "screw"  # x factor on the stiffness of the screw between its bearing and the nut
    TABLE_FORCE = "table_force"  # + force on the table [N]
    MOTOR_READING = "motor_reading"  # motor position -> reading of its encoder
    TABLE_READING = "table_reading"  # table position -> reading of its encoder
    VELOCITY_FILTER = "velocity_filter"  # time constant of the controller's velocity filter [s]
    CHAIN = "chain"  # changes the chain itself, before its modes are taken
    CHANNEL = "channel"  # changes recorded channels that the controller reads, after the simulation
    ANSWER = "answer"  # changes a recorded channel that no block reads


class Moment(NamedTuple):
    """Present state of the axis, as a contribution sees it."""

    time_s: float
    within_s: float  # since the last control tick; 0 at the first internal step of a tick
    period_s: float  # of the control tick
    step_s: float  # internal step
    angle_rad: float  # motor angle, also on a linear axis (screw lead)
    velocity: float  # of the motor, rad/s or m/s
    table_position_m: float
    ratio_m: float  # m of the table per unit of the motor
    viscous_speed: float  # of the motor, at which viscous friction equals Coulomb friction; 0: there is none
    torque: float = 0.0  # of the motor less viscous friction and drag; for friction


class Contact(StrEnum):
    """Contact that the kernel computes in another way, by the name of its switch."""

    PLAY = "play"  # the flanks of the transmission push only: contacts open and close
    SLIPS = "slips"  # friction of Maxwell slip elements


Points = Sequence[tuple[float, ...]]
_AT_BOUND = 1e-6  # of the upper bound: a fit ends there or far below
_ROUNDING = 1e-15  # of the upper bound: rounding of a fit that ends at the lower one


@dataclass(frozen=True)
class Text:
    """Finding in an engineer's words; names parameters, viscous_speed, wave and variant in braces."""

    sentence: str
    picture: Picture = Picture.TIME  # of all variants
    reversed: str = ""  # of a negative strength, which it gives without the sign; without: `sentence`
    rate: str = ""  # where the time in which a change ends is not told: names its strength per minute, {rate}
    # (number of windows, True at equal intervals, True if each is against the motion) -> sentence of an event; may also
    # name count, and width and period
    of_windows: Callable[[int, bool, bool], str] | None = None


@dataclass(frozen=True)
class Variant:
    """Form of a mechanism, searched separately; text, element and starts replace those of the mechanism.

    `contribution` is compiled (`numba.njit`) for stages of the stepping kernel. For the others it is plain Python: for
    Stage.CHAIN `(chain, parameters) -> chain`, for CHANNEL and ANSWER `(channels, parameters, period_s) -> channels`.
    """

    stage: Stage
    contribution: Callable[..., Any]
    name: str = ""
    text: Text | None = None
    element: str = ""
    starts: Callable[[Scene], Points] | None = None
    proportional: bool = True  # the change is proportional to the strength
    observable: Callable[[bool], bool] | None = None  # (the axis has a table encoder) -> its encoders show it
    moves_torque: bool = False  # in time against the motion: not searched where the bench leaves torque_delay_s open
    contact: Contact | None = None


@dataclass(frozen=True)
class SearchHints:
    """Starting values of a search, and its relations to other mechanisms; changes the way to an answer."""

    starts: Callable[[Scene], Points] | None = None  # parameter values at which a search begins
    typical: Callable[[AxisFacts], tuple[float, ...]] | None = None  # values that an engineer calls a defect
    proportional: bool = True  # the change is proportional to the strength
    needs_table: bool = False  # not observable without a linear encoder
    shifts_time: bool = False  # many values are local minima: starts are ranked at their own values
    screw_locked: bool = False  # at one slow speed, a share of Coulomb friction that repeats with the screw
    beside: str = ""  # id of a mechanism without which this one is seldom seen: fitted together if it leaves more
    # (largest stretch of the transmission [m]) -> starts from the bench file's springs: refitted ones hide the effect
    restarts: Callable[[float], Points] = lambda stretch_m: ()
    # (values, variant, other) -> values at which the other variant has nearly the same effect
    as_variant: Callable[[Sequence[float], int, int], Sequence[float]] = lambda values, variant, other: values
    # (variant) -> rank: a variant of lower rank is named unless one of higher rank leaves clearly less energy
    rank: Callable[[int], int] = lambda variant: 0


@dataclass(frozen=True)
class Mechanism:
    """One mechanism for twin, search, report and scoring; what it alone needs is a function of its own, not a flag.

    Its fields are its physics. Without hints, `starts` and `typical` follow from the dimensions and roles of the
    parameters.
    """

    id: str
    block: Block
    element: str  # the part of the axis an engineer would point at
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    variants: tuple[Variant, ...]
    text: Text
    search: SearchHints = SearchHints()
    can_be: Callable[[Sequence[float], int, AxisFacts], bool] | None = None  # values, variant, axis
    # (values, axis) -> the law is another mechanism's there, a more frequent cause: its equal, and no name
    is_another: Callable[[Sequence[float], AxisFacts], bool] | None = None
    # (values, axis) -> a rare cause there: another one is named unless the recordings tell them apart
    is_rare: Callable[[Sequence[float], AxisFacts], bool] = lambda values, axis: False
    # (values, axis) -> id and values of the mechanism that it is where it is no name; without: none
    beyond: Callable[[Sequence[float], AxisFacts], tuple[str, tuple[float, ...]]] | None = None
    # (variant) -> id of a rarer cause whose first variant is the same torque on every motion; "" without one
    same_torque: Callable[[int], str] = lambda variant: ""
    # (variant) -> id of a friction law whose form a small contribution corrects; "" without one
    corrects: Callable[[int], str] = lambda variant: ""
    neutral: Callable[[AxisFacts], float] | None = None  # strength without effect, also infinite; without: 0
    # (values, axis) -> travel that tells it [m]; without: its wavelength
    told_by_m: Callable[[Sequence[float], AxisFacts], float] | None = None
    # (start of each tick (n,) [s], period [s], values) -> mean force on the table [N]: an event of one recording
    over_time: Callable[[FloatArray, float, Sequence[float]], FloatArray] | None = None
    turning: bool = False  # only where the load turns
    softens: bool = False  # changes the stiffness of a spring of the chain
    most: int = 1  # number that may act at once, with periods or orders of their own, or as different variants

    @property
    def transient(self) -> bool:
        """True for an event of one recording."""
        return self.over_time is not None

    @property
    def in_transmission(self) -> bool:
        """True if it acts between motor and table, which are one mass on a rigid axis."""
        return all(variant.stage in (Stage.TRANSMISSION, Stage.SCREW) for variant in self.variants)

    @property
    def shifts_phase(self) -> bool:
        """True for a delay, a lag or a resonance: no function of position, speed, load or time."""
        return self.parameters[self.strength].dimension is Dimension.TIME or self.variants[0].stage is Stage.CHAIN

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def forms(self) -> tuple[str, ...]:
        """Names of its variants, in order."""
        return tuple(variant.name for variant in self.variants)

    def indices(self, role: Role) -> list[int]:
        """Indices of the parameters of a role."""
        return [index for index, parameter in enumerate(self.parameters) if parameter.role is role]

    def named(self, role: Role, values: Sequence[float]) -> float | None:
        """Value of the first parameter of a role; None if there is none."""
        return next((values[index] for index in self.indices(role)), None)

    @property
    def strength(self) -> int:
        """Index of the parameter that is the size of the effect."""
        return next(iter(self.indices(Role.STRENGTH)), 0)

    def complete(self, values: Sequence[float]) -> tuple[float, ...]:
        """Values of the first parameters, and the defaults of the others; raises ValueError if one has none."""
        rest = [parameter.default for parameter in self.parameters[len(values) :]]
        if any(value is None for value in rest):
            raise ValueError(f"{self.id}: given {len(values)} values, allowed {', '.join(self.names)}")
        return (*values, *(value for value in rest if value is not None))

    def start_points(self, variant: int, scene: Scene) -> list[tuple[float, ...]]:
        """Parameter values (points of `names`) at which a search for a variant begins, within bounds."""
        given = self.variants[variant].starts or self.search.starts
        points = given(scene) if given else product(*(default_starts(p, scene) for p in self.parameters))
        return [self._inside(point) for point in points]

    def typical_values(self, axis: AxisFacts) -> tuple[float, ...]:
        """Values that an engineer would call a defect."""
        if self.search.typical:
            return self.search.typical(axis)
        return self._inside([default_typical(p, axis) for p in self.parameters])

    def element_of(self, variant: int) -> str:
        """The part of the axis that a variant points at."""
        return self.variants[variant].element or self.element

    def is_claimable(self, values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
        """Check that the effect is possible, and that its name applies."""
        return self.is_possible(values, variant, axis) and not (self.is_another and self.is_another(values, axis))

    def is_possible(self, values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
        """Check that the effect has a size, that the motion tells it, and that the sensors can show it."""
        if not self._has_size(values):
            return False
        if (self.told_by_m or self.wavelength_m)(values, axis) > axis.travel_m:
            return False
        if not axis.turn_known and self.once_per_turn:
            return False
        return self.can_be is None or self.can_be(values, variant, axis)

    def wavelength_m(self, values: Sequence[float], axis: AxisFacts) -> float:
        """Length along the travel in which the effect repeats [m]; 0 if it is not periodic in position or angle.

        With a phase but no period or order it repeats once per revolution, of the load if it turns.
        """
        period_m = self.named(Role.PERIOD, values)
        if period_m is not None:
            return period_m
        turn_m = 2.0 * math.pi * (1.0 if self.turning else axis.ratio / axis.angle_per_unit)
        order = self.named(Role.ORDER, values)
        return turn_m / order if order else turn_m if self.once_per_turn else 0.0

    @property
    def once_per_turn(self) -> bool:
        """True if it has a phase, but no period, order or line: it repeats once per revolution."""
        others = (Role.PERIOD, Role.ORDER, Role.LINE)
        return bool(self.indices(Role.PHASE)) and not any(self.indices(role) for role in others)

    def size(self, values: Sequence[float], axis: AxisFacts) -> float:
        """Distance of the strength from the value without effect, in the unit of the strength."""
        neutral = self.neutral(axis) if self.neutral else 0.0
        return abs(values[self.strength] - (neutral if math.isfinite(neutral) else 0.0))

    @property
    def neutral_at_zero(self) -> bool:
        """True if it is without effect where the strength is zero."""
        return self.neutral is None

    def _has_size(self, values: Sequence[float]) -> bool:
        """Check that a strength is off the bound at which there is no effect, and off its largest value.

        A share may be the whole; at another bound the recordings do not tell the strength.
        """
        sizes = [(v, p) for v, p in zip(values, self.parameters, strict=False) if p.role is Role.STRENGTH]
        if any(
            abs(v) >= (1.0 - _AT_BOUND) * abs(end) > 0.0 and v * end > 0.0
            for v, p in sizes
            for end in (p.low, p.high)
            if p.dimension is not Dimension.RATIO or abs(end) != 1.0
            if end == p.high or end < 0.0
        ):
            return False
        return not self.neutral_at_zero or any(abs(v - max(p.low, 0.0)) > _ROUNDING * p.high for v, p in sizes)

    def _inside(self, values: Sequence[float]) -> tuple[float, ...]:
        return tuple(min(max(value, p.low), p.high) for value, p in zip(values, self.parameters, strict=True))
