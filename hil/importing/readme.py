"""Hints of a user about a file: sampling rate, axis, and a README or data sheet with sizes and units."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hil.files.input_file import check_file
from hil.importing.encodings import encoding_of
from hil.importing.foreign_table import ForeignTable, is_raw
from hil.importing.header_values import header_values
from hil.importing.readme_columns import ToldColumn, told_columns
from hil.importing.unit_lines import described

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
    listed = {title: ToldColumn(*one) for title, one in described(lines, list(titles)).items()}
    told = {titles[title]: one for title, one in (told_columns(lines, list(titles)) | listed).items()}
    steps = {name: one.step for name, one in told.items() if one.step != 1.0 and name not in table.units}
    scales = {name: (step, 0.0) for name, step in steps.items() if is_raw(table.columns[name], step, 0.0)}
    units = {name: one.unit for name, one in told.items() if one.unit and (name in scales or name not in steps)}
    return replace(
        table,
        units=units | table.units,
        scales=scales | table.scales,
        words={name: one.words for name, one in told.items() if one.words} | table.words,
        constants=header_values(lines, {}) | table.constants,
    )
