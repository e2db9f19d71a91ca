"""Map entry of a torque, force, current or voltage: unit, constant and sign."""

import re

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AxisKind
from hil.identification.derivatives import MeasuredMotion
from hil.identification.least_squares import LinearFit
from hil.importing.column_names import Label
from hil.importing.foreign_table import ForeignTable
from hil.importing.header_values import HeaderValue
from hil.importing.lexicon import Constant, lexicon
from hil.importing.relations import proportional
from hil.quantities import UNITS

CAUSED = 0.3  # share of an effort explained by its motion from which its sign can be judged
TOGETHER = 0.25  # share of the variance that torque and command have in common, from which they have one cause
_CONSTANT_KEY = {AxisKind.LINEAR: "force_constant_n_a", AxisKind.ROTARY: "torque_constant_n_m_a"}
PART = 0.1  # of the effort: the inertia's part must exceed it, else the sign of friction decides


def effort_entry(
    told: Label, kind: AxisKind, table: ForeignTable, cause: LinearFit, sign: int
) -> tuple[dict[str, object], list[str]]:
    """Keys of the map beside the column, and notes on what is unsure.

    `cause` is what `relations.driven` gives for it, `sign` what `signs_of` does; constants are those of `table`.
    """
    entry, notes = _unit(told, kind, table)
    if cause.share < CAUSED:
        notes.append(
            f"{told.column}: inertia and friction of the motion explain only {100 * max(cause.share, 0.0):.0f} % "
            "of it; check that it drives this axis"
        )
    if sign < 0:
        entry["sign"] = -1
        notes.append(f"{told.column}: positive values accelerate backwards; its sign is turned")
    return entry, notes


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


def _unit(told: Label, kind: AxisKind, table: ForeignTable) -> tuple[dict[str, object], list[str]]:
    unit, column, scalars = told.unit or told.electric, told.column, table.scalars
    linear = kind is AxisKind.LINEAR
    si = "N" if linear else "N m"
    entry: dict[str, object] = {"unit": unit or si}
    if unit in ("mA", "mV"):
        entry |= {"unit": unit[1:], "scale": 1e-3}
        unit = unit[1:]
    if unit in UNITS and UNITS[unit][0] != si:
        entry |= {"unit": si, "scale": UNITS[unit][1]}
        lever = "a length, and no lead is told; 1 N per N m is" if linear else "an angle; 1 N m per N is"
        factor = "multiply scale by the radius"
        if linear:
            factor = "reports then say N where N m of the motor is meant; multiply scale by 2 pi / lead to get N"
        return entry, [f"{column}: is in {unit}, the position in {lever} taken: {factor}"]
    if unit in UNITS:
        return entry, []
    multiples = "1 is taken: masses and friction are in multiples of it"
    if unit in ("%", "permille"):
        rated = table.constants.get(Constant.RATED_FORCE if linear else Constant.RATED_TORQUE)
        entry["rated"] = rated.value if rated else 1.0
        return entry, [_from(column, rated) if rated else f"{column}: the rated {si} is not known, {multiples}"]
    header = table.constants.get(Constant.FORCE if linear else Constant.TORQUE)
    if unit == "A" and header is not None:
        return entry | {_CONSTANT_KEY[kind]: header.value}, [_from(column, header)]
    named = [name for name in scalars if re.sub(r"[^a-z]", "", name.lower()) in lexicon().scalars.constant]
    if len(named) != 1:
        notes = [f"{column}: several scalars may be its constant ({', '.join(named)})"] if named else []
        if unit is None:
            return entry, [*notes, f"{column}: no unit is given; {si} is taken: masses and friction scale with it"]
        entry[_CONSTANT_KEY[kind] if unit == "A" else "gain"] = 1.0
        return entry, [*notes, f"{column}: the {si} per {unit} are not known, {multiples}"]
    size = f"{named[0]} = {scalars[named[0]]:g} of the file is taken as {si} per"
    if unit is None:
        return entry | {"unit": "V", "gain": named[0]}, [f"{column}: no unit is given; {size} unit"]
    key, value = (_CONSTANT_KEY[kind], scalars[named[0]]) if unit == "A" else ("gain", named[0])
    return entry | {key: value}, [f"{column}: {size} {unit}"]


def _from(column: str, constant: HeaderValue) -> str:
    return f"{column}: its constant is taken from the header of the file: {constant.text}"
