"""Quantities of the condition of an axis: names, units, the vendors' test of the same, and what change counts."""

from collections.abc import Sequence
from dataclasses import dataclass

FRICTION, BACKLASH, EQUABILITY = "friction test", "backlash test", "equability test"
STIFFNESS, QUADRANT = "stiffness test", "quadrant error"
FREQUENCY = "frequency response"
NO_RESPONSE = "a check motion does not excite it: record one with an excitation and call hil frf"


@dataclass(frozen=True)
class ConditionQuantity:
    """A quantity of the condition.

    `worse`: 1 if more of it is worse, -1 if less is, 0 if any change is. `limit`: change that calls for a look, in the
    unit of the quantity, or as a share of the first level if `relative`. These limits rank axes and alarm nobody; an
    owner who knows better ones sorts by the numbers.
    """

    name: str
    label: str
    test: str
    unit: str  # SI; "torque" and so on stand for the units of the axis
    worse: int
    limit: float
    relative: bool = False

    def unit_of(self, linear: bool) -> str:
        """SI unit on a linear or a rotary axis."""
        return _UNITS.get(self.unit, (self.unit, self.unit))[linear]


_UNITS = {"torque": ("N m", "N"), "viscous": ("N m s/rad", "N s/m"), "inertia": ("kg m^2", "kg")}

QUANTITIES: Sequence[ConditionQuantity] = (
    ConditionQuantity("coulomb_forward", "Coulomb friction, forward", FRICTION, "torque", 1, 0.3, relative=True),
    ConditionQuantity("coulomb_back", "Coulomb friction, back", FRICTION, "torque", 1, 0.3, relative=True),
    ConditionQuantity("viscous_forward", "viscous friction, forward", FRICTION, "viscous", 1, 0.5, relative=True),
    ConditionQuantity("viscous_back", "viscous friction, back", FRICTION, "viscous", 1, 0.5, relative=True),
    ConditionQuantity("ripple", "torque unlike the friction line (rms)", EQUABILITY, "torque", 1, 1.0, relative=True),
    ConditionQuantity("reversal", "reversal difference of the encoders", BACKLASH, "m", 1, 10e-6),
    ConditionQuantity("quadrant", "peak of the following error after reversals", QUADRANT, "m", 1, 0.5, relative=True),
    ConditionQuantity("stiffness", "stiffness of the transmission", STIFFNESS, "N/m", -1, 0.2, relative=True),
    ConditionQuantity("lead_error", "lead error, once per turn", "", "m", 1, 5e-6),
    ConditionQuantity("lead_slope", "lead against its nominal value", "", "m/m", 0, 50e-6),
    ConditionQuantity("table_delay", "table encoder later than the motor's", "", "s", 0, 100e-6),
    ConditionQuantity("torque_delay", "torque later than the motion", "", "s", 0, 500e-6),
    ConditionQuantity("inertia", "inertia that moves", "", "inertia", 0, 0.1, relative=True),
    ConditionQuantity("twin_left", "torque that the twin leaves", "", "1", 1, 0.1),
)
BY_NAME = {one.name: one for one in QUANTITIES}


@dataclass(frozen=True)
class Told:
    """Value and standard error of a quantity by one recording, SI; without a value the reason."""

    value: float | None = None
    error: float | None = None
    reason: str = ""
