"""Sections of an EDS written out plainly for canopen, with all that CiA 306 leaves to defaults.

Those are a missing ObjectType, sub-indices in compact form, the type of sub-index 0. Every object with sub-indices is a
record, of which canopen knows those that are there; of an array it makes up the others. Kept is what a client needs:
type, access, mapping, limits, values; numbers of the device.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from canopen.objectdictionary import datatypes

from drivers.eds_text import ADVICE, EdsError, EdsValue, Section, node_formula, number, octal
from drivers.object_types import data_type_name, size_of

Declared = dict[tuple[int, int], str]  # line and text of the data type, by index and sub-index
_DOMAIN, _VAR, _ARRAY, _RECORD = 2, 7, 8, 9  # object codes of CiA 301
_LAST_TYPE: Final = 0x1B  # UNSIGNED64; others are defined in sections of their own
_OBJECT: Final = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?")  # as `section_key` has it
_UNSIGNED8: Final = 0x05
_BYTES: Final = 0x0F  # DOMAIN
_COUNT: Final = f"ParameterName=Number of entries\nDataType={_UNSIGNED8}\nAccessType=ro\nDefaultValue="
_IDENTITY: Final = ("VendorNumber", "ProductNumber", "RevisionNumber")
_NUMBERS: Final = (
    *_IDENTITY, "SimpleBootUpMaster", "SimpleBootUpSlave", "Granularity", "DynamicChannelsSupported",
    "GroupMessaging", "NrOfRXPDO", "NrOfTXPDO", "LSS_Supported",
    *(f"BaudRate_{rate}" for rate in (10, 20, 50, 125, 250, 500, 800, 1000)),
)  # fmt: skip
_NAMES: Final = ("VendorName", "ProductName", "OrderCode")
_VALUES: Final = ("LowLimit", "HighLimit", "DefaultValue", "ParameterValue")
_MATTERS: Final = frozenset(key.lower() for key in (*_IDENTITY, *_VALUES, "DataType", "ObjectType", "AccessType"))
_MOST_VARIABLES: Final = 20_000  # some times those of a large drive; in compact form a small file may have millions


@dataclass
class PlainText:
    """Sections written out. where: name of the file, for errors. Raises EdsError for what cannot be left out.

    notes: sentences on what the file leaves in doubt. declared: of each variable.
    """

    sections: dict[str, Section]
    where: str
    notes: list[str] = field(default_factory=list)
    declared: Declared = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._lines = ["[DeviceInfo]", *self._device_information(), *self._dummies()]
        found: dict[str, list[int]] = {}
        for match in filter(None, map(_OBJECT.fullmatch, self.sections)):
            found.setdefault(match[1], []).extend([int(match[2], 16)] if match[2] else [])
        for index, subindices in sorted(found.items()):
            self._lines += self._object(index, sorted(subindices))
            if len(self.declared) > _MOST_VARIABLES:
                raise EdsError(f"has more than {_MOST_VARIABLES} objects", where=self.where, advice=ADVICE)
        for section in self.sections.values():
            self.notes += _repeated(section)

    def text(self) -> str:
        """Return the plain text."""
        return "\n".join(self._lines) + "\n"

    def _device_information(self) -> Iterator[str]:
        section = self.sections.get("deviceinfo", Section("DeviceInfo", 1))
        yield from (f"{name}={text}" for name in _NAMES if (text := section.text(name.lower())))
        for name in _NUMBERS:
            value = section.values.get(name.lower())
            if value is None or not value.text:
                continue
            found = number(value.text)
            if found is None and name in _IDENTITY:  # without it another device would not be noticed
                raise EdsError(
                    f"[DeviceInfo] {name} is no number", where=f"{self.where}, line {value.line}", given=value.text,
                    allowed="as 0x1F or 31", advice="Correct it, or leave it empty: it is not compared then.",
                )  # fmt: skip
            if found is not None:
                yield f"{name}={found}"
            other = octal(value.text)
            if name in _IDENTITY and other != found and other is not None:
                self.notes.append(f"line {value.line}: {name}={value.text} is read as {found}, not as octal {other}")

    def _dummies(self) -> Iterator[str]:
        section = self.sections.get("dummyusage")
        if section is not None:
            yield "[DummyUsage]"
            yield from (f"Dummy{k:04}={int(number(section.text(f'dummy{k:04}')) == 1)}" for k in range(1, 8))

    def _object(self, index: str, subindices: list[int]) -> Iterator[str]:
        main = self.sections.get(index) or Section(index.upper(), self.sections[f"{index}sub{subindices[0]:x}"].line)
        compact = min(number(main.text("compactsubobj")) or 0, 254)
        kind = number(main.text("objecttype"))
        is_variable = kind in (_VAR, _DOMAIN) and (main.text("datatype") or not subindices)
        if compact <= 0 and (is_variable or (kind is None and not subindices)):
            if main.values.keys() & {"datatype", "objecttype", "parametername"}:  # else it is no object
                yield from [f"[{index}]", *self._variable(index, 0, main, main)]
            return
        if compact <= 0 and not subindices and kind not in (_ARRAY, _RECORD):
            return
        yield from (f"[{index}]", f"ObjectType={_RECORD}", f"ParameterName={main.text('parametername')}")
        if compact > 0:
            yield from self._compact(index, main, compact, set(subindices))
        for subindex in subindices:
            section = self.sections[f"{index}sub{subindex:x}"]
            yield from [f"[{index}sub{subindex:x}]", *self._variable(index, subindex, section, main)]

    def _compact(self, index: str, main: Section, last: int, given: set[int]) -> Iterator[str]:
        """Sub-indices 0 to last of CompactSubObj, with those of [6099Name] and [6099Value] (CiA 306)."""
        name = main.text("parametername")
        names, values = (self.sections.get(f"{index}{more}", Section("", 0)) for more in ("name", "value"))
        if 0 not in given:
            self.declared[int(index, 16), 0] = f"line {main.line}: [{main.name}] CompactSubObj"
            yield from (f"[{index}sub0]", f"{_COUNT}{last}")
        for subindex in {*range(1, last + 1)} - given:
            own = Section(main.name, main.line, dict(main.values))
            own.values["parametername"] = EdsValue(names.text(str(subindex)) or f"{name}{subindex}", main.line)
            if values.text(str(subindex)):
                own.values["parametervalue"] = values.values[str(subindex)]
            yield from [f"[{index}sub{subindex:x}]", *self._variable(index, subindex, own, main)]

    def _variable(self, index: str, subindex: int, section: Section, main: Section) -> Iterator[str]:
        data_type = self._data_type(int(index, 16), subindex, section, main)
        yield f"ParameterName={section.text('parametername') or main.text('parametername') or index.upper()}"
        yield f"DataType={data_type}"
        yield f"AccessType={section.text('accesstype') or 'rw'}"
        yield f"PDOMapping={int(bool(number(section.text('pdomapping'))))}"
        for key in _VALUES:
            if value := _value(section.text(key.lower()), data_type):
                yield f"{key}={value}"

    def _data_type(self, index: int, subindex: int, section: Section, main: Section) -> int:
        """Type of a variable; DOMAIN, plain bytes, where the file gives none that is known."""
        value = section.values.get("datatype")
        if (value is None or not value.text) and section is not main and subindex:
            value = main.values.get("datatype")  # of an array
        if value is None or not value.text:
            self.declared[index, subindex] = f"line {section.line}: [{section.name}] has no DataType"
            return _UNSIGNED8 if subindex == 0 and section is not main else _BYTES
        found = number(value.text)
        if found is not None and found > _LAST_TYPE:
            definition = self.sections.get(f"{found:04x}sub1")
            found = None if definition is None else number(definition.text("defaultvalue"))
        kind = found if found is not None and 0 < found <= _LAST_TYPE else 0
        name = data_type_name(kind) if kind else "unknown"
        self.declared[index, subindex] = f"line {value.line}: [{section.name}] DataType={value.text} ({name})"
        return kind or _BYTES


def _value(text: str, data_type: int) -> str:
    """A limit, default or value, as canopen reads it; numbers in decimal, a formula as $NODEID+n."""
    if data_type not in (datatypes.BOOLEAN, *datatypes.INTEGER_TYPES):
        return text
    offset, plain = node_formula(text), number(text)
    if plain is not None and data_type in datatypes.SIGNED_TYPES:
        bits = 8 * size_of(data_type)
        plain -= (plain >> (bits - 1) == 1) << bits  # -3 as 0xFD
    return f"$NODEID+{offset}" if offset is not None else "" if plain is None else str(plain)


def _repeated(section: Section) -> list[str]:
    counts = section.values
    return [
        f"line {counts[key].line}: [{section.name}] {key} is {counts[key].text}, and {old.text} in line {old.line}; "
        "the last counts"
        for key, old in section.repeated
        if key in _MATTERS
    ]
