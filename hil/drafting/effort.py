"""Map entry of a torque, force, current or voltage: unit, constant and sign."""

import re

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AxisKind
from hil.drafting.column_names import Label
from hil.drafting.relations import EffortCause, MotionColumns, proportional
from hil.quantities import UNITS

CAUSED = 0.3  # share of an effort explained by its motion from which its sign can be judged
TOGETHER = 0.25  # share of the variance that torque and command have in common, from which they have one cause
PART = 0.1  # of the effort: the inertia's part must exceed it, else the sign of friction decides
# names of a torque or force constant without underscores and digits; others ("torque_limit", "tau_filter") are none
_CONSTANT_NAMES = "gtau ktau kt km kf km torqueconstant forceconstant motorconstant drehmomentkonstante kraftkonstante"


def effort_entry(
    told: Label,
    kind: AxisKind,
    scalars: dict[str, float],
    cause: EffortCause,
    sign: int,
) -> tuple[dict[str, object], list[str]]:
    """Entry of the map, and notes on what is unsure.

    `cause` is what `relations.driven` gives for it, `sign` what `signs_of` does.
    """
    entry, notes = _unit(told, kind, scalars)
    if cause.share < CAUSED:
        notes.append(
            f"{told.column}: inertia and friction of the motion explain only {100 * max(cause.share, 0.0):.0f} % "
            "of it; check that "
            "it drives this axis"
        )
    if sign < 0:
        entry["sign"] = -1
        notes.append(f"{told.column}: positive values accelerate backwards; its sign is turned")
    return entry, notes


def signs_of(efforts: list[FloatArray], causes: list[EffortCause], moved: MotionColumns) -> list[int]:
    """Signs with which efforts (n,) of one axis accelerate forwards.

    A measured torque and its command have one cause: the motion decides on the sign of the one that it explains better,
    and their relation on that of the other. What another axis does to this one may turn the sign of one of them.
    """
    signs = [_sign(cause.coefficients, moved) if cause.share >= CAUSED else 1 for cause in causes]
    if len(efforts) == 2:
        relation = proportional(*efforts)
        if relation.share > TOGETHER:
            first = int(np.argmax([cause.share for cause in causes]))
            signs[1 - first] = signs[first] * int(np.sign(relation.factor))
    return signs


def _sign(coefficients: FloatArray, moved: MotionColumns) -> int:
    inertia, viscous, coulomb = coefficients[:3]
    parts = np.array(
        [
            inertia * np.std(moved.acceleration),
            viscous * np.std(moved.velocity) + coulomb * np.mean(moved.velocity != 0),
        ]
    )
    deciding = parts[0] if abs(parts[0]) > PART * np.abs(parts).max() else parts[1]
    return -1 if deciding < 0.0 else 1


def _unit(told: Label, kind: AxisKind, scalars: dict[str, float]) -> tuple[dict[str, object], list[str]]:
    unit = told.unit or told.electric
    si = "N" if kind is AxisKind.LINEAR else "N m"
    entry: dict[str, object] = {"column": told.column, "unit": unit or si}
    if unit in ("mA", "mV"):
        entry |= {"unit": unit[1:], "scale": 1e-3}
        unit = unit[1:]
    constants = [name for name in scalars if re.sub(r"[^a-z]", "", name.lower()) in _CONSTANT_NAMES.split()]
    scalar = constants[0] if len(constants) == 1 else None
    notes = (
        [f"{told.column}: several scalars may be its constant ({', '.join(constants)})"] if len(constants) > 1 else []
    )
    if unit is None and scalar is not None:
        entry |= {"unit": "V", "gain": scalar}
        notes.append(
            f"{told.column}: no unit is given; {scalar} = {scalars[scalar]:g} of the file is taken as {si} per unit"
        )
    elif unit is None:
        notes.append(f"{told.column}: no unit is given; {si} is taken: masses and friction scale with it")
    elif unit == "A":
        constant = "force_constant_n_a" if kind is AxisKind.LINEAR else "torque_constant_n_m_a"
        entry[constant] = scalars[scalar] if scalar else 1.0
        notes.append(
            f"{told.column}: {scalar} = {scalars[scalar]:g} of the file is taken as {si} per A"
            if scalar
            else f"{told.column}: the {si} per A are not known, 1 is taken: masses and friction are in multiples of it"
        )
    elif unit == "V":
        entry["gain"] = scalar or 1.0
        notes.append(
            f"{told.column}: {scalar} = {scalars[scalar]:g} of the file is taken as {si} per V"
            if scalar
            else f"{told.column}: the {si} per V are not known, 1 is taken: masses and friction are in multiples of it"
        )
    elif unit in ("%", "permille"):
        entry["rated"] = 1.0
        notes.append(
            f"{told.column}: the rated {si} is not known, 1 is taken: masses and friction are in multiples of it"
        )
    elif unit in UNITS and UNITS[unit][0] != si:
        entry |= {"unit": si, "scale": UNITS[unit][1]}
        lever = "a length; 1 N per N m is" if kind is AxisKind.LINEAR else "an angle; 1 N m per N is"
        factor = "multiply scale by 2 pi / lead to get N" if kind is AxisKind.LINEAR else "multiply scale by the radius"
        notes.append(f"{told.column}: is in {unit}, the position in {lever} taken: {factor}")
    return entry, notes
