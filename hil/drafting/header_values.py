"""Constants that a file tells beside its columns: in lines above the numbers, or as scalars with a name.

A line is "words [: = ; ,] number [unit]", as loggers and drives write it; a scalar has its unit in its name. The words
are English, German, French, Italian and Spanish, without accents.
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
    GEAR = "gear ratio"


@dataclass(frozen=True)
class HeaderValue:
    """Value in the SI unit of its constant, and the text that gives it."""

    value: float
    text: str


_WORDS = {
    Constant.RATE: r"sampl\w* ?(rate|frequency|freq)|abtast ?(rate|frequenz)|(frequence|cadence|taux) d ?echantillonnage"
    r"|(frecuencia|tasa|velocidad) de muestreo|(frequenza|velocita) di campionamento",
    Constant.TORQUE: r"(torque|motor) ?constant|drehmoment ?konstante|constante de (couple|par)|costante di coppia",
    Constant.FORCE: r"force ?constant|kraft ?konstante|constante de (force|fuerza)|costante di forza",
    Constant.LEAD: r"(screw|spindle)? ?(lead|pitch)|(spindel|gewinde) ?steigung|steigung|pas de vis|passo( vite)?"
    r"|paso( husillo)?",
    Constant.COUNTS: r"(encoder )?(counts|increments|pulses|lines) per rev\w*|cpr|(inkremente|impulse) (pro|je) "
    r"umdrehung|(points|increments|impulsions) par tour|impulsi (per|al) giro|(pulsos|cuentas) por (vuelta|revolucion)",
    Constant.GEAR: r"gear ?ratio|getriebe ?(uebersetzung|ubersetzung|faktor)|ubersetzung|rapport de reduction"
    r"|rapporto di riduzione|relacion de (transmision|reduccion)",
}
_PERIOD = (
    r"sampl\w* ?(time|period|interval)|abtast ?(zeit|periode|intervall)|(periode|pas|temps) d ?echantillonnage"
    r"|(periodo|tiempo|intervalo) de muestreo|(periodo|tempo|intervallo) di campionamento"
)
# factor of a unit, in lower case without blanks and signs between, to the SI unit of the constant
_UNITS = {
    Constant.RATE: {"hz": 1.0, "khz": 1e3, "1/s": 1.0, "s/s": 1.0, "sps": 1.0},
    Constant.TORQUE: {"nm/a": 1.0, "mnm/a": 1e-3, "ncm/a": 1e-2, "nma": 1.0, "mnma": 1e-3},
    Constant.FORCE: {"n/a": 1.0, "na": 1.0},
    Constant.LEAD: {"mm": 1e-3, "m": 1.0, "um": 1e-6, "in": 0.0254, "mm/rev": 1e-3, "mm/u": 1e-3, "mm/tr": 1e-3},
    Constant.COUNTS: {"": 1.0, "counts": 1.0, "inc": 1.0, "1/rev": 1.0, "counts/rev": 1.0},
    Constant.GEAR: {"": 1.0, ":1": 1.0},
}
_SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6}
_LINE = re.compile(r"^(?P<name>\D*?)[\s:=;,|]*(?P<number>[+-]?\d[\d.,]*(e[+-]?\d+)?)[\s;,\t\[(]*(?P<unit>.*?)[\])\s;,]*$")
_TEXT_OF_NAME = re.compile(r"[^a-z0-9/:]+")


def header_values(lines: Iterable[str], scalars: Mapping[str, float]) -> dict[Constant, HeaderValue]:
    """Constants of header `lines` and `scalars`. One that is given twice with different values is left out."""
    found: dict[Constant, list[HeaderValue]] = {}
    told = [(match["name"], _number(match["number"]), match["unit"], line) for line in lines if (match := _split(line))]
    named = [(*_unit_of_name(name), name, value) for name, value in scalars.items()]
    told += [(words, value, unit, f"{name} = {value:g}") for words, unit, name, value in named]
    for name, value, unit, text in told:
        one = _constant(_plain(name), value, re.sub(r"[\s·*.]", "", _folded(unit)))
        if one is not None:
            found.setdefault(one[0], []).append(HeaderValue(one[1], text.strip().strip('"')))
    return {one: values[0] for one, values in found.items() if len({value.value for value in values}) == 1}


def _split(line: str) -> re.Match[str] | None:
    match = _LINE.match(_folded(line.strip().strip('"#%/ ')))
    return match if match and re.search("[a-z]", match["name"]) else None


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
    for take in (3, 2, 1):
        unit = "".join(tokens[-take:])
        if len(tokens) > take and unit in units:
            return " ".join(tokens[:-take]), unit
    return name, ""


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
