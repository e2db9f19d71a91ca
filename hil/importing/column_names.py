"""Reads the name of a column in English, German or French: quantity, set-point or measured, motor or table."""

import re
import unicodedata
from dataclasses import dataclass
from enum import StrEnum

from hil.importing.units import QUANTITY_OF_UNIT, split_unit, unit_named


class Quantity(StrEnum):
    """Physical quantity of a column. OTHER is known, but no channel: errors, temperatures, states."""

    TIME = "time"
    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"
    EFFORT = "effort"  # force, torque, current or voltage
    OTHER = "other"
    UNKNOWN = "unknown"


# Words of four letters and more are also found within a token (lagesollwert); shorter ones must be the whole token.
_QUANTITIES = {
    Quantity.TIME: "time t zeit temps timestamp stamp zeitstempel horodatage clock uhrzeit elapsed tempo tiempo",
    Quantity.OTHER: "error err deviation schleppfehler schleppabstand regelabweichung abweichung erreur ecart lag "
    "feedforward ff compensation vorsteuerung anticipation temperature temperatur status state zustand etat flag "
    "mode lateness segment cycle index sample counter zaehler compteur deflection diff difference limit twin",
    Quantity.VELOCITY: "velocity velocities vel speed spd omega w v n qd dq qdot qp dqdt xd dx xdot "
    "geschwindigkeit geschw "
    "drehzahl winkelgeschwindigkeit vitesse vit rpm feedrate velocita velocidad",
    Quantity.ACCELERATION: "acceleration accel acc qdd ddq qddot beschleunigung acceleration",
    Quantity.EFFORT: "torque trq tq tau moment drehmoment mom md couple cpl current cur curr strom courant "
    "intensite amp i iq iqs "
    "isq force kraft effort f voltage volt spannung tension u pwm duty coppia forza corrente fuerza corriente",
    Quantity.POSITION: "position positions pos posn angle ang winkel theta phi q x y z lage weg hub stroke "
    "displacement displ "
    "encoder enc geber codeur course deplacement distance travel posizione posicion angolo angulo",
}
_COMMAND = (
    "command commanded cmd set setpoint setp ref reference target desired des demand soll sollwert consigne cons sp "
    "goal comando comandata comandato riferimento consigna"
)
_MEASURED = (
    "actual act ist istwert measured meas measure feedback fbk fb real reel mesure mesuree mes response "
    "misurata misurato medida medido"
)
_MOTOR = "motor mot moteur motore rotor antrieb drive primary"
_TABLE = (
    "table load link secondary second external ext linear scale tisch last abtriebs schlitten charge carriage slide "
    "axis2 arm aux auxiliary glasmassstab regle"
)
_TORQUE_UNIT = {
    "current": "A",
    "strom": "A",
    "courant": "A",
    "corrente": "A",
    "corriente": "A",
    "voltage": "V",
    "spannung": "V",
    "tension": "V",
    "volt": "V",
}
_SHORT_UNIT = {"i": "A", "iq": "A", "cur": "A", "curr": "A", "amp": "A", "iqs": "A", "isq": "A", "u": "V"}
LEAST_WITHIN = 4  # letters of a word that is looked for within a token: shorter ones occur in others by chance
_WHOLE = ("twin", "mode", "flag")  # whole tokens all the same: istwinkel
_PREFIXES = ("ist", "act", "ref", "cmd", "set")


@dataclass(frozen=True)
class Label:
    """Meaning of a column's name. `unit` is None if the name gives none; `odd_unit`: it gives an unknown one."""

    column: str
    quantity: Quantity
    command: bool
    measured: bool
    motor: bool
    table: bool
    number: str  # of the axis or encoder, "" without one
    unit: str | None
    odd_unit: bool = False
    electric: str | None = None  # A or V if the word says current or voltage
    letter: bool = False  # the name is one letter

    @property
    def sure(self) -> bool:
        return self.quantity is not Quantity.UNKNOWN


