"""Constants that a file gives beside its columns: in lines above the numbers, or as scalars with a name.

A line holds one or several of "words [(unit)] [: = ; ,] number [unit]". The words of a constant end those before the
number, those of a lead may follow its unit ("a screw with 5 mm lead"); a ratio of units such as N m/A or counts/rev
says by itself what it is. Words are those of `lexicon.yaml`, compared without accents; a scalar has its unit in its
name. The way per turn of the motor goes before all other words of a lead, which may be behind a gear.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hil.importing.lexicon import Constant, ConstantWords, lexicon, without_accents
from hil.importing.nominal_values import nominal_told
from hil.importing.units import unit_named
from hil.importing.values_behind import Statement, size_of_count, told_behind
from hil.quantities import UNITS


@dataclass(frozen=True)
class HeaderValue:
    """Value in the SI unit of its constant, and the text that gives it."""

    value: float
    text: str


_NUMBER = re.compile(r"(?<![\w.^])(?<!\d,)[+-]?\d+(?:[.,]\d+)*(?:e[+-]?\d+)?(?!\d*x[0-9a-f])")
# addresses, the index of a parameter, and what a rated value stands for
_NO_VALUE = re.compile(r"\b0x[0-9a-f]+(:[0-9a-f]+)?|(?<=\w)\[\d+\]|[(\[]\s*100\s*%\s*[)\]]")
_BRACKET = re.compile(r"[\[({]([^\[({]*?)[\])}][\s:=;,|\"']*$")
_SEPARATED, _PHRASES = re.compile(r"[\s:=;,|\"']*"), re.compile(r"[;,|\t:=\"]+")
_SIGNS = re.compile(r"[\s·・*.\"']+")  # between the parts of a unit
_TEXT_OF_NAME, _PER = re.compile(r"[^\w/]+|_"), re.compile(r"/|per|pro|je|par")
_TURN_IS = re.compile(r"^1\s*(\w+)\s*=\s*([\d.,]+)\s*(\w+)$")  # 1 rev = 5 mm
_WHOLE_IS = re.compile(  # 100 % = 28 N m, or 28 N m (= 100 %)
    r"100\s*%\s*(?:=|:|is|equals|corresponds to|entspricht)\s*(?P<size>\d[\d.,]*)\s*(?P<unit>[a-z][a-z·* ]*)"
    r"|(?P<before>\d[\d.,]*)\s*(?P<its>[a-z][a-z·* ]*?)\s*[(\[]?\s*(?:=|is|equals|corresponds to|entspricht)\s*100\s*%"
)
_EQUALS, _RESTATED = re.compile(r"\s*=\s*"), re.compile(r"[(\[]\s*=\s*$")
_PRODUCT = re.compile(r"=\s*([a-z]\w*)\s*[*x·]\s*([a-z]\w*)\s*$")
# behind a number: 32 mm [of strip, ram feed] per motor revolution; 10 mm pitch directly coupled, 4 mm lead, ...
_PER_MOTOR_TURN = re.compile(
    r"^ *([a-z]+)(?: of(?: [a-z]+){1,2}|(?: [a-z]+)? (?:feed|travel|movement|vorschub|weg))?"
    r" ?(?:/|\b(?:per|pro|je)\b) ?motor[ -]?(?:turn|rev|umdr)"
)
_MOTOR_TURN_IS = re.compile(r"\bmotor[ -]?(?:turn|rev\w*|umdrehung) *(?:is|gives|equals|=|:|entspricht) *$")
_BEHIND = re.compile(  # 10 mm screw lead
    r"^ *([a-z]+) ((?:(?:ball ?)?screw |spindle )?[^\W\d]+)(?= *(?:$|[\[\](){},;:|\t\"]|->|[.] |[.]$| -|dire[ck]t))"
)
_DEVIATES = re.compile(
    r"\b(error|deviation|tolerance|accura|repeatab|runout|runs? out|backlash|play|noise|eccentric|cyclic|wobble"
    r"|variation|fehler|abweichung|toleranz|spiel|rundlauf)"
)
_SENTENCES = re.compile(r"(?<!\bca)(?<!\bapprox)(?<!\babt)[.;!?](?:\s(?!\s)|$)")  # two blanks: a column
_GROUPED = re.compile(r"\d{1,3}(?:[.,]\d{3})+(?:[.,]\d+)?")  # 1,200 is 1200 or 1.2
_THOUSANDS = re.compile(r"\d{1,3}(,\d{3})+|[1-9]\d{0,2}(\.000)+")  # or a decimal comma, or point
_OF_MACHINES, _LONGEST_CYCLE_S = ("cycle", "zyklus"), 0.1  # a machine has cycles too, of seconds
_MOST_BITS = 40.0  # of an encoder
_SYMBOL = 3  # most letters of a symbol such as J or kt, which also has other meanings
_IN_SI = (Constant.TORQUE, Constant.FORCE, Constant.RATED_TORQUE, Constant.RATED_FORCE)  # where no unit is given
# Units of a ratio to amperes or volts.
_ELECTRIC = {"A": ("A", 1.0), "mA": ("A", 1e-3), "V": ("V", 1.0), "mV": ("V", 1e-3)}
_BY_RATIO = {
    ("N m", "A"): Constant.TORQUE,
    ("N", "A"): Constant.FORCE,
    ("N m", "V"): Constant.TORQUE_GAIN,
    ("N", "V"): Constant.FORCE_GAIN,
}
# Sensors, brakes and gains of a controller have such ratios too.
_BY_WORDS = (Constant.TORQUE_GAIN, Constant.FORCE_GAIN)


def header_values(lines: Iterable[str], scalars: Mapping[str, float]) -> dict[Constant, HeaderValue]:
    """Constants of header `lines` and `scalars`. One that is given twice with different values is left out."""
    given = [one for line in _without_products(list(lines)) for one in _statements(line)]
    for name, scalar in scalars.items():
        words, unit = _unit_of_name(name)
        given.append(Statement(words, scalar, (unit,), f"{name} = {scalar:g}", words))
    # what is said of the motor goes before what words say, and that before what a unit alone says
    found: dict[Constant, dict[tuple[bool, ...], list[HeaderValue]]] = {}
    for one in given:
        units = one.units if any(one.units) else (*one.units, None)
        if part := nominal_told(one):
            found.setdefault(part[0], {}).setdefault((False, True, True), []).append(HeaderValue(part[1], one.text))
        elif told := next((known for unit in units if (known := _constant(one, unit))), None):
            by_words, constant, value = told
            rank = one.of_motor, by_words and not one.weak, not one.alone
            found.setdefault(constant, {}).setdefault(rank, []).append(HeaderValue(value, one.text))
    best = {constant: ranked[max(ranked)] for constant, ranked in found.items()}
    return {constant: values[0] for constant, values in best.items() if len({one.value for one in values}) == 1}


def _statements(line: str) -> Iterator[Statement]:
    """Statements of a line; numbers that follow the first one without words are those of other channels."""
    folded, shown = _NO_VALUE.sub(" ", _folded(line.strip().strip('"#%/ '))), header_text(line)
    if count := size_of_count(folded, shown):
        yield count
    if turn := _TURN_IS.match(folded):
        size, unit = _number(turn[2]), f"{turn[3]}/{turn[1]}"
        yield from [Statement("", size, (unit,), line.strip())] if size is not None else []
        return
    if (whole := _WHOLE_IS.search(folded)) and (size := _number(whole["size"] or whole["before"])) is not None:
        units = tuple(_units_behind(whole["unit"] or whole["its"]))
        yield from (Statement(f"rated {of}", size, units, shown) for of in ("torque", "force", "current"))
        if whole["size"]:  # the rest of the line says of which
            return
    matches = list(_NUMBER.finditer(folded))
    for index, match in enumerate(matches):
        before = folded[matches[index - 1].end() if index else 0 : match.start()]
        rest = folded[match.end() :]
        behind = rest[: matches[index + 1].start() - match.end() if matches[index + 1 :] else None]
        value = _number(match[0])
        if value is None or _is_list(folded, matches[index:], value):
            continue
        restated = index and _RESTATED.search(before)  # 1.6e-4 kg m2 (= 1.6 at the joint)
        if restated or (_EQUALS.fullmatch(behind) and before.endswith("(")):  # (1000 = 3.2 Nm)
            continue
        if not _THOUSANDS.fullmatch(match[0]):
            yield from told_behind((folded[: match.start()], rest), before, value, behind, shown)
        if not _BRACKET.search(before) and (lead := _lead_behind(before, value, behind, shown)):
            yield lead
        if re.search(r"[^\W\d]", before):
            yield replace(_words_before(before, value, behind, shown), grouped=bool(_GROUPED.fullmatch(match[0])))


def _words_before(before: str, value: float, behind: str, line: str) -> Statement:
    """The statement of a number that stands behind its words."""
    bracket = _BRACKET.search(before)
    name, unit = _unit_of_name(before)
    units_behind = tuple(_units_behind(behind))
    units = [_SIGNS.sub("", bracket[1])] if bracket else []
    told = before[: bracket.start()] if bracket else before
    words, phrase = _plain(told), _plain(_PHRASES.split(told.rstrip(" ;,|\t:=\"'"))[-1])
    if unit and not any(units_behind) and not bracket:
        words, units, phrase = name, [unit], _unit_of_name(phrase)[0]
    sentence = _plain(_SENTENCES.split(told)[-1])
    return Statement(words, value, (*units, *units_behind), line, phrase, sentence)


def _lead_behind(before: str, value: float, text: str, line: str) -> Statement | None:
    """The statement of a lead whose words follow its unit, or which a turn of the motor is; None without one."""
    if _DEVIATES.search(f"{before} {text}"):
        return None
    turn = _PER_MOTOR_TURN.match(text) or (_MOTOR_TURN_IS.search(before) and re.match(r" *([a-z]+)\b", text))
    if turn:
        return Statement("lead", value, (turn[1],), line, of_motor=True)
    told = _BEHIND.match(text)
    name = re.sub(rf" ({'|'.join(lexicon().joints)})$", "", _plain(before))
    words = f"{name} {told[2]}" if told else ""
    is_lead = re.search(_pattern(lexicon().constants[Constant.LEAD]), words)
    return Statement(words, value, (told[1],), line) if told and is_lead else None


def _is_list(text: str, matches: list[re.Match[str]], value: float) -> bool:
    """True if another number follows the first of `matches` with nothing but a separator between."""
    following = matches[1:]
    at = matches[0].end()
    for one in following:
        if not re.fullmatch(r"\s*[\t;,|]+\s*", text[at : one.start()]):
            return False
        if _number(one[0]) != value:
            return True
        at = one.end()
    return False


def _units_behind(text: str) -> Iterator[str]:
    """Texts after a number that may be its unit: up to three words within brackets or up to a separator, or none."""
    start = _SEPARATED.match(text)
    rest = re.split(r"[\])};,|\t\"]", text[start.end() if start else 0 :].lstrip(" [(\"'"))[0].split()
    for take in (3, 2, 1):
        if len(rest) >= take:
            yield _SIGNS.sub("", "".join(rest[:take]))
    if not rest or re.match(r"\s*[;,|\t\"']", text):
        yield ""


def _constant(told: Statement, unit: str | None) -> tuple[bool, Constant, float] | None:
    """Constant that words and unit tell, True if the words do, and its value in SI; `unit` is None where none is given.

    Without a unit only words that stand for nothing else are taken, not those of a lead, which may be in mm or m.
    """
    words, value = told.words, told.number
    if not 0.0 < value < np.inf:
        return None
    ratio = _of_ratio(value, _amperes(unit)) if unit else None
    for constant, known in lexicon().constants.items():
        if not re.search(_pattern(known), words) and not re.fullmatch(known.alone, told.phrase):
            continue
        if ratio and ratio[0] is constant:
            return True, *ratio
        if unit is None:
            if constant in _IN_SI and _says_all(known, words):
                return True, constant, value
            continue
        if unit in known.units:
            si = value * known.units[unit]
            if constant is not Constant.PERIOD:
                return True, constant, si
            if told.phrase in _OF_MACHINES and not (unit and si < _LONGEST_CYCLE_S):
                continue
            if unit or si < 1.0:  # a sampling of 1000 is a rate
                return True, Constant.RATE, 1.0 / si
    if (
        ratio
        and ratio[0] not in _BY_WORDS
        and not any(re.search(rf"\b{other}\b", words) for other in lexicon().other_constants)
    ):
        return False, *ratio
    return None


def _says_all(known: ConstantWords, words: str) -> bool:
    """True if words that end a text are more than a short symbol, or the symbol of a torque or force constant.

    A percentage of a rated value says not of which.
    """
    found = match[1].replace(" ", "") if (match := re.search(_pattern(known), words)) else ""
    return (len(found) > _SYMBOL and not found.startswith("percent")) or (
        found in lexicon().scalars.constant and found != "km"
    )


def _of_ratio(value: float, unit: str) -> tuple[Constant, float] | None:
    """Constant whose unit is a ratio: N m/A, N/V, counts/rev, bit/rev, counts/mm, mm/rev."""
    parts = _PER.split(unit)
    if len(parts) != 2 or not all(parts):
        return None
    if parts[0] in ("bit", "bits"):
        turn = unit_named(parts[1]) in ("rev", None) and value < _MOST_BITS
        return (Constant.COUNTS, 2.0**value) if turn else None
    above, below = unit_named(parts[0]), unit_named(parts[1])
    si, factor = UNITS.get(above or "", ("", 0.0))
    below_si, below_factor = UNITS.get(below or "", ("", 1.0))
    electric, prefix = _ELECTRIC.get(below or "", ("", 1.0))
    if (si, electric) in _BY_RATIO:
        return _BY_RATIO[si, electric], value * factor / prefix
    if above == "counts" and below == "rev":
        return Constant.COUNTS, value
    if above == "counts" and below_si == "m":
        return Constant.COUNTS_PER_M, value / below_factor
    return (Constant.LEAD, value * factor) if si == "m" and below == "rev" else None


def _amperes(unit: str) -> str:
    """Unit with rms values of a current as A."""
    return re.sub(r"a_?(rms|eff)$", "a", unit)


def _pattern(known: ConstantWords) -> str:
    return rf"(?:^|(?<=[\W])|(?<=[^\x00-\x7f]))({known.words})( ({'|'.join(lexicon().joints)}))?$"


def _without_products(lines: list[str]) -> list[str]:
    """Lines with a product of two named numbers as a number: TS = 90 us; RG = 8; interval = TS * RG."""
    parts = [part for line in lines for part in re.split(r"[;|]", line)]
    named = {match[1].lower(): match for part in parts if (match := re.match(r"\W*(\w+)\s*=\s*([\d.]+)\s*(.*)$", part))}
    for part in parts:
        factors = _PRODUCT.search(part.lower().strip())
        if factors and all(name in named for name in factors.groups()):
            one, other = (named[name] for name in factors.groups())
            product = f"{part.partition('=')[0]}= {float(one[2]) * float(other[2]):g} {one[3]}{other[3]}"
            return [rest for rest in parts if rest not in (part, one.string, other.string)] + [product]
    return lines


def _unit_of_name(name: str) -> tuple[str, str]:
    """Words and unit of the name of a scalar: torque_constant_nm_a -> torque constant, nm/a."""
    tokens = _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)).split()
    units = {unit for known in lexicon().constants.values() for unit in known.units if unit}
    for take in (4, 3, 2, 1):
        unit = "".join(tokens[-take:])
        if len(tokens) > take and unit in units:
            return " ".join(tokens[:-take]), unit
    return " ".join(tokens), ""


def header_text(line: str) -> str:
    """A line as a constant that it gives shows it."""
    return " ".join(line.strip().strip('"#%/; ').split())


def _folded(text: str) -> str:
    """Lower case without accents."""
    return without_accents(text.replace("µ", "u").replace("μ", "u")).lower()


def _plain(name: str) -> str:
    return " ".join(_TEXT_OF_NAME.sub(" ", _folded(name)).split())


def _number(text: str) -> float | None:
    text = text.rstrip(".,")
    try:
        return float(text.replace(",", ".") if "." not in text else text.replace(",", ""))
    except ValueError:
        return None
