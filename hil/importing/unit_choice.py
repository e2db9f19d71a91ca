"""Choose the units of columns: by their names, by their relations to columns with a unit; else they are asked."""

import re
from dataclasses import dataclass
from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.importing.column_names import Label
from hil.importing.lexicon import lexicon
from hil.quantities import ROTARY_LEAD_M, UNITS

MATCH = 0.02  # relative deviation of a factor between two columns from that of two units: above following errors
LENGTHS = ("m", "mm", "um", "in")
ANGLES = ("rad", "deg", "rev", "mrad")
LINEAR_SPEEDS = ("m/s", "mm/s", "m/min", "mm/min")
ANGULAR_SPEEDS = ("rad/s", "deg/s", "rpm", "rev/s")
_WHOLE = 1e-5  # relative deviation from whole quarters of a turn: that of six digits
_MOST_QUARTERS = 40  # among more, some are whole by chance
_LONGEST_M = 5.0  # largest travel read as metres
_LEAST_COUNTS = 200.0  # travel in whole numbers from which they are counts of an encoder
_COORDINATE = r"q(pos)?\d*([_ ].*)?"  # joint angle, as robotics writes it: q, q1, q_ref
_JOINT_STATE = r"(^|[^a-z])effort(\W|_?\d|$)"  # effort, effort[0], .effort0, effort_0, effort.elbow


@dataclass(frozen=True)
class UnitChoice:
    """A unit, and a note if it is not sure; `asked`: nothing tells it, and the user must."""

    unit: str
    note: str = ""
    asked: bool = False


def is_length(unit: str) -> bool:
    """True for a unit of length or of linear speed."""
    return UNITS.get(unit, ("", 1.0))[0] in ("m", "m/s")


def are_counts(values: FloatArray) -> bool:
    """True for whole numbers that travel far."""
    return bool(np.ptp(values) > _LEAST_COUNTS and np.all(values == np.round(values)))


def prefers_length(positions: list[str], effort: Label | None, turns: bool = False) -> bool | None:
    """True for a length, False for an angle, by the names of the positions or the effort, which `turns`; else None."""
    words = " ".join(positions).lower()
    if effort is not None and effort.si == "N":
        return True
    if any(re.fullmatch(_COORDINATE, name.lower()) for name in positions) or any(
        word in words for word in lexicon().angle
    ):
        return False
    if any(word in words for word in lexicon().length):
        return True
    return False if turns else None


def is_joint_state(effort: Label) -> bool:
    """True if a torque without a unit is called effort, as in sensor_msgs/JointState of ROS: rad and N m."""
    return effort.unit is None and re.search(_JOINT_STATE, effort.column.lower()) is not None


def unit_by_convention(effort: Label | None) -> UnitChoice | None:
    """rad beside the effort of a joint state."""
    if effort is None or not is_joint_state(effort):
        return None
    return UnitChoice("rad", f"{effort.column}: named as in a joint state of ROS; rad and N m are taken")


def unit_of_nameless(column: str, values: FloatArray) -> UnitChoice | None:
    """SI for a position (n,) in a file without names and units: rad, where it is too far for m; None for counts."""
    if are_counts(values):
        return None
    unit = "m" if np.ptp(values) < _LONGEST_M else "rad"
    return UnitChoice(unit, asked=True)


def position_unit(
    column: str, values: FloatArray, named: str | None, hints: list[tuple[float, str]], prefers_length: bool | None
) -> UnitChoice:
    """Unit of a position (n,).

    `hints` are (factor, unit): values = factor x a column in that unit (a position, or the integral of a velocity);
    `prefers_length` is what other columns say of the axis, None if nothing.
    """
    if named is not None:
        return UnitChoice(named)
    for factor, unit in hints:
        si, known = UNITS.get(unit, (None, 1.0))
        for candidate in (*LENGTHS, *ANGLES):
            own_si, own = UNITS[candidate]
            if own_si == si and abs(abs(factor) * own / known - 1.0) < MATCH:
                return UnitChoice(candidate, f"{column}: {candidate}, by its factor to a column in {unit}")
    for factor, unit in hints:
        gear = max(abs(factor), 1.0 / abs(factor)) if factor and unit in ANGLES and not prefers_length else 0.0
        if round(gear) > 1 and abs(gear - round(gear)) < MATCH:
            return UnitChoice(unit, f"{column}: {unit}, by a gear of {round(gear)} to a column in {unit}")
    if are_counts(values):
        return UnitChoice("counts", f"{column}: whole numbers, taken for counts")
    if prefers_length is False and (unit := _by_whole_turns(float(np.ptp(values)))):
        return UnitChoice(unit, f"{column}: {unit}, by its travel of whole quarters of a turn")
    return UnitChoice("rad" if prefers_length is False else "m", asked=True)


def _by_whole_turns(travel: float) -> str:
    """Unit in which the travel of a set-point is whole quarters of a turn: rad or deg; "" without one."""
    for unit, quarter in (("rad", 0.5 * pi), ("deg", 90.0)):
        quarters = travel / quarter
        if 0 < round(quarters) <= _MOST_QUARTERS and abs(quarters - round(quarters)) < _WHOLE * quarters:
            return unit
    return ""


def misfit(factor: float, unit: str, other: str) -> float:
    """Ratio by which values in `unit` = factor x values in `other` contradict the two units; 1 if they agree."""
    return abs(factor) * UNITS[unit][1] / UNITS[other][1]


def travel_per_unit(unit: str, lead_m: float) -> float:
    """Length [m] per unit of a motor's position: of an angle by the lead of its screw; 1 without one."""
    si, factor = UNITS[unit]
    if si != "rad":
        return factor
    return lead_m / (2.0 * pi) * factor if lead_m != ROTARY_LEAD_M else 1.0
