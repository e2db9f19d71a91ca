"""Names of columns that lines above the numbers list by their place: "channel 1 = x_mm", "; #1 Pos [um] ; #2 Vel"."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from hil.importing.lexicon import lexicon
from hil.importing.listed_scales import fields_of, scale_field
from hil.importing.text_lines import split_line
from hil.importing.units import unit_named

NAMELESS = "column "  # beginning of the name of a column over which nothing stands
_ENDS = " \t;,|=:\"'"


@dataclass(frozen=True)
class ListedNames:
    """Names of all columns in their order, the lines (from 0) that list them, and the factors behind the names."""

    names: tuple[str, ...]
    lines: frozenset[int]
    scales: dict[str, str]


def listed_names(lines: Sequence[str], delimiter: str, width: int, counted: bool = False) -> ListedNames | None:
    """Names of `width` columns, numbered from 0 or 1 in turn and all different; None without such a list.

    A first column that numbers the rows (`counted`) may be without a name. A row that has such numbers in its fields
    gives the names itself.
    """
    words = "|".join(lexicon().enumerated)
    place = re.compile(
        rf"(?:(?<!\w)(?:{words})[\s._]*#?|#)\s*(\d+)(?![\d.])\s*[:=.)]?|(?:^|[;,|])\W*(\d+)\s*[:=)](?!\d)",
        re.IGNORECASE,
    )
    given: list[tuple[int, int, str]] = []
    for index, line in enumerate(lines):
        found = list(place.finditer(line))
        if len(found) >= width - counted and len(split_line(line, delimiter)) == width:
            return None  # a row of names, Ch1;Ch2: `unit_lines` reads what lines above say of them
        for number, match in enumerate(found):
            end = found[number + 1].start() if number + 1 < len(found) else len(line)
            name = line[match.end() : end].strip(_ENDS)
            if re.search(r"[^\W\d]", name):
                given.append((index, int(match[1] or match[2]), name))
    for first, several in ((0, width), (1, width), *(((1, width - 1),) if counted else ())):
        numbered = [one for one in given if first <= one[1] < first + several]
        told, behind = False, dict[str, str]()
        for apart in (r"\s{2,}|\s*[\t;|]\s*", r"\s*,\s*"):
            parts = [re.split(apart, name, maxsplit=1) for _, _, name in numbered]
            behind = behind if told else {part[0]: _size(part[1]) for part in parts if len(part) == 2}
            told = len(behind) == several and sum(map(bool, behind.values())) > several / 2
        names = tuple(behind) if told else tuple(name for _, _, name in numbered)
        in_turn = [number for _, number, _ in numbered] == list(range(first, first + several))
        if in_turn and len(set(names)) == several > 1:
            scales = {name: size for name, size in behind.items() if size} if told else {}
            lacking = [f"{NAMELESS}1"] * (width - several)
            return ListedNames((*lacking, *names), frozenset(index for index, _, _ in numbered), scales)
    return None


def _size(text: str) -> str:
    """Factor and unit of a channel in the fields behind its name: "mm; scale 0,001" -> scale 0,001 mm; "" if none."""
    fields = fields_of(text)
    unit = next((field for field in fields if unit_named(field)), "")
    scale = next((field for field in fields if scale_field(field)), "scale 1" if unit else "")
    return f"{scale} {unit}".strip()
