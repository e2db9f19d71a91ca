"""Spellings of units in files, and the unit that the name of a column holds."""

import re

from hil.importing.lexicon import UNITS_BY_CONSTANT, Quantity, lexicon, plain_spelling
from hil.quantities import UNITS

_QUANTITY_OF_SI = {
    "s": Quantity.TIME,
    "m": Quantity.POSITION,
    "rad": Quantity.POSITION,
    "m/s": Quantity.VELOCITY,
    "rad/s": Quantity.VELOCITY,
    "m/s^2": Quantity.ACCELERATION,
    "rad/s^2": Quantity.ACCELERATION,
}
QUANTITY_OF_UNIT = (
    {unit: _QUANTITY_OF_SI.get(si, Quantity.EFFORT) for unit, (si, _) in UNITS.items() if si != "1"}
    | dict.fromkeys(UNITS_BY_CONSTANT, Quantity.EFFORT)
    | {"counts": Quantity.POSITION, "counts/s": Quantity.VELOCITY}
)
# one letter at the end of a name is a unit only after a word: x_m may be in metres, q_m of the motor
_BRACKETS = re.compile(r"[\[(<{]\s*([^\])>}]*)\s*[\])>}]\s*$")
_ANY_BRACKETS = re.compile(r"[\[(<{]\s*([^\[\](){}<>]*?)\s*[\])>}]")
_HUNDREDTH = re.compile(r"(?P<unit>[^\d\s/]+)\s*/\s*(?P<part>10+)")  # mm/100
_FACTOR = re.compile(r"[x×]?(?:(?P<value>\d+(?:[.,]\d+)?)|1/(?P<part>\d+))\s*[*x·]?\s*(?P<unit>[^\d\s/].*)")
_OF_COUNT = re.compile(r"([^\s/]+)(?:\s*/\s*|\s+)(\w+)")
LEAST_ALONE = 3  # letters of a unit that is a name by itself, or of revolutions: motor_u is a voltage
_BITS = re.compile(r"(?<=[a-z])\d+(bit)?$")  # counts16bit
_OTHER_WORDS = ("in", "rev", "min", "imp")
_PER = re.compile(r"(?<=\w)[ _]per[ _](?=\w)", re.IGNORECASE)  # m per min
_SLASH = re.compile(r"^\s*[^/\s]+\s*/\s*(\S+)\s*$")  # DIN 461: x/mm
_PART_OF = re.compile(r"(?:^|\s)(\S+)\s+(?:of|der|des|vom|du|de la|del|della)\s")
_WORD_IN = re.compile(r"\bin\s+(\S+)\s*$")  # Weg in mm


def unit_named(text: str) -> str | None:
    """Unit of a map for a spelling in a file; None for an unknown one."""
    key = plain_spelling(_PER.sub("/", text))
    if key.startswith("%"):  # % of what is told by no spelling
        return "%"
    unit_of = lexicon().unit_of
    above, slash, below = key.partition("/")
    if slash and below == "s" and unit_of.get(above) == "counts":
        return "counts/s"
    return "counts" if unit_of.get(_BITS.sub("", key)) == "counts" else unit_of.get(key)


def base_of(unit: str) -> tuple[str, float]:
    """Unit in which all units of the quantity of `unit` can be told, SI where there is one, and the factor to it."""
    if unit in ("mA", "mV"):
        return unit[1:], 1e-3
    return ("%", 0.1) if unit == "permille" else UNITS.get(unit, (unit, 1.0))


def unit_of_text(text: str) -> str | None:
    """Unit of a text that says nothing else, with a quantity before or behind it: Nm (Torque), Angle [deg]."""
    whole = unit_named(text.strip(" []()"))
    bracket = _BRACKETS.search(text)
    return whole or (unit_named(text[: bracket.start()]) or unit_named(bracket[1]) if bracket else None)


def unit_of_part(text: str) -> str | None:
    """% or permille of a text that says in which part of what a value is: in 1/1000 of the rated torque."""
    match = _PART_OF.search(text.lower())
    unit = unit_named(match[1]) if match else None
    return unit if unit in ("%", "permille") else None


