"""Plant and transmission of an axis as its recordings tell them, without a twin and without a control law."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import pi

import numpy as np

from hil.channels import AxisKind
from hil.drafting.assumed_plant import plant_or_assumed
from hil.drafting.plant_values import PlantValues, TransmissionValues, plant_values, transmission_values
from hil.drafting.ratio_values import lead_of
from hil.drafting.split import nominal_sum
from hil.errors import InputError
from hil.identification.derived_channels import with_position
from hil.identification.least_squares import Estimate
from hil.quantities import ROTARY_LEAD_M
from hil.recording.recording import Recording

LONGEST_LEAD_M = 1.0  # that a bench file takes; a load that turns as far as its motor, 1 m for 1 rad, has 6.3
_MOVES = 0.1  # of the travel of the part that moves farthest, from which a part tells ratio and control law


@dataclass(frozen=True, eq=False)
class PlantTold:
    """Values at the motor, second encoder and lead of the longest part; `turns`: the load turns, its lead is 2 pi."""

    plant: PlantValues
    transmission: TransmissionValues | None
    lead: Estimate | None  # None on a linear axis
    turns: bool


def moving_parts(recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Parts between gaps in time, with a position each; first the longest one that moves.

    Raises InputError for recordings of different kinds or channels.
    """
    parts = [part for recording in recordings for part in with_position(recording).parts()]
    first = parts[0]
    for part in parts:
        missing = {first.axis.motor_position, first.axis.torque, first.axis.table_position} & set(first.columns)
        if missing := missing - set(part.columns):
            raise InputError(
                f"{part.name}: {', '.join(sorted(missing))} is not recorded as in {first.name}, allowed are recordings "
                "of one axis with the same channels; leave one out"
            )
    travels = [float(np.ptp(part[part.axis.motor_position])) for part in parts]
    moving = [part for part, travel in zip(parts, travels, strict=True) if travel >= _MOVES * max(travels)]
    longest = max(moving, key=len)
    return (longest, *(part for part in parts if part is not longest))


@lru_cache(maxsize=2)
def plant_told(parts: tuple[Recording, ...]) -> PlantTold:
    """Values of recordings without gaps, the first of which tells lead and transmission.

    Raises InputError: no torque, no rows that slide, no positive inertia.
    """
    recording = parts[0]
    transmission = transmission_values(recording)
    if recording.kind is AxisKind.LINEAR:
        return PlantTold(plant_values(parts), transmission, None, False)
    lead = lead_of(recording, transmission)
    turns = recording.metadata.get("lead_m") == ROTARY_LEAD_M or lead.value > LONGEST_LEAD_M
    nominal = nominal_sum(recording, lead.value, turns)
    plant = plant_or_assumed(parts, transmission, lead.value / (2.0 * pi) if turns else None, nominal)
    if plant.gravity_angle is not None and transmission is not None:  # it bends what the ratio is measured over
        transmission = transmission_values(recording, plant.gravity_angle.value)
        lead = lead_of(recording, transmission)
    return PlantTold(plant, transmission, lead, turns)
