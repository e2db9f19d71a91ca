"""Map entry of a torque, force, current or voltage: unit, constant and sign."""

import re
from dataclasses import dataclass, field

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AxisKind
from hil.identification.derivatives import MeasuredMotion
from hil.identification.least_squares import LinearFit
from hil.importing.column_names import Label
from hil.importing.foreign_table import ForeignTable
from hil.importing.lexicon import Constant, lexicon
from hil.importing.questions import effort_unit
from hil.importing.relations import proportional
from hil.importing.unit_choice import is_joint_state
from hil.quantities import UNITS

CAUSED = 0.3  # share of an effort explained by its motion from which its sign can be judged
TOGETHER = 0.25  # share of the variance that torque and command have in common, from which they have one cause
_UNKNOWN = "(if nobody knows it, write 1: inertia and friction are then multiples of the true ones)"
PART = 0.1  # of the effort: the inertia's part must exceed it, else the sign of friction decides


@dataclass
class EffortEntry:
    """Keys of the map beside the column, notes on what is unsure, and the keys that are asked, with what they are."""

    keys: dict[str, object]
    notes: list[str] = field(default_factory=list)
    asked: dict[str, str] = field(default_factory=dict)


def effort_entry(told: Label, kind: AxisKind, table: ForeignTable, cause: LinearFit, sign: int) -> EffortEntry:
    """Entry of an effort. `cause` is what `relations.driven` gives for it, `sign` what `signs_of` does."""
    entry = _entry(told, kind, table)
    if cause.share < CAUSED:
        entry.notes.append(
            f"{told.column}: inertia and friction of the motion explain only {100 * max(cause.share, 0.0):.0f} % "
            "of it; check that it drives this axis"
        )
    if sign < 0:
        entry.keys["sign"] = -1
        entry.notes.append(f"{told.column}: positive values accelerate backwards; its sign is turned")
    return entry


def signs_of(efforts: list[FloatArray], causes: list[LinearFit], moved: MeasuredMotion) -> list[int]:
    """Signs with which efforts (n,) of one axis accelerate forwards.

    A measured torque and its command have one cause: the motion decides on the sign of the one that it explains better,
    and their relation on that of the other. What another axis does to this one may turn the sign of one of them.
    """
    signs = [_sign(cause.values, moved) if cause.share >= CAUSED else 1 for cause in causes]
    if len(efforts) == 2:
        relation = proportional(*efforts)
        if relation.share > TOGETHER:
            first = int(np.argmax([cause.share for cause in causes]))
            signs[1 - first] = signs[first] * int(np.sign(relation.factor))
    return signs


def _sign(coefficients: FloatArray, moved: MeasuredMotion) -> int:
    inertia, viscous, coulomb = coefficients[:3]
    parts = np.array(
        [
            inertia * np.std(moved.acceleration),
            viscous * np.std(moved.velocity) + coulomb * np.mean(moved.velocity != 0),
        ]
    )
    deciding = parts[0] if abs(parts[0]) > PART * np.abs(parts).max() else parts[1]
    return -1 if deciding < 0.0 else 1


def _entry(told: Label, kind: AxisKind, table: ForeignTable) -> EffortEntry:
    """Unit and constant: of the column, of the file, else asked."""
    unit, column, constants = told.unit or told.electric, told.column, table.constants
    linear = kind is AxisKind.LINEAR
    si, key = ("N", "force_constant_n_a") if linear else ("N m", "torque_constant_n_m_a")
    entry = EffortEntry({"unit": unit or si})
    if unit in ("mA", "mV"):
        unit = unit[1:]
        entry.keys |= {"unit": unit, "scale": 1e-3}
    if unit in UNITS:
        if UNITS[unit][0] != si:  # a force on a lever, or a torque beside a motion that is no turn
            entry.keys |= {"unit": si, "scale": UNITS[unit][1]}
            entry.asked["scale"] = f"is in {unit}, the axis in {si}; write the {si} per {unit}"
        return entry
    if unit in ("%", "permille"):
        rated, text = _rated(told, linear, table)
        entry.keys["rated"] = float(f"{rated:.12g}")
        if text:
            entry.notes.append(f"{column}: its constant is taken from the header of the file: {text}")
        else:
            screw = _screw("the N m at 100 %") if linear else ""
            whole = "current" if told.electric else "force" if linear else "torque"
            of = f"of the rated or the largest {whole}, as the drive has it"
            entry.asked["rated"] = f"is in {unit} {of}; write the {si} at 100 % {_UNKNOWN}{screw}"
        return entry
    size, per_unit = "gain", Constant.FORCE_GAIN if linear else Constant.TORQUE_GAIN
    if unit == "A":
        size, per_unit = key, Constant.FORCE if linear else Constant.TORQUE
    header = constants.get(per_unit) if unit in ("A", "V") else None
    if header is not None:
        entry.keys[size] = header.value
        entry.notes.append(f"{column}: its constant is taken from the header of the file: {header.text}")
        return entry
    positive = [name for name, value in table.scalars.items() if 0.0 < value < np.inf]
    names = {name: re.sub(r"[^a-z]", "", name.rpartition(".")[2].lower()) for name in positive}
    sized = [told.text for told in constants.values()]  # those whose unit says what they are
    named = [
        name
        for name, last in names.items()
        if last in lexicon().scalars.constant and not any(text.startswith(f"{name}: ") for text in sized)
    ]
    if len(named) == 1:
        value = table.scalars[named[0]]
        entry.notes.append(f"{column}: {named[0]} = {value:g} of the file is taken as {si} per {unit or 'unit'}")
        if unit == "A":
            entry.keys[key] = value
        else:
            entry.keys |= {"unit": "V", "gain": named[0]}
        return entry
    if unit is None:
        if not is_joint_state(told):
            entry.asked["unit"] = effort_unit(kind)
        return entry
    entry.keys[size] = 1.0
    if told.electric == "V":  # of the motor, which a bench in volts drives, and no output that stands for a torque
        entry.notes.append(
            f"{column}: the {si} per V are not known, 1 is taken: masses and friction are in multiples of it"
        )
        return entry
    given = "" if told.unit else f" (unit {unit} by its name)"
    constant = "force constant" if linear else "torque constant"
    screw = _screw("torque_constant_n_m_a") if linear and unit == "A" else ""
    what = (
        f"the {constant} of the motor"
        if unit == "A"
        else f"the size of its scale, if it is an output of {'force' if linear else 'torque'},"
    )
    entry.asked[size] = f"is in {unit}{given}; write {what} in {si}/{unit} {_UNKNOWN}{screw}"
    return entry


def _screw(what: str) -> str:
    """What to change for a motor that turns a screw or a belt; `what` is written in the place of the question."""
    return (
        "; or of a motor with a screw or belt rename motor_position_m to motor_position_rad and force_n to torque_n_m, "
        f"and write {what} here and lead_m above"
    )


def _rated(told: Label, linear: bool, table: ForeignTable) -> tuple[float, str]:
    """Torque or force at 100 % of a column, with the text that gives it; 1 without one.

    The rated one, or that of the rated current, which goes first for a current.
    """
    constants = table.constants
    rated = constants.get(Constant.RATED_FORCE if linear else Constant.RATED_TORQUE)
    current, constant = (
        constants.get(Constant.RATED_CURRENT),
        constants.get(Constant.FORCE if linear else Constant.TORQUE),
    )
    if current and constant and (told.electric == "A" or rated is None):
        return current.value * constant.value, f"{current.text}, {constant.text}"
    return (rated.value, rated.text) if rated and told.electric != "A" else (1.0, "")
