"""Object dictionary of an EDS or DCF file: read in any dialect, written out plainly, imported by canopen."""

import io
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from canopen.objectdictionary import ObjectDictionary, ODVariable, datatypes
from canopen.objectdictionary.eds import import_eds

from drivers.eds_plain import Declared, PlainText
from drivers.eds_text import ADVICE, EdsError, decode, read_bytes, sections
from drivers.object_types import COUNTERS, data_type_name, profile_type
from drivers.pdo import Entry

_SHOWN_NOTES: Final = 5


@dataclass(frozen=True)
class Eds:
    """What a file says of its device. notes: sentences on what it leaves in doubt, with lines.

    The dictionary of one content is shared: read it only.
    """

    path: Path
    dictionary: ObjectDictionary
    notes: tuple[str, ...]
    declared: Declared

    def check(self, entries: Iterable[Entry]) -> None:
        """Raise EdsError unless the file has these objects as integers of this length. The sign is the profile's."""
        wrong = [text for entry in entries if (text := self._wrong(entry))]
        if wrong:
            raise EdsError("; ".join(wrong), where=f"{self.path}", advice=ADVICE)

    def _wrong(self, entry: Entry) -> str:
        index, subindex = entry.index, entry.subindex
        variable = self.dictionary.get_variable(index, subindex)
        if variable is None:
            return f"the EDS does not know the object 0x{index:04X}:{subindex:02X}"
        if variable.data_type in datatypes.INTEGER_TYPES and len(variable) == entry.bits:
            return ""
        needed = f"{'INTEGER' if entry.signed else 'UNSIGNED'}{entry.bits}"
        return f"{self.where(index, subindex)}, allowed {needed} ({variable.name}, CiA 301, 402, 406)"

    def where(self, index: int, subindex: int) -> str:
        """Line of an object's data type and what it says."""
        return self.declared.get((index, subindex), f"0x{index:04X}:{subindex:02X} has no DataType")


def read_eds(path: Path, node_id: int) -> Eds:
    """Read an EDS or DCF file. Raises EdsError for a file that is none, with the line where there is one."""
    dictionary, notes, declared = _parsed(read_bytes(path), node_id, f"{path}")
    return Eds(path, dictionary, notes, declared)


@lru_cache(maxsize=16)  # a set-up, its end and its repetition read the same file
def _parsed(data: bytes, node_id: int, where: str) -> tuple[ObjectDictionary, tuple[str, ...], Declared]:
    plain = PlainText(sections(decode(data)), where)
    if not plain.declared:
        first = decode(data[:400]).strip().splitlines()
        raise EdsError(
            "is no EDS file: it has no object, as a section [6041] with DataType=0x0006", where=f"{where}, line 1",
            given=repr(first[0][:60]) if first else "an empty file", advice=ADVICE,
        )  # fmt: skip
    try:
        dictionary = import_eds(io.StringIO(plain.text()), node_id)
    except Exception as error:  # canopen raises many kinds
        text = (str(error) or type(error).__name__).splitlines()[0]
        raise EdsError(f"is no readable EDS file ({text})", where=where, advice=ADVICE) from None
    notes = plain.notes + _give_profile_types(dictionary, plain.declared)
    more = [f"and {len(notes) - _SHOWN_NOTES} more"] if len(notes) > _SHOWN_NOTES else []
    return dictionary, tuple(notes[:_SHOWN_NOTES] + more), plain.declared


def _give_profile_types(dictionary: ObjectDictionary, declared: Declared) -> list[str]:
    """Signs as CiA fixes them: else a negative position comes out 2^32 counts away. Returns what was changed."""
    notes = []
    for index, entry in dictionary.items():
        for variable in [entry] if isinstance(entry, ODVariable) else entry.values():
            needed = profile_type(index, variable.subindex, variable.data_type)
            if needed == variable.data_type:
                continue
            variable.data_type, variable.min, variable.max = needed, None, None
            if index not in COUNTERS:
                where = declared[index, variable.subindex]
                notes.append(f"{where} is read as {data_type_name(needed)}, which CiA fixes for this object")
    return notes
