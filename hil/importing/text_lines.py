"""Lines of a text file: their fields, the names of the columns, a line for a message."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from itertools import islice, pairwise
from pathlib import Path
from typing import TextIO

from hil.errors import InputError
from hil.files.date_stamps import is_date
from hil.files.input_file import lines_of
from hil.importing.map_file import CsvOptions

_ARROW = "->"
_SHOWN = 60  # characters of a line in a message


def open_text(path: Path, encoding: str) -> TextIO:
    """Open a text file, whose characters may be damaged. Raises InputError: an unknown encoding."""
    try:
        return path.open(encoding="utf-8-sig" if encoding == "utf-8" else encoding, errors="replace", newline="")
    except LookupError:
        raise InputError(
            f"{path}: given the encoding {encoding!r}, allowed one that Python knows; give utf-8 or latin-1"
        ) from None


def split_line(line: str, delimiter: str) -> list[str]:
    """Fields of a line; the delimiter " " stands for one or more blanks."""
    if of_terminal(line):
        stamp, _, rest = line.partition(_ARROW)
        return [stamp.strip(), *split_line(rest.strip(), delimiter)]
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [field.strip() for field in line.replace("\0", "").rstrip("\r\n").split(delimiter)]
    try:
        row = next(csv.reader([line.replace("\0", "").rstrip("\r\n")], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        return [line]
    return [field.strip() for field in row]


def of_terminal(line: str) -> bool:
    """True for a line before which a terminal wrote the time of its host: 12:00:00.123 -> 1.5; it may be cut."""
    stamp, arrow, _ = line.partition(_ARROW)
    return bool(arrow) and is_date(stamp)


def times_of_groups(fields: Sequence[str]) -> tuple[int, ...]:
    """Places of the columns of time by a row that has the same text over each: Time;x;Time (2);M;Q; () else."""
    stems = [re.sub(r"[\d.]+| \(\d+\)", "", field) for field in fields]
    places = tuple(index for index, stem in enumerate(stems) if stem == stems[0])
    apart = all(second - first > 1 for first, second in pairwise(places))
    return places if len(places) > 1 and stems[0] and apart and places[-1] < len(stems) - 1 else ()


def header_names(path: Path, options: CsvOptions) -> tuple[str, ...]:
    """Names of the columns by the options of a map. Raises InputError: an empty file, a name that stands twice."""
    if options.column_names is not None:
        return options.column_names
    with open_text(path, options.encoding) as file:
        lines = enumerate(islice(lines_of(path, file), options.skip_lines, None), options.skip_lines + 1)
        number, header = next(((number, line) for number, line in lines if line.strip()), (0, ""))
    names = tuple(split_line(header, options.delimiter))
    if not names:
        raise InputError(f"{path}: the file is empty; give a file with a header and rows of numbers")
    repeated = next((name for name, times in Counter(names).items() if name and times > 1), None)
    if repeated is not None:
        raise InputError(
            f"{path}:{number}: {repeated!r} stands twice in the header, allowed once; give all names in the map: "
            "csv.column_names, with skip_lines up to the numbers"
        )
    return names


def line_of(path: Path, number: int, encoding: str) -> str:
    """Text of a line (from 1) of a file."""
    with open_text(path, encoding) as file:
        return next(islice(lines_of(path, file), number - 1, None), "")


def shown(line: str) -> str:
    """Beginning of a line for a message."""
    text = line.strip()
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
