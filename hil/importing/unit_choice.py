"""Choose the units of columns: by their names, by their relations to columns with a unit, else by their size."""

import re
from dataclasses import dataclass
from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.importing.column_names import Label
from hil.importing.lexicon import lexicon
from hil.quantities import UNITS

MATCH = 0.02  # relative deviation of a factor between two columns from that of two units: above following errors
LENGTHS = ("m", "mm", "um", "in")
ANGLES = ("rad", "deg", "rev", "mrad")
LINEAR_SPEEDS = ("m/s", "mm/s", "m/min", "mm/min")
ANGULAR_SPEEDS = ("rad/s", "deg/s", "rpm", "rev/s")
# Largest travel read in a unit: axes travel metres at most, joints a few turns
_LONGEST_M, _MOST_RAD = 5.0, 13.0
_WHOLE = 1e-5  # relative deviation from whole quarters of a turn: that of six digits
_LEAST_COUNTS = 200.0  # travel in whole numbers from which they are counts of an encoder
_COORDINATE = r"q(pos)?\d*([_ ].*)?"  # joint angle, as robotics writes it: q, q1, q_ref
_JOINT_STATE = r"(^|[^a-z])effort(\W|_?\d|$)"  # effort, effort[0], .effort0, effort_0, effort.elbow


@dataclass(frozen=True)
class UnitChoice:
    """A unit, and a note if it is not sure."""

    unit: str
    note: str = ""


def is_length(unit: str) -> bool:
    """True for a unit of length or of linear speed."""
    return UNITS.get(unit, ("", 1.0))[0] in ("m", "m/s")


def are_counts(values: FloatArray) -> bool:
    """True for whole numbers that travel far."""
    return bool(np.ptp(values) > _LEAST_COUNTS and np.all(values == np.round(values)))


def gives_force(effort: Label | None) -> bool:
    """True if the motor gives a force."""
    return effort is not None and effort.unit in ("N", "kN")


def prefers_length(positions: list[str], effort: Label | None) -> bool | None:
    """True for a length, False for an angle, by the names of the positions or the unit of the effort; else None."""
    words = " ".join(positions).lower()
    if gives_force(effort):
        return True
    if any(re.fullmatch(_COORDINATE, name.lower()) for name in positions) or any(
        word in words for word in lexicon().angle
    ):
        return False
    if any(word in words for word in lexicon().length):
        return True
    return False if effort and UNITS.get(effort.unit or "", ("",))[0] == "N m" else None


def unit_by_convention(effort: Label | None) -> UnitChoice | None:
    """rad where a torque without a unit is called effort, as in sensor_msgs/JointState of ROS."""
    if effort is None or effort.unit or not re.search(_JOINT_STATE, effort.column.lower()):
        return None
    return UnitChoice("rad", f"{effort.column}: named as in a joint state of ROS; rad and N m are taken")


def unit_of_nameless(column: str, values: FloatArray) -> UnitChoice | None:
    """SI for a position (n,) in a file without names and units: rad, where it is too far for m; None for counts."""
    if are_counts(values):
        return None
    unit = "m" if np.ptp(values) < _LONGEST_M else "rad"
    return UnitChoice(
        unit, f"{column}: no column has a name or a unit; SI is taken, {unit} for a travel of {np.ptp(values):.4g}"
    )


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
    travel = float(np.ptp(values))
    if are_counts(values):
        return UnitChoice("counts", f"{column}: whole numbers, taken for counts")
    if prefers_length is None:  # this program is for linear axes first
        return _by_size(column, travel, length=True, why="angle or length is not said")
    return _by_size(column, travel, prefers_length, "no unit is given")


def _by_size(column: str, travel: float, length: bool, why: str) -> UnitChoice:
    small, large, most = ("m", "mm", _LONGEST_M) if length else ("rad", "deg", _MOST_RAD)
    quarters = travel / (0.5 * pi)
    whole = not length and abs(quarters - round(quarters)) < _WHOLE * quarters  # of a set-point in radians
    unit = small if travel < most or whole else large
    asked = "" if length else f"; is it {large if unit == small else small}? Speed, inertia and friction scale with it"
    return UnitChoice(unit, f"{column}: {why}; {unit} is taken for a travel of {travel:.4g}{asked}")


def misfit(factor: float, unit: str, other: str) -> float:
    """Ratio by which values in `unit` = factor x values in `other` contradict the two units; 1 if they agree."""
    return abs(factor) * UNITS[unit][1] / UNITS[other][1]
