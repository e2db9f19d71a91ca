"""What a README says of the columns of a file: words, unit, and the size of one count.

A list has a line for each, "q_mot   motor encoder, degrees of the motor", "- force [N], measured", "3. scale [counts],
0.2 um each". A name that is no word, with a digit or an underscore, may stand anywhere in a line: "S-0-0047 position
command, S-0-0051 position feedback, both 0.0001 mm". What stands behind a name, up to the next one, is said of it.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from hil.importing.lexicon import lexicon
from hil.importing.units import factor_and_unit, unit_named

_WORDS = ("in", "second", "minute", "turn", "revolution", "meter", "metre", "count")  # no units at the end of a phrase
_BEHIND_NAME = r"(?:\s*[:=]\s*|\s+[-–]\s+|\s{2,}|\t\s*|\s*(?=[\[(]))"
_BEHIND_NUMBER = r"(?:[.):]\s*|\s+)"
_PHRASES = re.compile(r"[;()\[\]]|,(?!\d)")
_FEWEST = 3  # columns that a sentence lists: fewer are words


class ToldColumn(NamedTuple):
    """Words and unit of a column, "" without; one of its whole numbers is `step` units."""

    words: str
    unit: str
    step: float = 1.0


def told_columns(lines: Sequence[str], names: Sequence[str]) -> dict[str, ToldColumn]:
    """What `lines` say of columns with the `names`; nothing where they tell less than two units."""
    told = dict[str, ToldColumn]()
    for line in lines:
        of_both: ToldColumn | None = None  # what the next name in the line says of this one, too
        for name, text in reversed(_mentions(line, [one for one in names if one])):
            one = _told(text)
            one = of_both._replace(words=one.words) if of_both and not one.unit else one
            of_both = one if _says_both(text) else None
            if name not in told or (one.unit and not told[name].unit):
                told[name] = one
    return told if sum(bool(one.unit) for one in told.values()) > 1 else _in_a_row(" ".join(lines), names)


def _mentions(line: str, names: Sequence[str]) -> list[tuple[str, str]]:
    """Names of columns in a line, and the text behind each up to the next."""
    places: list[tuple[int, int, str]] = []
    for name in names:
        own, of_file = re.escape(name), re.fullmatch(r"column (\d+)", name)  # without a header
        begin = rf"(?:[Cc]olumn )?{of_file[1]}{_BEHIND_NUMBER}" if of_file else rf"{own}{_BEHIND_NAME}"
        match = re.match(rf"[\s*•–-]*{begin}(?=\S)", line) or re.match(rf"\s*[*•–-]\s*{own}\s+(?=\S)", line)
        if not match and re.search(r"[\d_]", name) and len(name) > 1:
            match = re.search(rf"(?<![\w.-]){own}(?![\w-])", line)
        places += [(match.start(), match.end(), name)] if match else []
    places.sort()
    ends = [*(start for start, _, _ in places), len(line)][1:]
    return [(name, line[begin:end].strip(" :=-–,;\t")) for (_, begin, name), end in zip(places, ends, strict=False)]


def _says_both(text: str) -> bool:
    return any(re.match(rf"(?:{'|'.join(lexicon().both)})\b", phrase) for phrase in _phrases(text))


def _phrases(text: str) -> list[str]:
    return [part.strip() for part in _PHRASES.split(text) if part.strip()]


def _told(text: str) -> ToldColumn:
    """Words, unit and step of what is said of a column: a unit by itself before the size of a count."""
    phrases = _phrases(text)
    unit = next((unit for part in phrases if (unit := _unit_at_an_end(part))), "")
    words = phrases[0] if phrases and phrases[0] != unit else ""
    if not unit or unit_named(unit) == "counts":
        step = next((found for part in phrases if (found := _step(part))), (1.0, unit))
        return ToldColumn(words, step[1], step[0])
    return ToldColumn(words, unit)


def _step(phrase: str) -> tuple[float, str] | None:
    """Size of a count with which a phrase begins: 0.0001 mm, 0,1 % of the rated torque, both 0.2 um each."""
    words = re.sub(rf"^(?:{'|'.join(lexicon().both)})\s+", "", phrase).split()
    for take in (1, 2, 3) if words and re.match(r"\d|1/", words[0]) else ():
        size, beyond = " ".join(words[:take]), words[take : take + 1]
        if unit_named(size) == "permille":
            return 1.0, size
        part = factor_and_unit(size)
        if part and unit_named(part[1]) != "counts" and not _part_of_unit(beyond):
            return part
    return None


def _in_a_row(text: str, names: Sequence[str]) -> dict[str, ToldColumn]:
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
    told = {name: _told(re.split(r"[.](?:\s|$)", part)[0]) for name, part in parts.items()}
    told = {name: one for name, one in told.items() if one.unit}
    return told if len(told) > 1 else {}


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
