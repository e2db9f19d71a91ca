"""Columns of one axis, where the numbers or letters in their names are those of several."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.importing.column_names import Label
from hil.importing.lexicon import Quantity
from hil.importing.relations import SMOOTH, roughness

_MOTIONS = (Quantity.POSITION, Quantity.VELOCITY)


@dataclass(frozen=True)
class OneAxis:
    """Labels of the columns of one axis, its number ("" without one), the other columns, and notes."""

    labels: dict[str, Label]
    axis: str = ""
    left_out: dict[str, str] = field(default_factory=dict)
    unsure: list[str] = field(default_factory=list)


def one_axis(where: str, labels: Mapping[str, Label], columns: Mapping[str, FloatArray], axis: str | None) -> OneAxis:
    """Leave out columns of other axes than `axis`, or the one that moves, or the first.

    Numbers and letters in names count axes if two or more of them have a motion and an effort. Raises InputError: no
    such axis.
    """
    axis = axis.lower() if axis else axis
    numbers = sorted({one.number for one in labels.values() if one.number})
    both = [
        number
        for number in numbers
        if _moves_and_drives({one.quantity for n, one in labels.items() if one.number == number and n in columns})
    ]
    if axis is not None and axis not in numbers:
        raise InputError(
            f"{where}: given axis {axis!r}, allowed {listed(numbers) or 'none: the names of its columns tell no axes'}"
        )
    if len(both) < 2 and axis is None:
        return OneAxis(dict(labels))
    taken = axis or _moving_one(both, labels, columns)
    others = [number for number in both if number != taken]
    unsure = []
    if others:
        another = "" if axis else f", for another: --axis {others[0]}"
        unsure.append(
            f"axis: the file holds the axes {', '.join(both)}; {taken} is taken{another}; what another moving arm "
            "does to it is not modelled, and may look like a spring, a force or friction"
        )
    left_out = {name: f"of axis {one.number}" for name, one in labels.items() if one.number not in ("", taken)}
    kept = {name: replace(one, number="") for name, one in labels.items() if name not in left_out}
    return OneAxis(kept, taken, left_out, unsure)


def _moves_and_drives(quantities: set[Quantity]) -> bool:
    return Quantity.EFFORT in quantities and bool(quantities & set(_MOTIONS))


def _moving_one(numbers: list[str], labels: Mapping[str, Label], columns: Mapping[str, FloatArray]) -> str:
    """Number of the only axis that moves while the others are held; else the first one."""

    def order(number: str) -> float:
        own = [(name, one.quantity) for name, one in labels.items() if one.number == number and name in columns]
        kind = next(kind for kind in _MOTIONS if kind in dict(own).values())
        return min(roughness(columns[name]) for name, quantity in own if quantity is kind)

    moving = [number for number in numbers if order(number) < SMOOTH]
    return moving[0] if len(moving) == 1 else numbers[0]
