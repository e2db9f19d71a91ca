"""Read columns whose cells hold a number with its unit: 12.3 mm, 145 mN·m, 1.02 N·m. All become one unit."""

import re
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.importing.lexicon import lexicon
from hil.importing.number_form import NumberForm, numbers_of
from hil.importing.units import base_of, unit_named

_CELL = re.compile(r"([+\-−]?[\d.,'’\s]*\d[.,]?(?:[eE][+-]?\d+)?)\s*((?:1/)?[^\d\s.,'’/+-].{0,20})")
_FIRST = 20  # cells that tell at once that a column has units
_LONGEST = 60  # characters of such a cell
_MOSTLY = 0.5  # share of the cells with a unit from which a column has units


class Cells(NamedTuple):
    """Numbers (n,), NaN without one; the texts that are none, by row; the unit of the numbers, "" if cells have none.

    None: no cell says anything yet.
    """

    values: FloatArray
    texts: dict[int, str]
    unit: str | None


class _CellPart(NamedTuple):
    number: str
    unit: str
    factor: float


def number_part(field: str) -> str:
    """Text of a cell before a unit that is known; the whole text without one."""
    return _part(field).number


def has_unit(field: str) -> bool:
    """True for a cell that ends with a unit that is known."""
    return bool(_part(field).unit)


def read_cells(fields: Sequence[str], form: NumberForm, unit: str | None = None) -> Cells:
    """Read the cells of one column. `unit` is that of the cells before, as this function returned it.

    In a column with units a number without one is a text like a unit of another quantity, but for 0.
    """
    if unit == "" or not (unit or any(map(has_unit, fields[:_FIRST]))):
        values, texts = numbers_of(fields, form)
        if unit == "" or not texts:
            return Cells(values, texts, "" if unit == "" or np.isfinite(values).any() else None)
    parts = [_part(field) for field in fields]
    if not unit:
        unit, count = Counter(part.unit for part in parts).most_common(1)[0]
        if count <= _MOSTLY * sum(map(bool, fields)) or not unit:
            return Cells(*numbers_of(fields, form), "")
    values, wrong = numbers_of([part.number for part in parts], form)
    strange = [row for row, part in enumerate(parts) if part.unit != unit and (part.unit or values[row])]
    rows = sorted({*wrong, *(row for row in strange if not np.isnan(values[row]))})
    values = values * np.array([part.factor for part in parts])
    values[rows] = np.nan
    return Cells(values, {row: fields[row] for row in rows}, unit)


def tell_units(title: str, units: Sequence[str], cells: Sequence[str], form: NumberForm) -> bool:
    """True if texts are the units of the numbers in the cells beside them; a single letter may be a state."""
    given = {one for one in units if one}
    known = bool(given) and all(unit_named(one) for one in given)
    named = any(word in lexicon().series.unit for word in re.split(r"[\W\d_]+", title.lower()))
    return known and (named or all(len(one) > 1 for one in given)) and read_cells(cells, form).unit == ""


def _part(field: str) -> _CellPart:
    match = _CELL.fullmatch(field) if len(field) <= _LONGEST else None
    base = _base(match[2]) if match else None
    return _CellPart(match[1], *base) if match and base else _CellPart(field, "", 1.0)


@lru_cache(maxsize=1000)
def _base(text: str) -> tuple[str, float] | None:
    """Unit to which a unit in a cell is converted, and the factor; None for an unknown one.

    None also for M that may be mega, and for nm, which may be nanometres or N m.
    """
    unit = None if text == "nm" else unit_named(text)
    mega = text.startswith("M") and unit is not None and unit.startswith("m") and unit not in ("m", "min", "m/min")
    return None if unit is None or mega else base_of(unit)
