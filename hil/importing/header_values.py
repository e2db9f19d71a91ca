"""Constants that a file gives beside its columns: in lines above the numbers, or as scalars with a name.

A line is "words [: = ; ,] number [unit]", as loggers and drives write it; a scalar has its unit in its name. The words
are English, German, French, Italian and Spanish. They are compared without accents.
"""

import re
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum


class Constant(StrEnum):
    """A constant, with its SI unit."""

    RATE = "sampling rate in Hz"
    TORQUE = "torque constant in N m/A"
    FORCE = "force constant in N/A"
    LEAD = "lead in m"
    COUNTS = "counts per revolution"
    RATED_TORQUE = "rated torque in N m"
    RATED_FORCE = "rated force in N"


@dataclass(frozen=True)
class HeaderValue:
    """Value in the SI unit of its constant, and the text that gives it."""

    value: float
    text: str


# words of a constant; a rate may end a longer text ("recorded with a sampling rate of 1 kHz")
_WORDS = {
    Constant.RATE: r"(.* )?(sampl\w* ?(rate|frequency|freq)|abtast ?(rate|frequenz)|(frequence|cadence|taux) "
    r"d ?echantillonnage|(frecuencia|tasa|velocidad) de muestreo|(frequenza|velocita) di campionamento)( of| von)?",
    Constant.TORQUE: r"(motor )?(torque|motor) ?constant|drehmoment ?konstante|constante de (couple|par)"
    r"|costante di coppia",
    Constant.FORCE: r"(motor )?force ?constant|kraft ?konstante|constante de (force|fuerza)|costante di forza",
    Constant.LEAD: r"((ball ?)?screw |spindle )?lead|screw pitch|(spindel|gewinde)? ?steigung|pas de( la)? vis"
    r"|passo( della)? vite|paso( del)? husillo",
    Constant.COUNTS: r"(encoder )?(counts|increments|pulses) per rev\w*|cpr|(inkremente|impulse) (pro|je) umdrehung"
    r"|(points|increments|impulsions) par tour|impulsi (per|al) giro|(pulsos|cuentas) por (vuelta|revolucion)",
    Constant.RATED_TORQUE: r"(motor )?(rated|nominal) torque|nenn(dreh)?moment|couple nominal|par nominal"
    r"|coppia nominale",
    Constant.RATED_FORCE: r"(motor )?(rated|nominal) force|nennkraft|force nominale|fuerza nominal|forza nominale",
}
_PERIOD = (
    r"(.* )?(sampl\w* ?(time|period|interval)|abtast ?(zeit|periode|intervall)|(periode|pas|temps) d ?echantillonnage"
    r"|(periodo|tiempo|intervalo) de muestreo|(periodo|tempo|intervallo) di campionamento)( of| von)?"
)
# factor of a unit, in lower case without blanks and signs between, to the SI unit of the constant
_UNITS = {
    Constant.RATE: {"hz": 1.0, "khz": 1e3, "1/s": 1.0, "s/s": 1.0, "sps": 1.0},
    Constant.TORQUE: {
        "nm/a": 1.0,
        "mnm/a": 1e-3,
        "ncm/a": 1e-2,
        "nma": 1.0,
        "mnma": 1e-3,
        "nmpera": 1.0,
        "mnmpera": 1e-3,
    },
    Constant.FORCE: {"n/a": 1.0, "na": 1.0, "npera": 1.0},
    Constant.LEAD: {"mm": 1e-3, "m": 1.0, "um": 1e-6, "in": 0.0254, "mm/rev": 1e-3, "mm/u": 1e-3, "mm/tr": 1e-3},
    Constant.COUNTS: {"": 1.0, "counts": 1.0, "inc": 1.0, "1/rev": 1.0, "counts/rev": 1.0},
    Constant.RATED_TORQUE: {"nm": 1.0, "mnm": 1e-3, "ncm": 1e-2},
    Constant.RATED_FORCE: {"n": 1.0, "kn": 1e3},
}
_SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6}
_LINE = re.compile(r"^(?P<name>\D*?)[\s:=;,|\t]*(?P<number>[+-]?\d[\d.,]*(e[+-]?\d+)?)(?P<rest>.*)$")
_BRACKET = re.compile(r"[\[({](.*?)[\])}][\s:=;,|]*$")
_SIGNS = re.compile(r"[\s·*.]+")  # between the parts of a unit
_TEXT_OF_NAME = re.compile(r"[^a-z0-9/:]+")


def header_values(lines: Iterable[str], scalars: Mapping[str, float]) -> dict[Constant, HeaderValue]:
    """Constants of header `lines` and `scalars`. One that is given twice with different values is left out."""
    given = [(*_readings(match), line) for line in lines if (match := _split(line))]
    for name, scalar in scalars.items():
        words, unit = _unit_of_name(name)
        given.append((words, scalar, [unit], f"{name} = {scalar:g}"))
    found: dict[Constant, list[HeaderValue]] = {}
    for words, number, units, text in given:
        one = next((known for unit in units if (known := _constant(words, number, unit))), None)
        if one is not None:
            found.setdefault(one[0], []).append(HeaderValue(one[1], text.strip().strip('"#%/; ')))
    return {one: values[0] for one, values in found.items() if len({value.value for value in values}) == 1}


def _split(line: str) -> re.Match[str] | None:
    match = _LINE.match(_folded(line.strip().strip('"#%/ ')))
    return match if match and re.search("[a-z]", match["name"]) else None


def _readings(match: re.Match[str]) -> tuple[str, float | None, list[str]]:
    """Words of a line, its number, and the texts that may be its unit.

    They are in brackets after the words, or after the number: all up to a bracket or a comma, or its first words.
    """
    value, bracket = _number(match["number"]), _BRACKET.search(match["name"])
    if bracket:
        return _plain(match["name"][: bracket.start()]), value, [_SIGNS.sub("", bracket[1])]
    words = re.split(r"[\])};,]", match["rest"].strip(' \t;,[("'))[0].split()
    return _plain(match["name"]), value, [_SIGNS.sub("", "".join(words[:take])) for take in (None, 3, 2, 1)]


def _constant(name: str, value: float | None, unit: str) -> tuple[Constant, float] | None:
    if value is None or value <= 0.0:
        return None
    if re.fullmatch(f"({_PERIOD})", name) and unit in _SECONDS:
        return Constant.RATE, 1.0 / (value * _SECONDS[unit])
    for one, words in _WORDS.items():
        if re.fullmatch(f"({words})", name) and unit in _UNITS[one]:
            return one, value * _UNITS[one][unit]
    return None


def _unit_of_name(name: str) -> tuple[str, str]:
    """Words and unit of the name of a scalar: torque_constant_nm_a -> torque_constant, nma."""
    tokens = _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)).split()
    units = {unit for known in (*_UNITS.values(), _SECONDS) for unit in known if unit}
    for take in (4, 3, 2, 1):
        unit = "".join(tokens[-take:])
        if len(tokens) > take and unit in units:
            return " ".join(tokens[:-take]), unit
    return " ".join(tokens), ""


def _folded(text: str) -> str:
    """Lower case without accents."""
    plain = text.replace("ß", "ss").replace("µ", "u").replace("μ", "u")
    return unicodedata.normalize("NFKD", plain).encode("ascii", "ignore").decode().lower()


def _plain(name: str) -> str:
    return " ".join(_TEXT_OF_NAME.sub(" ", _folded(name)).split())


def _number(text: str) -> float | None:
    text = text.rstrip(".,")
    try:
        return float(text.replace(",", ".") if "." not in text else text.replace(",", ""))
    except ValueError:
        return None
