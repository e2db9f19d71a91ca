"""Count what a MATLAB .mat file expands to, and check the types of its elements, before a library makes arrays of it.

The layout is that of "MAT-File Format" (MathWorks). Version 4 has plain matrices. Versions 5 to 7 have elements of a
type, a number of bytes and data; a matrix has elements within, and one of the type miCOMPRESSED is a zlib stream.
"""

from pathlib import Path
from typing import Literal

from hil.errors import InputError
from hil.files.input_file import MOST_BYTES, check_values, inflated

_HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}  # of a value of a type
_VALUES_OF_ARRAY = 250  # an array object takes the memory of so many numbers, even an empty cell of 8 bytes


def check_mat_size(path: Path) -> None:
    """Refuse a file that becomes more than `MOST_VALUES` values, or that has an element of a type that there is not.

    Raises InputError. Other damage passes: the library that reads the file says what is wrong.
    """
    content = path.read_bytes()
    if 0 in content[:4]:  # version 4: a value has a byte or more
        check_values(path, len(content), f"{len(content)} bytes of version 4")
        return
    order: Literal["big", "little"] = "big" if content[126:128] == b"MI" else "little"
    if int.from_bytes(content[124:126], order) >> 8 != 1:  # version 7.3, or no .mat file
        return
    expanded = values = 0
    at = _HEADER_BYTES
    while at + 8 <= len(content):
        kind, size = (int.from_bytes(content[at + k : at + k + 4], order) for k in (0, 4))
        data = content[at : at + 8 + size]
        if kind == _COMPRESSED:
            data = inflated(data[8:], MOST_BYTES - expanded + 1)
            expanded += len(data)
            check_values(path, -(-expanded // 8), f"{len(content)} bytes that expand to more than {MOST_BYTES}")
        values = _count(path, data, order, values)
        at += 8 + size + (-size % 8 if kind != _COMPRESSED else 0)


def _count(path: Path, data: bytes, order: Literal["big", "little"], values: int) -> int:
    """Values of an element and all within, added to `values`; an array counts as `_VALUES_OF_ARRAY`."""
    at = 0
    while at + 8 <= len(data):
        kind, size = (int.from_bytes(data[at + k : at + k + 4], order) for k in (0, 4))
        if kind == _MATRIX:
            size, padded = 0, 0  # its elements follow
            values += _VALUES_OF_ARRAY
        elif kind >> 16:  # a small element: size and type in four bytes, data in the next four
            kind, size, padded = kind & 0xFFFF, min(kind >> 16, 4), 0
        elif kind not in _BYTES and size:  # scipy looks types up in a table without a check, and crashes
            raise InputError(
                f"{path}: is no readable .mat file (an element has the type {kind}, allowed those up to 18); "
                "it is cut or damaged"
            )
        else:
            padded = size + -size % 8
        values += min(size, len(data) - at) // _BYTES.get(kind, 1)
        check_values(path, values, f"more than {values} values in arrays, cells and structures")
        at += 8 + padded
    return values