def factor_and_unit(text: str) -> tuple[float, str] | None:
    """Factor and unit of a text with a number before a unit: 0.1 Nm, 1/100 deg, counts of 0.5 um as 0.5um cts.

    None for a unit itself.
    """
    part = _HUNDREDTH.fullmatch(text.strip(" []()"))
    if part and unit_named(part["unit"]) is not None:
        return 1.0 / float(part["part"]), part["unit"]
    match = _FACTOR.fullmatch(text.strip(" []()"))
    of_count = _OF_COUNT.fullmatch(match["unit"]) if match else None
    if match and of_count and unit_named(of_count[2]) == "counts" and UNITS.get(unit_named(of_count[1]) or ""):
        match = _FACTOR.fullmatch(match[0][: match.start("unit") + of_count.end(1) - match.start()])
    if not match or unit_named(text.strip(" []()")) is not None or unit_named(match["unit"]) is None:
        return None
    value = float((match["value"] or match["part"]).replace(",", "."))
    if not value and match["part"]:
        return None
    return (value if match["value"] else 1.0 / value), match["unit"]


def counts_steps(text: str) -> bool:
    """True for a unit of a stepper's steps, or a part of one: [1/16 step], (µsteps), [Schritt]; not for [steps/s]."""
    word = re.sub(r"^(1\s*/\s*\d+|half|full|\W)*", "", plain_spelling(text.strip(" []()<>{}")))
    return word.replace("µ", "u") in lexicon().step_units


def split_unit(name: str) -> tuple[str, str | None, bool]:
    """Name without its unit, the unit if it has one, and True if a unit stands there that is not known."""
    for bracket in reversed(list(_ANY_BRACKETS.finditer(name))):  # Current [A] (Axis 1)
        if unit := unit_named(bracket[1]):
            return f"{name[: bracket.start()]} {name[bracket.end() :]}".strip(), unit, False
    before, joint, ratio = name.rpartition("_")
    if joint and "/" in ratio and not ratio.startswith("/") and (unit := unit_named(ratio)):  # speed_1/min
        return before, unit, False
    for pattern in (_BRACKETS, _SLASH, _WORD_IN):
        match = pattern.search(name)
        if match:
            unit = unit_named(match[1]) or ("in" if match[1].strip().lower() == "in" else None)  # elsewhere a word
            rest = name[: match.start()].strip() if pattern is not _SLASH else name.split("/")[0].strip()
            if unit or pattern is _BRACKETS:
                return rest, unit, unit is None and match[1].strip() not in ("", "-", "1")
    tokens = name.split("_")
    while len(tokens) > 2 and tokens[-1].lower() in lexicon().after_unit:
        tokens.pop()
    if len(tokens) > 2 and tokens[-1].lower() in lexicon().of_rated and unit_named(tokens[-2]) in ("%", "permille"):
        tokens.pop()
    for take in (3, 2, 1):
        if len(tokens) > take:
            unit = unit_named("_".join(tokens[-take:]).replace("°", "deg"))
            if tokens[-1] == "M" and name != name.upper():
                unit = None  # phi_M, of the motor; the symbol of the metre is m
            if unit and unit != "min" and not (unit == "rev" and len(tokens[-1]) < LEAST_ALONE):
                return "_".join(tokens[:-take]), unit, False
    return name, None, False


def unit_within(name: str, quantity: Quantity) -> str | None:
    """Unit of a `quantity` that is a word within a name, between others: mot_pos_deg_joint; None without one, or two.

    One letter, "in" and "rev" (reverse) are words of other meaning there.
    """
    tokens = [token.lower() for token in re.split(r"[\s_.\-]+", name) if token]
    found = set[str]()
    for take in (2, 1):
        for begin in range(1, len(tokens) - take + 1):
            text = "_".join(tokens[begin : begin + take])
            unit = unit_named(text.replace("°", "deg"))
            if unit and text not in _OTHER_WORDS and len(text) > 1 and QUANTITY_OF_UNIT.get(unit) is quantity:
                found.add(unit)
        if found:
            break
    return found.pop() if len(found) == 1 else None


def whole_unit(name: str) -> str | None:
    """Unit that is the whole name of a column: of a time, torque, current, angle, its speed, or counts."""
    unit, letters = unit_named(name), len(name.strip())
    si = UNITS.get(unit or "", ("",))[0]
    turns = si in ("rad", "rad/s") and letters >= LEAST_ALONE
    several = unit == "counts" and re.search(r"(?<!tick)s\s*$", name.lower())  # one is the number of a row
    return unit if turns or several or ((si in ("s", "N m") or unit in ("A", "mA")) and letters > 1) else None
