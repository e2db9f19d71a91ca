"""Sizes of a count in the words of a README, as the phrases that are read: steps of 0.01 deg as 1 digit = 0.01 deg."""

import re

from hil.importing.units import unit_named

_NUMBER = r"(\d+(?:[.,]\d+)?(?:e-?\d+)?)"
_UNIT = r"([^\W\d][\w·*²^]*(?:/\w+)?(?: m\b)?)"
_MANY = "units?|steps?|counts|digits|increments?|multiples|einheiten|schritten?|inkrementen?"
_PARTS = {"tenth": 0.1, "hundredth": 0.01, "thousandth": 1e-3, "millionth": 1e-6, "deci": 0.1, "centi": 0.01,
          "milli": 1e-3, "micro": 1e-6}  # fmt: skip
_OF_MANY = re.compile(rf"\b(?:in )?(?:{_MANY}) (?:of|von|zu|je) {_NUMBER} ?{_UNIT}", re.IGNORECASE)
_BEFORE_MANY = re.compile(rf"\b(?:in )?(?<![\d.,/]){_NUMBER} ?{_UNIT}[ -](?:{_MANY})\b", re.IGNORECASE)
_PART = re.compile(rf"\bin 1/{_NUMBER} ?{_UNIT}", re.IGNORECASE)
_IN = re.compile(rf"\bin {_NUMBER} ?{_UNIT}", re.IGNORECASE)
_SMALL = re.compile(rf"(?<![\w.])(\d+(?:[.,]\d+)?e-\d+) ?{_UNIT}(?= *(?:$|[,;|)\]]))", re.IGNORECASE)
_TIMES = re.compile(rf"\b{_UNIT} ?(?:[x×*] ?|/)(10+)(?= *(?:$|[,;|)\]]))", re.IGNORECASE)
_SCALED = re.compile(rf"\b(?:scaled by|times|multiplied by|mal) (10+)[, (\[]+{_UNIT}", re.IGNORECASE)
_OF_A = re.compile(
    rf"\b(?:in )?(?:({'|'.join(_PARTS)})s? of (?:an? |one )?|(deci|centi|milli|micro)-?)"
    r"(degree|rev(?:olution)?|turn|amp(?:ere)?|volt)s?\b",
    re.IGNORECASE,
)
_SHARE = re.compile(rf"\bin {_NUMBER} ?%(?= of | des | der )", re.IGNORECASE)
_RATED = re.compile(
    r"(?<![\w.])(\d{3,}) ?(?:=|is|are|equals|entspricht) ?(?:the )?(?:rated|nominal) (?:torque|force|current)\b"
)
_VOLTS = re.compile(
    rf"(?:\+-|±)?{_NUMBER} ?V ?(?:=|is|are|equals|corresponds? to|entspr\w+|->|for) ?(?:\+-|±)?{_NUMBER} ?{_UNIT}"
)
_PER_VOLT = re.compile(rf"\bper volt ?[:=] ?{_NUMBER} ?{_UNIT}", re.IGNORECASE)
_QUADRATURE = re.compile(
    r"(?<![\d.,])(\d+) ?(?:lines|ppr|pulses|striche|slits)(?: (?:per|/|pro) ?(?:rev\w*|turn|umdrehung))?"
    r"[, (]+(?:with |mit )?(?:x ?4\b|4 ?x\b|4-fold|quadrature|vierfach)",
    re.IGNORECASE,
)


def plain_sizes(text: str) -> str:
    """A text with the sizes of a count that it tells as `1 digit = SIZE`, `SHARE % of` or `SIZE/V`.

    A number above 1 is a size only where it is said of each step.
    """
    text = _QUADRATURE.sub(lambda one: f"{4 * int(one[1])} counts per turn", text)
    text = _VOLTS.sub(lambda one: _per_volt(one[0], _value(one[2]) * _inverse(_value(one[1])), one[3]), text)
    text = _PER_VOLT.sub(lambda one: _per_volt(one[0], _value(one[1]), one[2]), text)
    text = _RATED.sub(lambda one: f", {_digits(100.0 / int(one[1]))} % of rated", text)
    text = _SHARE.sub(lambda one: f", {one[1]} %", text)
    for pattern in (_OF_MANY, _BEFORE_MANY):
        text = pattern.sub(lambda one: _size(one[0], _value(one[1]), one[2]), text)
    text = _PART.sub(lambda one: _size(one[0], _inverse(_value(one[1])), one[2]), text)
    for pattern in (_IN, _SMALL):
        text = pattern.sub(lambda one: _size(one[0], _value(one[1]), one[2]) if _value(one[1]) < 1.0 else one[0], text)
    text = _TIMES.sub(lambda one: _size(one[0], 1.0 / int(one[2]), one[1]), text)
    text = _SCALED.sub(lambda one: _size(one[0], 1.0 / int(one[1]), one[2]), text)
    return _OF_A.sub(lambda one: _size(one[0], _PARTS[(one[1] or one[2]).lower()], one[3].lower()), text)


def _size(told: str, value: float, unit: str) -> str:
    known = value > 0.0 and unit_named(unit) not in (None, "counts")
    return f", 1 digit = {_digits(value)} {unit}" if known else told


def _per_volt(told: str, value: float, unit: str) -> str:
    return f", {_digits(value)} {unit}/V" if value > 0.0 and unit_named(unit) not in (None, "counts") else told


def _inverse(value: float) -> float:
    return 1.0 / value if value else 0.0


def _value(number: str) -> float:
    return float(number.replace(",", "."))


def _digits(value: float) -> str:
    return f"{value:.12f}".rstrip("0").rstrip(".")
