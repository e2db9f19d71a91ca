"""Parts of the mass of a two-mass axis: of the motor, of the load.

Below the resonance of the transmission recordings tell the sum, and load over stiffness, but not the parts. What the
owner says of them does, a few per cent off. Of two that are told the ratio counts: the recordings tell the sum.
"""

from dataclasses import replace
from math import hypot, pi
from typing import NamedTuple

from hil.identification.least_squares import Estimate
from hil.importing.lexicon import Constant
from hil.quantities import quantity
from hil.recording.recording import NOMINAL, Recording

_OWNER = 0.1  # of the smaller part: data sheets and weighed parts are a few per cent off
_LEAST = 1e-3  # share of a part: less is an error of a unit, or of the sum


class Split(NamedTuple):
    """Parts of a total, motor first; `how` they were found; `told` by the owner, of them the load itself is `held`."""

    motor: Estimate
    load: Estimate
    how: str
    told: bool = False
    held: bool = False

    def lighter(self, factor: float) -> "Split":
        """The same total with the load times a factor, as the friction of the load asks for."""
        load = self.load.scaled(factor)
        motor = replace(self.motor, value=self.motor.value + self.load.value - load.value)
        return Split(motor, load, "not told; of a load as heavy as the motor the friction would be more than all")


def nominal_sum(recording: Recording, lead_m: float, turns: bool) -> Estimate | None:
    """Inertia of the whole axis at the motor [kg m^2] as the owner tells it; None without one of the parts."""
    motor, load = _parts(recording, lead_m, turns)
    return Estimate(motor + load, _OWNER * (motor + load), "as the owner tells") if motor and load else None


def _parts(recording: Recording, lead_m: float, turns: bool) -> tuple[float, float]:
    """Inertia of motor and load at the motor [kg m^2] as the owner tells them; 0: not told."""
    told, factor = recording.metadata.get(NOMINAL, {}), (lead_m / (2.0 * pi)) ** 2
    load = told.get(Constant.LOAD_INERTIA if turns else Constant.LOAD_MASS, 0.0)
    return told.get(Constant.MOTOR_INERTIA, 0.0), factor * load


def split_of(total: Estimate, recording: Recording, lead_m: float, turns: bool) -> Split:
    """Parts of a total inertia, in units of the motor [kg m^2]: by the owner's words, else half and half."""
    motor, load = _parts(recording, lead_m, turns)
    share = load / (load + motor) if load and motor else load / total.value if load else 1.0 - motor / total.value
    told = recording.metadata.get(NOMINAL, {})
    of = (Constant.LOAD_INERTIA if turns else Constant.LOAD_MASS, Constant.MOTOR_INERTIA)
    words = ", ".join(
        f"{quantity(told[key], unit)} {whose}" for key, whose, unit in _WORDS if key in of and key in told
    )
    if not words or not _LEAST < share < 1.0 - _LEAST:
        half = replace(total.scaled(0.5), std_error=0.5 * total.value)  # as large as the half itself
        refused = f"what the owner tells does not fit it: {words}" if words else "the split is not told"
        return Split(half, half, f"half of the sum: {refused}")
    error = hypot(_OWNER * min(share, 1.0 - share) * total.value, total.std_error)
    motor_part, load_part = (replace(total, value=one * total.value, std_error=error) for one in (1.0 - share, share))
    return Split(motor_part, load_part, f"split of the sum as the owner tells: {words}", True, bool(load))


_WORDS = (
    (Constant.LOAD_MASS, "of the load", "kg"),
    (Constant.LOAD_INERTIA, "of the load", "kg m^2"),
    (Constant.MOTOR_INERTIA, "of the motor", "kg m^2"),
)
