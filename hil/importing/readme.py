"""What a user tells beside a file: its rate, its axis, and a text of its owner, a README or a data sheet."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hil.files.input_file import check_file
from hil.importing.encodings import encoding_of
from hil.importing.foreign_table import ForeignTable
from hil.importing.header_values import header_values
from hil.importing.unit_lines import described

_LONGEST = 1_000_000  # bytes


class FileHints(NamedTuple):
    """Rows per second of a file without time stamps, the axis of one with several, and a text of its owner."""

    rate_hz: float | None = None
    axis: str | None = None
    readme: Path | None = None

    @classmethod
    def of(cls, options: Mapping[str, str]) -> "FileHints":
        """The same of options of the command line."""
        rate, readme = options.get("--rate"), options.get("--readme")
        return cls(float(rate) if rate else None, options.get("--axis"), Path(readme) if readme else None)

    @property
    def options(self) -> list[str]:
        """Options of the command line that tell it."""
        rate = f"{self.rate_hz:g}" if self.rate_hz else None
        told = (("--rate", rate), ("--axis", self.axis), ("--readme", self.readme))
        return [text for name, value in told if value for text in (name, str(value))]


def with_readme(table: ForeignTable, readme: Path) -> ForeignTable:
    """The table with constants, and units and words of its columns, by a text; what the file says goes first.

    Raises InputError: no such file, or no text.
    """
    check_file(readme, "a text of the owner", _LONGEST)
    raw = readme.read_bytes().splitlines()
    encoding = encoding_of(raw)
    lines = [line.decode(encoding) for line in raw]
    titles = {table.titles.get(name, name): name for name in table.columns}
    told = {titles[title]: one for title, one in described(lines, list(titles)).items()}
    return replace(
        table,
        units={name: unit for name, (_, unit) in told.items() if unit} | table.units,
        words={name: words for name, (words, _) in told.items() if words} | table.words,
        constants=header_values(lines, {}) | table.constants,
    )
