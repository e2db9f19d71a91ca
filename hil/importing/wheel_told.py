"""Travel per turn of the motor, as a README tells wheel and gear: pinion pitch radius 75 mm, gearbox 12:1.

Of a pinion on a rack, a pulley of a belt or a drum: its travel per turn, its pitch radius or diameter, or teeth times
pitch. One wheel and at most one gear; of several none is told.
"""

import re
from collections.abc import Iterable
from math import pi

from hil.importing.header_values import HeaderValue, header_text
from hil.importing.lexicon import without_accents

_SAME = 0.01  # relative deviation of a way that is told twice
_NUMBER = r"(\d+(?:[.,]\d+)?)"
_WHEEL = r"\b(?:pinion|pulley|drum|sprocket|ritzel|riemenscheibe|zahnscheibe|trommel|kettenrad)\b"
_WITHIN = r"[^;\n]{0,30}?"  # a phrase
_PER_TURN = re.compile(
    rf"{_WHEEL}{_WITHIN}{_NUMBER} ?mm(?: of)?(?: travel| feed| vorschub| weg)? ?(?:/|\bper\b|\bpro\b|\bje\b) ?"
    r"(?!motor)(?:\w+ )?(?:rev|turn|umdr)"
)
_RADIUS = re.compile(rf"{_WHEEL}{_WITHIN}\b(?:radius|r) ?[=:]? ?{_NUMBER} ?mm")
_DIAMETER = re.compile(
    rf"{_WHEEL}{_WITHIN}\b(?:pitch circle|\w*diameter|dia|durchmesser|teilkreis\w*|d) ?[=:]? ?{_NUMBER} ?mm"
)
_TEETH = re.compile(rf"{_WHEEL}[^;\n]{{0,20}}?(\d+) ?(?:teeth|zahne)\b{_WITHIN}(?:pitch|teilung) ?[=:]? ?{_NUMBER} ?mm")
_GEAR = re.compile(
    r"\b(?:\w*gear\w*|\w*getriebe\w*|reduc\w+|\w*stage|ratio|ubersetzung|untersetzung|worm|schnecke)\b"
    rf"(?: (?:is|of|ratio|i|belt|between))*[ =:,]*{_NUMBER} ?: ?1\b"
    rf"|\bi ?= ?{_NUMBER}(?: ?: ?1)?\b(?! ?m?a\b)"
    rf"|{_NUMBER} ?: ?1 (?:belt |planetary |worm )?(?:gear|reduc|getriebe|stage)"
)


def travel_told(lines: Iterable[str], lead: HeaderValue | None = None) -> HeaderValue | None:
    """Travel per turn of the motor [m] that `lines` tell by a wheel and its gear; else the `lead` that they tell.

    That of a wheel is none of the motor; of several wheels or gears none is told.
    """
    text = without_accents("\n".join(lines)).lower().replace("*", " ")
    text = re.sub(r"\n\s*(?=[a-z(])", " ", text)  # a sentence goes on
    sizes = ((_PER_TURN, 1e-3), (_RADIUS, 2e-3 * pi), (_DIAMETER, 1e-3 * pi))
    ways = {round(size * _number(one[1]), 9) for pattern, size in sizes for one in pattern.finditer(text)}
    ways |= {round(1e-3 * _number(one[1]) * _number(one[2]), 9) for one in _TEETH.finditer(text)}
    gears = {_number(next(filter(None, one.groups()))) for one in _GEAR.finditer(text)}
    if len(ways) != 1 or len(gears) > 1 or not min(ways) > 0.0 or not min(gears, default=1.0) > 0.0:
        return lead
    way, gear = ways.pop(), gears.pop() if gears else 1.0
    if lead and abs(lead.value / way - 1.0) > _SAME:
        return lead
    behind = f" behind a gear {gear:g}:1" if gear != 1.0 else ""
    return HeaderValue(way / gear, header_text(f"{1e3 * way:.4g} mm per turn of the wheel{behind}"))


def _number(text: str) -> float:
    return float(text.replace(",", "."))
