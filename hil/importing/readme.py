"""Hints of a user about a file: sampling rate, axis, and a README or data sheet with sizes and units."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hil.files.input_file import check_file
from hil.importing.encodings import encoding_of
from hil.importing.foreign_table import ForeignTable
from hil.importing.header_values import header_values
from hil.importing.unit_lines import described
from hil.importing.units import unit_named

_WORDS = ("in", "second", "minute", "turn", "revolution", "meter", "metre", "count")  # no units at the end of a phrase
_BEHIND_NAME = r"(?:\s*[:=]\s*|\s+[-–]\s+|\s{2,}|\t\s*)"
_FEWEST = 3  # columns that a sentence lists: fewer are words
_LONGEST = 1_000_000  # bytes: no README is as long


class FileHints(NamedTuple):
    """Sampling rate of a file without time stamps, axis of a file with several, README of the machine."""

    rate_hz: float | None = None
    axis: str | None = None
    readme: Path | None = None

    @classmethod
    def of(cls, options: Mapping[str, str]) -> "FileHints":
        """The hints in options of the command line, by name."""
        rate, readme = options.get("--rate"), options.get("--readme")
        return cls(float(rate) if rate else None, options.get("--axis"), Path(readme) if readme else None)

    @property
    def options(self) -> list[str]:
        """The hints as options of the command line."""
        rate = f"{self.rate_hz:g}" if self.rate_hz else None
        told = (("--rate", rate), ("--axis", self.axis), ("--readme", self.readme))
        return [text for name, value in told if value for text in (name, str(value))]


def with_readme(table: ForeignTable, readme: Path) -> ForeignTable:
    """Add the constants, and the units and words of columns, that a README tells; what the file says goes first.

    Raises InputError: no such file, or one of more than 1 MB.
    """
    check_file(readme, "a text of the owner", _LONGEST)
    raw = readme.read_bytes().splitlines()
    encoding = encoding_of(raw)
    lines = [line.decode(encoding) for line in raw]
    titles = {table.titles.get(name, name): name for name in table.columns}
    listed = _listed(lines, list(titles)) | described(lines, list(titles))
    told = {titles[title]: one for title, one in listed.items()}
    return replace(
        table,
        units={name: unit for name, (_, unit) in told.items() if unit} | table.units,
        words={name: words for name, (words, _) in told.items() if words} | table.words,
        constants=header_values(lines, {}) | table.constants,
    )


def _listed(lines: Sequence[str], names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Words and unit of columns in a list of them, a line each: "q_mot   motor encoder, degrees of the motor"."""
    told = dict[str, tuple[str, str]]()
    for name in names:
        number = re.fullmatch(r"column (\d+)", name)  # of a file without a header
        begin = rf"(?:[Cc]olumn )?{number[1]}\s+" if number else rf"{re.escape(name)}{_BEHIND_NAME}"
        found = (re.match(rf"[\s*•-]*{begin}(?=\S)(.*)", line) for line in lines if name)
        one = next((one for match in found if match and (one := _words_and_unit(match[1]))), None)
        told |= {name: one} if one else {}
    return told if len(told) > 1 else _in_a_row(" ".join(lines), names)


def _in_a_row(text: str, names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """The same of columns that a sentence lists: "angle = table angle in degrees (0.001 deg), iq = current in A".

    Without signs between them they are in the order of the file: "t in s, q motor angle in degrees, M torque in Nm".
    """
    places = [(match, name) for name in names if (match := re.search(rf"(?<!\w){re.escape(name)} = ", text))]
    places.sort(key=lambda place: place[0].start())
    if not places:
        found = [(re.search(rf"(?:^|[,;:.]\s+){re.escape(name)}\s+(?=\w)", text), name) for name in names]
        places = [(match, name) for match, name in found if match]
        begins = [match.start() for match, _ in places]
        if len(places) < max(len(names), _FEWEST) or begins != sorted(begins):
            return {}
    ends = [*(match.start() for match, _ in places), len(text)][1:]
    parts = {name: text[match.end() : end] for (match, name), end in zip(places, ends, strict=True)}
    told = {name: one for name, part in parts.items() if (one := _words_and_unit(re.split(r"[.](?:\s|$)", part)[0]))}
    return told if len(told) > 1 else {}


def _words_and_unit(text: str) -> tuple[str, str] | None:
    """Words and unit of what a list says of a column; None without a unit."""
    phrases = [part.strip() for part in re.split(r"[,;()]", text) if part.strip()]
    unit = next((unit for part in phrases if (unit := _unit_at_an_end(part))), "")
    return ("" if phrases[0] == unit else phrases[0], unit) if unit else None


def _unit_at_an_end(phrase: str) -> str:
    """Unit with which a phrase without numbers begins or ends, "torque in N m", "degrees of the joint", or which stands
    behind "in"; "" without one.

    A letter is a unit at the end only, and one beside another, or beside "per", is none.
    """
    words = phrase.split()
    for take in (3, 2, 1) if not re.search(r"\d", phrase) else ():
        first, last = " ".join(words[:take]), " ".join(words[-take:])
        if _is_unit(last) and not _part_of_unit(words[:-take][-1:]):
            return last
        if len(first) > 1 and _is_unit(first) and not _part_of_unit(words[take : take + 1]):
            return first
        among = re.search(rf"\bin ((?:\S+ ){{{take - 1}}}\S+) (\S+)", phrase)  # torque in Nm at the shaft
        if among and len(among[1]) > 1 and _is_unit(among[1]) and not _part_of_unit([among[2]]):
            return among[1]
    return ""


def _is_unit(text: str) -> bool:
    return text not in _WORDS and unit_named(text) is not None


def _part_of_unit(beside: Sequence[str]) -> bool:
    """True if the word beside a unit makes it a part of another one."""
    return any(word in ("per", "/") or _is_unit(word) for word in beside)