def label(column: str, unit_text: str = "") -> Label:
    """Read the name of a column, and the unit that stands beside it in the file (empty without one)."""
    name, unit, odd = split_unit(column.strip())
    if unit is None and not odd:
        name, unit = _unit_after_blank(name)
    if unit_text and unit is None:
        unit, odd = unit_named(unit_text), unit_named(unit_text) is None
    tokens = _tokens(name)
    words = _words(tokens)
    number = next((match[1] for token in reversed(tokens) if (match := re.search(r"(\d+)$", token))), "")
    quantity = _quantity(words)
    of_unit = QUANTITY_OF_UNIT.get(unit or "")
    if of_unit == "effort" and unit == "N m" and quantity is Quantity.POSITION and not _any(words, "moment"):
        unit = "nm"
    elif of_unit and quantity is not Quantity.OTHER and not (unit == "min" and quantity is not Quantity.TIME):
        quantity = Quantity(of_unit)
    elif unit and unit not in QUANTITY_OF_UNIT:
        unit = None
    joined = " ".join(words)
    electric = next((value for word, value in _TORQUE_UNIT.items() if word in joined), None)
    electric = electric or next((_SHORT_UNIT[word] for word in words if word in _SHORT_UNIT), None)
    return Label(
        column,
        quantity,
        _any(words, _COMMAND),
        _any(words, _MEASURED),
        _any(words, _MOTOR),
        _any(words, _TABLE),
        number,
        unit,
        odd,
        electric if quantity is Quantity.EFFORT else None,
        len(name.strip()) == 1 and quantity is not Quantity.TIME,
    )


def _unit_after_blank(name: str) -> tuple[str, str | None]:
    """Name without the unit that is its last word or two (Kraft kN); a letter is one after a word of its quantity."""
    words = name.split()
    for take in (2, 1):
        last, rest = " ".join(words[-take:]), " ".join(words[:-take])
        unit = unit_named(last) if rest else None
        of_unit = QUANTITY_OF_UNIT.get(unit or "")
        if unit and of_unit and (len(last) > 1 or not last.isalpha() or of_unit == _quantity(_words(_tokens(rest)))):
            return rest, unit
    return name, None


def _words(tokens: list[str]) -> list[str]:
    return [word for token in tokens for word in _split_suffix(re.sub(r"\d+$", "", token)) if word]


def _quantity(words: list[str]) -> Quantity:
    return next((kind for kind, known in _QUANTITIES.items() if _any(words, known)), Quantity.UNKNOWN)


def _tokens(name: str) -> list[str]:
    """motorPos_Ist2 -> motor, pos, ist2, without accents and in lower case."""
    plain = name.replace("ß", "ss").replace("ω", "omega").replace("τ", "tau").replace("φ", "phi").replace("θ", "theta")
    plain = unicodedata.normalize("NFKD", plain).encode("ascii", "ignore").decode()
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=\d)(?=[A-Za-z])", " ", plain)
    return [token for token in re.split(r"[^0-9a-zA-Z]+", plain.lower()) if token]


def _split_suffix(token: str) -> list[str]:
    """xsoll -> x, soll; vist -> v, ist; istwinkel -> ist, winkel."""
    for ending in ("sollwert", "istwert", "soll", "ist", "ref", "cmd", "act", "set"):
        if token.endswith(ending) and 0 < len(token) - len(ending) <= 3:
            return [token[: -len(ending)], ending]
    for prefix in _PREFIXES:
        rest = token.removeprefix(prefix)
        if rest != token and any(_any([rest], known) for known in _QUANTITIES.values()):
            return [prefix, rest]
    return [token]


def _any(words: list[str], known: str) -> bool:
    return any(
        one in words or (len(one) >= LEAST_WITHIN and one not in _WHOLE and any(one in word for word in words))
        for one in known.split()
    )
