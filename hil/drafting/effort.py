"""Map entry of a torque, force, current or voltage: unit, constant and sign."""

import re

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AxisKind
from hil.drafting.column_names import Label
from hil.drafting.relations import EffortCause, MotionColumns

CAUSED = 0.3  # share of an effort explained by its motion from which its sign can be judged
PART = 0.1  # of the effort: the inertia's part must exceed it, else the sign of friction decides
# names of a torque or force constant without underscores and digits; others ("torque_limit", "tau_filter") are none
_CONSTANT_NAMES = "gtau ktau kt km kf km torqueconstant forceconstant motorconstant drehmomentkonstante kraftkonstante"


def effort_entry(
    told: Label,
    kind: AxisKind,
    scalars: dict[str, float],
    cause: EffortCause,
    moved: MotionColumns,
    motor_sign: int,
) -> tuple[dict[str, object], list[str]]:
    """Entry of the map, and notes on what is unsure.

    `cause` is what `relations.driven` gives for it.
    """
    entry, notes = _unit(told, kind, scalars)
    sign = _sign(cause.coefficients, moved) * motor_sign
    if cause.share < CAUSED:
        notes.append(
            f"{told.column}: inertia and friction of the motion explain only {100 * max(cause.share, 0.0):.0f} % "
            "of it; check that "
            "it drives this axis"
        )
    elif sign < 0:
        entry["sign"] = -1
        notes.append(f"{told.column}: positive values accelerate backwards; its sign is turned")
    return entry, notes


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
    elif kind is AxisKind.LINEAR and unit in ("N m", "mN m"):
        entry |= {"unit": "N", "scale": 1e-3 if unit == "mN m" else 1.0}
        notes.append(
            f"{told.column}: is in {unit}, the position in a length; 1 N per N m is taken: set scale to 2 pi / "
            "lead to get N"
        )
    elif kind is AxisKind.ROTARY and unit in ("N", "kN"):
        entry |= {"unit": "N m", "scale": 1e3 if unit == "kN" else 1.0}
        notes.append(
            f"{told.column}: is in {unit}, the position in an angle; 1 N m per N is taken: set scale to the radius"
        )
    return entry, notes
