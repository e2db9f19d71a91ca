"""Text of an EDS or DCF file (CiA 306) as sections of keys, in the dialects that makers' files have.

Read alike: every encoding and line end; any case, spaces and leading zeros in names of sections and keys; comments;
lines that are neither section nor key, which count for nothing. CiA 306 says nothing of a key that stands twice: the
last one counts, an empty one never.
"""

import codecs
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

from drivers.port import ConfigurationError

MOST_BYTES: Final = 2_000_000  # ten times the EDS of a large drive
ADVICE: Final = "Give the EDS file of the device, as its maker supplies it."
_BYTE_ORDER_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
# NUL: fill bytes at the end, and every second byte of ASCII in UTF-16 without a mark; 0x1A: end of a DOS file
_NO_TEXT: Final = dict.fromkeys((0x00, 0x1A, 0xFEFF))
_OBJECT: Final = re.compile(r"(?:0x)?0*([0-9a-f]{1,4})(?:sub(?:0x)?0*([0-9a-f]{1,2})|(name|value))?")
_NUMBER: Final = re.compile(r"([-+]?)(?:0x([0-9a-f]+)|(\d+)(?:\.0*)?)", re.ASCII)
_NODE_ID: Final = "$nodeid"
_MOST_DIGITS: Final = 20  # of UNSIGNED64


class EdsError(ConfigurationError):
    """An EDS file cannot be read, or does not describe the device that is needed."""


class EdsValue(NamedTuple):
    """Text behind a key, without comment, and its line from 1."""

    text: str
    line: int


@dataclass(slots=True)
class Section:
    """Keys of a section by name, lower-case without spaces. name: as the file has it; line: of its head, from 1."""

    name: str
    line: int
    values: dict[str, EdsValue] = field(default_factory=dict)
    repeated: list[tuple[str, EdsValue]] = field(default_factory=list)  # key and the value that does not count

    def text(self, key: str, otherwise: str = "") -> str:
        """Text of a key."""
        found = self.values.get(key)
        return otherwise if found is None else found.text


def read_bytes(path: Path) -> bytes:
    """Content of an EDS file. Raises EdsError for what is none by its kind or size."""
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):  # reading a pipe or a device may never end
            kind = "a folder" if stat.S_ISDIR(found.st_mode) else "no regular file"
            raise EdsError(f"is {kind}", where=f"{path}", advice=ADVICE)
        if found.st_size > MOST_BYTES:
            raise EdsError(
                "is no EDS file", where=f"{path}", given=f"{found.st_size} bytes",
                allowed=f"up to {MOST_BYTES} bytes", advice=ADVICE,
            )  # fmt: skip
        return path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a null byte in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise EdsError(f"cannot be read ({reason})", where=f"{path}", advice=ADVICE) from None


def decode(data: bytes) -> str:
    """Text of the bytes: by the byte order mark, else UTF-8, else Windows-1252."""
    for mark, codec in _BYTE_ORDER_MARKS:
        if data.startswith(mark):
            return data.decode(codec, "replace").translate(_NO_TEXT)
    try:
        return data.decode("utf-8").translate(_NO_TEXT)
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace").translate(_NO_TEXT)


def sections(text: str) -> dict[str, Section]:
    """Sections by `section_key`; one that stands twice is one."""
    found: dict[str, Section] = {}
    section = None
    for line, content in _lines(text):
        if content.startswith("["):  # also without its "]": its keys must not go to the section before
            name = content[1:].partition("]")[0].strip()
            section = found.setdefault(section_key(name), Section(name, line))
            continue
        key, sign, value = re.match(r"([^=:]*)([=:]?)(.*)", content, re.DOTALL).groups()  # type: ignore[union-attr]
        if section is None or not sign:
            continue
        _add(section, _flat(key), EdsValue(re.split(r"(?:^|\s);", value)[0].strip(), line))
    return found


def section_key(name: str) -> str:
    """Name of a section in one spelling: 6064, 1018sub1, 1003name, 1003value; else lower-case without spaces."""
    flat = _flat(name)
    match = _OBJECT.fullmatch(flat)
    if match is None:
        return flat
    index, subindex, more = match.groups()
    return f"{int(index, 16):04x}" + (more or ("" if subindex is None else f"sub{int(subindex, 16):x}"))


def number(text: str) -> int | None:
    """Integer of a text as 0x1F, 31, -3, 0.0 or 0031, with a comment behind it; None if it is none.

    CiA 306 takes a leading zero for octal. Files have it to fill up decimal numbers, and so it is read.
    """
    match = _NUMBER.fullmatch(_bare(text))
    if match is None or len(match[2] or match[3]) > _MOST_DIGITS:
        return None
    value = int(match[2], 16) if match[2] else int(match[3])
    return -value if match[1] == "-" else value


def octal(text: str) -> int | None:
    """The other value that a text with a leading zero may have; None without one."""
    flat = _bare(text)
    return int(flat, 8) if re.fullmatch(r"0[0-7]+", flat, re.ASCII) and len(flat) <= _MOST_DIGITS else None


def node_formula(text: str) -> int | None:
    """Number n of $NODEID+n, in either order; None if the text is no such formula."""
    flat = _bare(text)
    if _NODE_ID not in flat:
        return None
    rest = flat.replace(_NODE_ID, "", 1).strip("+")
    return number(rest) if rest else 0


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for line, content in enumerate(re.split(r"\r\n|\r|\n", text), start=1):
        stripped = content.strip()
        if stripped and stripped[0] not in ";#":
            yield line, stripped


def _add(section: Section, key: str, value: EdsValue) -> None:
    before = section.values.get(key)
    if before is not None and not value.text:
        return
    if before is not None and before.text and not _same(before.text, value.text):
        section.repeated.append((key, before))
    section.values[key] = value


def _same(one: str, other: str) -> bool:
    return _flat(one) == _flat(other) or (number(one) is not None and number(one) == number(other))


def _flat(text: str) -> str:
    return "".join(text.split()).lower()


def _bare(text: str) -> str:
    """A number or formula without comment, quotes and spaces, in lower case."""
    return _flat(re.split(r"[;#]|//", text)[0]).strip("\"'")
