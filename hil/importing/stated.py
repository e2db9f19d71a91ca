"""Constants and units that a file gives by name beside its columns, or as a column of one value.

kt = 0.83, kt_unit = "Nm/A"        torque_constant.value = 0.83, torque_constant.unit = "Nm/A"
torque_constant = "0.83 Nm/A"      a column kt [Nm/A] with 0.83 in every row
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from hil.arrays import FloatArray
from hil.importing.column_names import label
from hil.importing.header_values import HeaderValue, header_values
from hil.importing.lexicon import Constant, Quantity, RowKind, lexicon, without_accents
from hil.importing.unit_lines import described
from hil.importing.units import QUANTITY_OF_UNIT, unit_named

_LONGEST = 10_000  # characters of a text that may tell units
_VALUE = re.compile(r"(.+?)[\W_]*(value|wert)")


@dataclass(frozen=True)
class Stated:
    """Numbers and texts of a file by name; of a name with points the last part says what it is."""

    numbers: dict[str, float] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)

    def units(self, columns: Iterable[str] = ()) -> dict[str, str]:
        """Texts that are the unit of something, by `_plain` of its name: of a number, or of one of the `columns`.

        A text that is called units, or has units behind most of the names in it, tells several: "pos um; dt ms".
        """
        words, names = lexicon().rows[RowKind.UNITS], [*columns, *self.numbers]
        ending = re.compile(rf"(.+?)[\W_]*(?:{words})")
        matches = ((ending.fullmatch(_plain(name)), text) for name, text in self.texts.items())
        found = {match[1]: text for match, text in matches if match}
        for name, text in ((name, text) for name, text in self.texts.items() if len(text) < _LONGEST):
            called = re.fullmatch(words, _plain(name.rpartition(".")[2])) is not None
            told = {one: unit for one, (_, unit) in described([text], names, called).items() if unit}
            found = {_plain(one): unit for one, unit in told.items() if _goes_with(one, unit)} | found
            for one in self.numbers if called or told else ():  # a rate in Hz is no channel
                beside = re.search(rf"(?<!\w){re.escape(one)}[\s:=(\[]+([^\s;,)\]]+)", text)
                if beside and beside[1].lower() in lexicon().constants[Constant.RATE].units:
                    found.setdefault(_plain(one), beside[1])
        return found

    def constants(self, lines: Iterable[str] = (), columns: Mapping[str, FloatArray] | None = None,
                  units: Mapping[str, str] | None = None) -> dict[Constant, HeaderValue]:  # fmt: skip
        """Constants of header `lines`, numbers and texts, and of `columns` (n,) with one value, with their `units`."""
        own = self.units(columns or ())
        texts = [f"{name}: {text}" for name, text in self.texts.items()]
        for name, values in (columns or {}).items():
            if values.size and np.isfinite(values).all() and np.ptp(values) == 0.0:
                unit = (units or {}).get(name)
                texts.append(f"{name}{f' [{unit}]' if unit else ''}: {values[0]:.12g}")
        sized = {}
        for name, number in self.numbers.items():
            value = _VALUE.fullmatch(_plain(name))
            unit = own.get(_plain(name)) or (own.get(value[1]) if value else None)
            if unit:
                texts.append(f"{name[: value.end(1)] if value else name}: {number:.12g} {unit}")
            else:
                sized[name] = number
        return header_values([*lines, *texts], sized)

    def units_of(self, columns: Collection[str]) -> dict[str, str]:
        """Units of columns by texts with their name, or beside the only column of a structure.

        torque_unit = "Nm"; torque.data and torque.unit = "Nm"
        """
        own = self.units(columns)
        parents = Counter(name.rpartition(".")[0] for name in columns)
        beside = {
            name: own[_plain(parent)]
            for name in columns
            if parents[parent := name.rpartition(".")[0]] == 1 and _plain(parent) in own
        }
        return beside | {name: own[_plain(name)] for name in columns if _plain(name) in own}


def _goes_with(name: str, unit: str) -> bool:
    """True if the quantity of a unit is not another one than the name says."""
    said, of_unit = label(name).quantity, QUANTITY_OF_UNIT.get(unit_named(unit) or "")
    return of_unit is not None and said in (of_unit, Quantity.UNKNOWN)


def _plain(name: str) -> str:
    return without_accents(name).lower()
