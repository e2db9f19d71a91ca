"""Object dictionary of a simulated node, built from its EDS: typed values, access rights, limits."""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from canopen.objectdictionary import ODVariable, datatypes

from drivers.eds_file import read_eds
from drivers.pdo import Entry
from drivers.sim.sdo_server import AbortCode, SdoAbort

Value = Any  # int, or bytes for strings

_INTEGERS: Final = {
    datatypes.BOOLEAN: "B", datatypes.UNSIGNED8: "B", datatypes.UNSIGNED16: "H", datatypes.UNSIGNED32: "I",
    datatypes.UNSIGNED64: "Q", datatypes.INTEGER8: "b", datatypes.INTEGER16: "h", datatypes.INTEGER32: "i",
    datatypes.INTEGER64: "q",
}  # fmt: skip


def key_of(index: int, subindex: int = 0) -> int:
    """Index and sub-index in one number, as in a mapping entry."""
    return index << 8 | subindex


@dataclass(frozen=True, slots=True)
class Item:
    """Description of one variable in the EDS."""

    index: int
    subindex: int
    default: Value
    code: str  # format letter of struct; empty for strings
    readable: bool
    writable: bool
    mappable: bool
    lowest: int | None
    highest: int | None

    @property
    def entry(self) -> Entry:
        """Mapping entry of the variable."""
        return Entry(self.index, self.subindex, 8 * struct.calcsize(self.code), self.code.islower())


class Dictionary:
    """`values` by key; SDO access through `read` and `write`, which call the hooks.

    on_write hooks get (index, subindex, value) before it is stored and raise `SdoAbort` to refuse it.
    """

    def __init__(self, eds: Path, node_id: int) -> None:
        self.items = _read_eds(eds, node_id)
        self.values: dict[int, Value] = {}
        self._indices = {key >> 8 for key in self.items}
        self._hooks: dict[int, Callable[[int, int, int], None]] = {}
        self.reset(0x1000, 0xFFFF)

    def reset(self, first: int, last: int) -> None:
        """Values of the objects first..last back to the defaults of the EDS."""
        for key, item in self.items.items():
            if first <= item.index <= last:
                self.values[key] = item.default

    def on_write(self, index: int, hook: Callable[[int, int, int], None]) -> None:
        """Call `hook` when an SDO writes any sub-index of this object."""
        self._hooks[index] = hook

    def number(self, index: int, subindex: int = 0) -> int:
        """An integer value."""
        return int(self.values[key_of(index, subindex)])

    def item(self, index: int, subindex: int) -> Item:
        """Description of a variable; `SdoAbort` if there is none."""
        item = self.items.get(key_of(index, subindex))
        if item is None:
            known = index in self._indices
            raise SdoAbort(AbortCode.NO_SUCH_SUBINDEX if known else AbortCode.NO_SUCH_OBJECT)
        return item

    def read(self, index: int, subindex: int) -> bytes:
        """Value as the SDO server sends it."""
        item = self.item(index, subindex)
        if not item.readable:
            raise SdoAbort(AbortCode.WRITE_ONLY)
        value = self.values[key_of(index, subindex)]
        return value if isinstance(value, bytes) else struct.pack("<" + item.code, value)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Value as the SDO server receives it: rights, length, limits, then the hook."""
        item = self.item(index, subindex)
        if not item.writable:
            raise SdoAbort(AbortCode.READ_ONLY)
        if not item.code:
            self.values[key_of(index, subindex)] = data
            return
        if len(data) != struct.calcsize(item.code):
            raise SdoAbort(AbortCode.WRONG_LENGTH)
        value: int = struct.unpack("<" + item.code, data)[0]
        if item.highest is not None and value > item.highest:
            raise SdoAbort(AbortCode.VALUE_TOO_HIGH)
        if item.lowest is not None and value < item.lowest:
            raise SdoAbort(AbortCode.VALUE_TOO_LOW)
        hook = self._hooks.get(index)
        if hook is not None:
            hook(index, subindex, value)
        self.values[key_of(index, subindex)] = value


@cache  # reading an EDS takes milliseconds, and the items do not change
def _read_eds(eds: Path, node_id: int) -> dict[int, Item]:
    objects = read_eds(eds, node_id).dictionary.values()
    variables = [variable for o in objects for variable in ([o] if isinstance(o, ODVariable) else o.values())]
    return {key_of(variable.index, variable.subindex): _item(variable) for variable in variables}


def _item(variable: ODVariable) -> Item:
    code = _INTEGERS.get(variable.data_type, "")
    default = variable.default
    if not code:
        default = default if isinstance(default, bytes) else str(default or "").encode()
    return Item(
        variable.index, variable.subindex, default if default is not None else 0, code, variable.readable,
        variable.writable, variable.pdo_mappable, variable.min, variable.max,
    )  # fmt: skip
