"""What a README tells about the columns of a file: words, unit, and the size of one count.

A list has a line for each, "q_mot   motor encoder, degrees of the motor", "- force [N], measured"; of a file without a
header by number, "3. scale [counts], 0.2 um each". A name that is no word, with a digit or an underscore, may stand
anywhere in a line: "S-0-0047 position command, S-0-0051 position feedback, both 0.0001 mm". What stands behind a name,
up to the next one, is said of it.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from hil.importing.lexicon import Quantity, lexicon, without_accents
from hil.importing.spoken_sizes import plain_sizes
from hil.importing.units import QUANTITY_OF_UNIT, factor_and_unit, unit_named

_WORDS = ("in", "second", "minute", "turn", "revolution", "meter", "metre", "count")  # no units at the end of a phrase
_BEHIND_NAME = r"(?:\s*[:=]\s*|\s+[-–]\s+|\s{2,}|\t\s*|\s*(?=[\[(]))"
_NUMBERED = re.compile(r"[\s*•–-]*(?:[Cc]olumn )?(\d+)(?:[.):]\s*|\s+)(?=\S)(.*)")
_PHRASES = re.compile(r"[;()\[\]]|,(?!\d)|:\s")
_SIZE = re.compile(r"(?:1/)?\d[\d.,e-]*\s*[^\d\s]\S*")
_EQUAL = re.compile(r"(\d+(?:,\d{3})*)\s*([^\W\d]*)\s*=\s*(\d+(?:[.,]\d+)?)\s*([^\W\d][^\d=]*)")
_ONE_TURN = re.compile(  # 524288 Inc = 1 rev, of the motor
    r"(?<![\d.,])(\d+)\s*([^\W\d]+)\s*=\s*(?:1|one|eine)\s+(?:(?:motor|full|whole) )?"
    r"(?:motor)?(?:turn|rev(?:olution)?|umdr\w*|tour|giro|vuelta)\b"
    r"(?! ?(?:/|per\b|pro\b|of\b|der\b|des\b|\((?:x|×|\d)))",
    re.IGNORECASE,
)
_PER_VOLT = re.compile(
    r"([+-]?\d+(?:\.\d+|,\d{1,2}(?!\d))?(?:e[+-]?\d+)?)\s*([^\W\d](?:[^\d/]|/(?=s\b|min))*?)\s*(?:/|\b(?:per|pro)\b)\s*(m?V)"
)
_EACH = re.compile(r"(?:each|per (?:count|increment|inc|lsb|digit)|/\s*(?:count|inc|lsb|digit))?", re.IGNORECASE)
_OF_RATED = re.compile(r"(?:of|der|des|vom|du|de la|del|della)\s.*")
_PER_TURN = re.compile(  # 65536 counts per motor turn
    r"(?<![\d.,])(\d+)\s+(\w+)(?: ?/ ?| (?:per|pro|je|par|por|al) )"
    r"(?:\w+[ -])?(?:motor)?(?:turn|rev|umdr|tour|giro|vuelta)",
    re.IGNORECASE,
)
_CELLS = re.compile(r"\s*\|(.+)\|\s*")  # a row of a table
_NOTHING = re.compile(r"(?:and|und|et|e|y|&)?")
_SENTENCE = re.compile(r"[.]\s+(?=[A-ZÄÖÜÉÈ])")
WHOLES = {"%": 100.0, "permille": 1000.0}  # the rated torque, in units of a share of it
_FEWEST = 3  # columns that a sentence lists: fewer are words


class ToldColumn(NamedTuple):
    """Words and unit of a column, "" without; a count is `step` units, and a turn has `per_turn` counts, where told.

    `of`: the unit of the column itself, such as V, of which `step` is the factor to `unit`; "" where it has counts.
    """

    words: str
    unit: str
    step: float | None = None
    per_turn: int | None = None
    of: str = ""


def told_columns(lines: Sequence[str], names: Sequence[str], prose: bool = False) -> dict[str, ToldColumn]:
    """What `lines` say of the columns `names`: a list of them; sentences, if the list gives fewer than two units.

    A line that begins with a name goes before one in which it stands, a unit before the size of a count. `prose`: a
    name that is a word may begin a sentence of its own.
    """
    lines = [_plain_line(line) for line in lines]
    told, ranks = dict[str, ToldColumn](), dict[str, tuple[bool, bool]]()
    mentions = [[(name, True, text)] for name, text in _numbered(lines, names)]
    mentions += [_mentions(line, [one for one in names if one], prose) for line in lines]
    for line in mentions:
        of_both: ToldColumn | None = None  # what the next name in the line says of this one, too
        for name, begins, text in reversed(line):
            one = _told(text)
            one = of_both._replace(words=one.words) if of_both and not one.unit else one
            of_both = of_both if _NOTHING.fullmatch(text) else _of_both(text)
            rank = begins, one.step is None
            if one.unit and (name not in told or rank > ranks[name]):
                told[name], ranks[name] = one, rank
    if len(told) > 1:
        return told
    return {} if prose else _in_a_row(" ".join(lines), names) or told_columns(lines, names, prose=True)


def _plain_line(line: str) -> str:
    """A line of Markdown as a list has it: a row of a table with a colon behind its first cell, no signs of code."""
    line = line.replace("`", "")
    cells = [cell.strip() for cell in match[1].split("|")] if (match := _CELLS.fullmatch(line)) else []
    return f"- {cells[0]}: {', '.join(cells[1:])}" if len(cells) > 1 else line


def _numbered(lines: Sequence[str], names: Sequence[str]) -> list[tuple[str, str]]:
    """Names of columns of a file without a header, and the texts of the last list of them that tells most units.

    A list has growing numbers; a procedure before it may be numbered, too.
    """
    lists, before = [list[tuple[str, str]]()], 0
    for match in filter(None, map(_NUMBERED.match, lines)):
        name, number = f"column {match[1]}", int(match[1])
        lists += [[]] if number <= before else []
        before = number
        lists[-1] += [(name, match[2])] if name in names else []
    units = [sum(bool(_told(text).unit) for _, text in one) for one in lists]
    return next(one for one, many in zip(reversed(lists), reversed(units), strict=True) if many == max(units))


def _mentions(line: str, names: Sequence[str], prose: bool) -> list[tuple[str, bool, str]]:
    """Names of columns in a line, whether it begins with them, and the text behind each up to the next."""
    places: list[tuple[int, int, str, bool]] = []
    for name in names:
        own = re.escape(name)
        match = re.match(rf"[\s*•–-]*{own}{_BEHIND_NAME}(?=\S)", line) or re.match(rf"\s*[*•–-]\s*{own}\s+(?=\S)", line)
        within = None
        if not match and re.search(r"[\d_]", name) and len(name) > 1:
            within = re.search(rf"(?<![\w.-]){own}(?![\w-])", line)
        elif not match and prose:
            within = re.search(rf"(?:^|[.]\s+){own} (?=in )", line)  # a sentence of it: I act in digits
        places += [(one.start(), one.end(), name, one is match) for one in (match or within,) if one]
    places.sort()
    ends = [*(place[0] for place in places), len(line)][1:]
    texts = [line[begin:end] for (_, begin, _, _), end in zip(places, ends, strict=False)]
    return [
        (name, begins, _until_a_unit(text).strip(" :=-–,;.\t"))
        for (_, _, name, begins), text in zip(places, texts, strict=True)
    ]


def _until_a_unit(text: str) -> str:
    """The first sentences of a text, up to the one that gives a unit; what follows may be of something else."""
    ends = [match.start() for match in _SENTENCE.finditer(text)]
    return next((text[:end] for end in ends if _told(text[:end]).unit), text)


def _phrases(text: str) -> list[str]:
    return [part.strip() for part in _PHRASES.split(text) if part.strip()]


def _of_both(text: str) -> ToldColumn | None:
    """Unit and step that a phrase such as "both 0.0001 mm" gives the column before it, too; None without one."""
    begin = rf"(?:{'|'.join(lexicon().both)})\s+"
    found = (_told(re.sub(begin, "", phrase)) for phrase in _phrases(text) if re.match(begin, phrase))
    return next((one for one in found if one.unit), None)


def _told(text: str) -> ToldColumn:
    """Words, unit and step of what is said of a column. A plain unit goes before the size of a count."""
    text = plain_sizes(text)
    phrases = _phrases(text)
    unit = next((unit for part in phrases if (unit := _unit_at_an_end(part))), "")
    volts = next(filter(None, map(_per_volt, phrases)), None) if unit_named(unit) in (None, "V", "mV") else None
    if volts:
        return volts._replace(words="" if _per_volt(phrases[0]) else phrases[0])
    words = phrases[0] if phrases and phrases[0] != unit else ""
    counts = unit_named(unit) == "counts"
    share = named if (named := unit_named(unit)) in WHOLES else ""
    equal = next(filter(None, map(_equal, phrases)), None)
    per_turn = _counts(_PER_TURN, text)
    if equal and not per_turn and (not unit or counts or share):
        per_turn = _counts(_ONE_TURN, text) if re.search("motor", text, re.IGNORECASE) else None
        if not per_turn:
            of = share if share and equal[2] == WHOLES[share] else ""
            return ToldColumn("" if _equal(phrases[0]) else words, equal[1], equal[0], of=of)
    if (unit and not counts) or per_turn:
        return ToldColumn(words, unit or "counts", per_turn=per_turn)
    steps = (step for part in phrases if (step := _step(part, counts)))
    if found := next((ToldColumn(words, of_step, size) for size, of_step in steps), None):
        return found
    per_turn = _counts(_ONE_TURN, text)
    return ToldColumn(words, unit or ("counts" if per_turn else ""), per_turn=per_turn)


def _counts(pattern: re.Pattern[str], text: str) -> int | None:
    """Counts per turn that a text tells in the words of a pattern; None without."""
    found = (one for one in pattern.finditer(text) if unit_named(without_accents(one[2])) == "counts")
    return next((int(one[1]) for one in found), None)


def _per_volt(phrase: str) -> ToldColumn | None:
    """Size and unit for each volt of the column, where a phrase is nothing else: 2 Nm/V; None for others."""
    match = _PER_VOLT.fullmatch(phrase)
    unit = unit_named(match[2]) if match else None
    if not match or unit is None or QUANTITY_OF_UNIT.get(unit, Quantity.UNKNOWN) in (Quantity.UNKNOWN, Quantity.OTHER):
        return None
    return ToldColumn("", unit, float(match[1].replace(",", ".")), of=match[3])


def _equal(phrase: str) -> tuple[float, str, float] | None:
    """Size and unit of a count, told by an equation, and its left side where that has no unit: 1000 = 3.2 Nm.

    Or 16384 digits = 16 A; None without one.
    """
    match = _EQUAL.fullmatch(phrase)
    whole, own, size, unit = match.groups() if match else ("", "", "", "")
    if not (match and _is_unit(unit) and (own in ("", "digit", "digits") or unit_named(own) == "counts")):
        return None
    many, value = float(whole.replace(",", "")), float(size.replace(",", "."))
    return (value / many, unit, 0.0 if own else many) if many and value else None


def _step(phrase: str, counts: bool) -> tuple[float | None, str] | None:
    """Size of a count and its unit, where a phrase is nothing else: 0.0001 mm, 0,1 % of the rated torque, 0.2 um each.

    A whole number of units may be another size, unless the column is in `counts` or it is said of each.
    """
    phrase, of_count = re.subn(r"^lsb\s*=?\s+", "", phrase, flags=re.IGNORECASE)
    match = _SIZE.match(re.sub(rf"^(?:{'|'.join(lexicon().both)})\s+", "", phrase))
    size, rest = (match[0], match.string[match.end() :].strip()) if match else ("", "")
    share, each = bool(_OF_RATED.fullmatch(rest)), bool(_EACH.fullmatch(rest))
    if unit_named(size) == "permille" and (share or each):
        return None, size
    part = factor_and_unit(size)
    if part is None or not part[0] > 0.0 or unit_named(part[1]) == "counts":
        return None
    sure = counts or bool(of_count) or bool(rest) or part[0] <= 1.0
    return part if (each and sure) or (share and unit_named(part[1]) == "%") else None


def _in_a_row(text: str, names: Sequence[str]) -> dict[str, ToldColumn]:
    """The same of columns that a sentence lists: "angle = table angle in degrees (0.001 deg), iq = current in A".

    Without signs between them they are in the order of the file: "t in s, q motor angle in degrees, M torque in Nm", or
    "t (s), q (rad, joint side), M (Nm)".
    """
    places = [(match, name) for name in names if (match := re.search(rf"(?<!\w){re.escape(name)} = ", text))]
    places.sort(key=lambda place: place[0].start())
    if not places:
        found = [(re.search(rf"(?:^|[,;:.]\s+){re.escape(name)}\s+(?=[\w(])", text), name) for name in names]
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
