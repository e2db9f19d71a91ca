"""Names of columns that lines above the numbers list by their place: "channel 1 = x_mm", "; #1 Pos [um] ; #2 Vel"."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from hil.importing.lexicon import lexicon
from hil.importing.text_lines import split_line

_ENDS = " \t;,|=:\"'"


@dataclass(frozen=True)
class ListedNames:
    """Names of all columns in their order, and the lines (from 0) that list them."""

    names: tuple[str, ...]
    lines: frozenset[int]


def listed_names(lines: Sequence[str], delimiter: str, width: int) -> ListedNames | None:
    """Names of `width` columns, numbered from 0 or 1 in turn and all different; None without such a list.

    A row that has such numbers in its fields gives the names itself.
    """
    words = "|".join(lexicon().enumerated)
    place = re.compile(
        rf"(?:(?<!\w)(?:{words})[\s._]*#?|#)\s*(\d+)(?![\d.])\s*[:=.)]?|(?:^|[;,|])\W*(\d+)\s*[:=)](?!\d)",
        re.IGNORECASE,
    )
    given: list[tuple[int, int, str]] = []
    for index, line in enumerate(lines):
        found = list(place.finditer(line))
        if len(found) == width == len(split_line(line, delimiter)):
            return None  # a row of names, Ch1;Ch2: `unit_lines` reads what lines above say of them
        for number, match in enumerate(found):
            end = found[number + 1].start() if number + 1 < len(found) else len(line)
            name = line[match.end() : end].strip(_ENDS)
            if re.search(r"[^\W\d]", name):
                given.append((index, int(match[1] or match[2]), name))
    for first in (0, 1):
        numbered = [one for one in given if first <= one[1] < first + width]
        names = tuple(name for _, _, name in numbered)
        if [number for _, number, _ in numbered] == list(range(first, first + width)) and len(set(names)) == width > 1:
            return ListedNames(names, frozenset(index for index, _, _ in numbered))
    return None
