"""Read the name of a column: quantity, set-point or measured, motor or table, unit. The words are in `lexicon.yaml`."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from hil.importing.lexicon import Quantity, lexicon, without_accents
from hil.importing.units import (
    QUANTITY_OF_UNIT,
    counts_steps,
    split_unit,
    unit_named,
    unit_of_part,
    unit_of_text,
    unit_within,
    whole_unit,
)
from hil.quantities import UNITS

_NOTHING = (Quantity.UNKNOWN, False)
_MOTION = (Quantity.POSITION, Quantity.VELOCITY, Quantity.ACCELERATION)
_BRACKET = re.compile(r"[\[({].*[\])}]")
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]+(:\d+)?")
_OBJECT = re.compile(r"(?<![0-9a-zA-Z])(?:0x)?(6[0-9a-fA-F]{3})h?(?![0-9a-zA-Z])")
_ADDRESS_OF_DRIVE = re.compile(
    r"\b0x(6[0-9a-f]{3})(?![0-9a-z])|(?<![0-9a-z])(6[0-9a-f]{3})h\b|(?<![0-9a-z])(s-0-\d{4})(?!\d)", re.IGNORECASE
)
_INDEX = re.compile(r"[\[({]\s*(?:\w+\s*[,;:]\s*)?(\d+)\s*[\])}]\s*$")  # [2], (2), [u1, 2]
_LINEAR_AXES, _AXES = "xyz", "xyzabcuvw"  # ISO 841
LEAST_WITHIN = 4  # letters of a word that is also found within a longer one: shorter ones occur in others by chance


@dataclass(frozen=True)
class Label:
    """Meaning of a column's name. `unit` is None if the name gives none; `odd_unit`: it gives an unknown one."""

    column: str
    quantity: Quantity
    command: bool
    measured: bool
    motor: bool
    table: bool
    number: str  # of the axis or encoder, or its letter; "" without one
    unit: str | None
    odd_unit: bool = False
    electric: str | None = None  # A or V if the word says current or voltage
    si: str | None = None  # N m or N if its unit or a word says torque or force
    part: bool = False  # of a torque: friction, gravity
    letter: bool = False  # one letter says its quantity, beside nothing else that is known
    encoder: bool = False  # a word says that an encoder measured it
    steps: bool = False  # a word says that it counts the steps of a stepper

    @property
    def sure(self) -> bool:
        return self.quantity is not Quantity.UNKNOWN


def label(column: str, unit_text: str = "", words_beside: str = "", of_cells: bool = False) -> Label:
    """Read the name of a column, and the unit and the words that the file gives for it (empty without).

    The unit of the name counts first, but for one of the cells themselves.
    """
    words_beside = f"{words_beside} {_words_of_address(column) or _words_of_address(words_beside)}".strip()
    name, unit, odd = split_unit(column.strip())
    if unit is None and not odd:
        name, unit = _unit_after_blank(name)
        unit = unit or whole_unit(name.rpartition(".")[2])
    if unit_text and (unit is None or of_cells):
        unit, odd = unit_of_text(unit_text), unit_of_text(unit_text) is None
    if unit is None and not odd:
        unit = split_unit(words_beside)[1] if _BRACKET.search(words_beside) else None
    if unit is None and (part := unit_of_part(words_beside)):
        unit, odd = part, False
    tokens = plain_words(name)
    beside = _words(plain_words(words_beside))
    words = _words(tokens) + beside
    index = _INDEX.search(name if unit else column.strip())
    known = lexicon()
    of_steps = odd and counts_steps(unit_text or column.strip()[len(name) :])
    of_steps = of_steps and not _any(words, known.measured) and not _any(words, known.motor)
    odd = odd and index is None and not of_steps
    # of a path the last words count: pid.x.output, /joint_states/joint1/position
    parts = [_words(plain_words(part)) for part in reversed(re.split(r"[./:]", name))]
    found = sorted((_found(part) for part in (*parts, beside)), key=lambda one: one[1])  # a letter says least
    quantity, letter = next((one for one in found if one != _NOTHING), _NOTHING)
    if len(tokens) == 1 and tokens[0] in known.stamps:
        quantity, letter = Quantity.TIME, False
    if unit is None and not odd and not letter and quantity is not Quantity.UNKNOWN:
        unit = unit_within(name, quantity)
    if unit is None and not odd and quantity is Quantity.EFFORT:
        unit = _unit_of_object(name)
    of_unit = QUANTITY_OF_UNIT.get(unit or "")
    strange = letter and _strange(words)
    in_nm = "nm" in (unit_text or column) and "Nm" not in f"{unit_text}{column}"  # a torque may be in either
    of_scale = in_nm and quantity is Quantity.UNKNOWN and not {*words}.isdisjoint(known.linear_scale)
    if unit == "N m" and (quantity is Quantity.POSITION or of_scale) and not strange and not _any(words, ("moment",)):
        unit, quantity = "nm", Quantity.POSITION
    elif unit == "rev" and quantity not in (Quantity.POSITION, Quantity.UNKNOWN):
        unit = None  # speed_rev is a reversal
    elif unit in ("%", "permille") and quantity in _MOTION:
        unit, odd = None, True  # a share of a stroke or of a top speed, which the file does not tell
    elif of_unit and quantity is not Quantity.OTHER and not (unit == "min" and quantity is not Quantity.TIME):
        quantity = of_unit
    elif unit and unit not in QUANTITY_OF_UNIT:
        unit = None
    steps = (of_steps or _any(words, known.steps)) and not _any(words, known.encoder)
    if steps and quantity is Quantity.UNKNOWN and not odd and (_any(words, known.command) or len(tokens) == 1):
        quantity, unit = Quantity.POSITION, unit or "counts"
    measured = _any(words, known.measured)
    planned = not measured and quantity in _MOTION and _any(words, known.planned)
    return Label(
        column,
        quantity,
        _any(words, known.command) or planned or steps,
        measured,
        _any(words, known.motor),
        _any(words, known.table),
        index[1] if index else _axis(tokens),
        unit,
        odd,
        _electric(words) if quantity is Quantity.EFFORT and not _any(words, known.torque) else None,
        _si(words, unit) if quantity is Quantity.EFFORT else None,
        _any(words, known.part),
        not words_beside and quantity is not Quantity.TIME and (len(name.strip()) == 1 or strange),
        _any(words, known.encoder),
        steps,
    )


def _words_of_address(name: str) -> str:
    """Words for the address of a drive's value in a name, 0x6064 or S-0-0051, or for a name that is one; "" without."""
    address = _ADDRESS_OF_DRIVE.search(name) or _OBJECT.fullmatch(name.strip())
    found = next((one for one in address.groups() if one), "") if address else ""
    return lexicon().addresses.get(found.lower(), "")


def _unit_of_object(name: str) -> str | None:
    """Unit that CiA 402 gives the object of a name: 6077 torque actual, 0x6077, 6077h."""
    index = _OBJECT.search(name)
    units = lexicon().objects.items()
    return next((unit for unit, known in units if index and index[1].lower() in known), None)


def _axis(tokens: list[str]) -> str:
    """Number at the end of a word, else the letter of an axis that is a word: pos2, act_torque_y; "" without one."""
    numbers = (match[1] for token in reversed(tokens) if (match := re.search(r"(\d+)$", token)))
    letters = (token for token in tokens if len(token) == 1 and token in (_AXES if len(tokens) > 1 else _LINEAR_AXES))
    return next(numbers, next(letters, ""))


def _electric(words: list[str]) -> str | None:
    """A or V if a word says current or voltage; a long word counts more than a symbol."""
    units = {word: unit for unit, known in lexicon().electric.items() for word in known}
    long = (unit for word, unit in units.items() if len(word) >= LEAST_WITHIN and _any(words, (word,)))
    return next(long, next((units[word] for word in words if word in units), None))


def effort_of_words(name: str) -> str | None:
    """N m or N by the words of a name."""
    return _si(_words(plain_words(name)), None)


def _si(words: list[str], unit: str | None) -> str | None:
    """N m or N by the unit of an effort, else by a word for torque or force alone."""
    if (si := UNITS.get(unit or "", ("",))[0]) in ("N m", "N"):
        return si
    told = [si for si, known in (("N m", lexicon().torque), ("N", lexicon().force)) if _any(words, known)]
    return told[0] if len(told) == 1 else None


def _unit_after_blank(name: str) -> tuple[str, str | None]:
    """Name without the unit that is its last word or two (Kraft kN); a letter is one after a word of its quantity."""
    words = name.split()
    for take in (2, 1):
        last, rest = " ".join(words[-take:]), " ".join(words[:-take])
        unit = unit_named(last) if rest else None
        of_unit = QUANTITY_OF_UNIT.get(unit or "")
        if (
            unit
            and of_unit
            and (len(last) > 1 or not last.isalpha() or of_unit == _quantity(_words(plain_words(rest))))
        ):
            return rest, unit
    return name, None


def _words(tokens: list[str]) -> list[str]:
    return [word for token in tokens for word in _split_suffix(re.sub(r"\d+$", "", token)) if word]


def _found(words: list[str]) -> tuple[Quantity, bool]:
    """Quantity of words, and True if only one letter says it."""
    long = _quantity([word for word in words if len(word) > 1])
    return (long, False) if long is not Quantity.UNKNOWN else ((found := _quantity(words)), found is not long)


def _strange(words: list[str]) -> bool:
    """True if words of more than one letter have no meaning for the role of a column."""
    known = lexicon()
    roles = (*known.command, *known.measured, *known.motor, *known.table)
    return any(len(word) > 1 and not _any([word], roles) and _quantity([word]) is Quantity.UNKNOWN for word in words)


def _quantity(words: list[str]) -> Quantity:
    return next((kind for kind, known in lexicon().quantities.items() if _any(words, known)), Quantity.UNKNOWN)


def plain_words(name: str) -> list[str]:
    """Words of a name in lower case without accents and addresses: motorPos_Ist2 0x6064 -> motor, pos, ist2."""
    plain = name.replace("ω", "omega").replace("τ", "tau").replace("φ", "phi").replace("θ", "theta")
    plain = without_accents(_ADDRESS.sub(" ", plain))
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=\d)(?=[A-Za-z])", " ", plain)
    return [token for token in re.split(r"[\W_]+", plain.lower()) if token]


def _split_suffix(token: str) -> list[str]:
    """xsoll -> x, soll; vist -> v, ist; istwinkel -> ist, winkel."""
    for ending in lexicon().attached_after:
        if token.endswith(ending) and 0 < len(token) - len(ending) <= 3:
            return [token[: -len(ending)], ending]
    for prefix in lexicon().attached_before:
        rest = token.removeprefix(prefix)
        if rest != token and _quantity([rest]) is not Quantity.UNKNOWN:
            return [prefix, rest]
    return [token]


def _any(words: list[str], known: Iterable[str]) -> bool:
    alone = lexicon().alone
    return any(
        one in words
        # other scripts write their words without blanks between them
        or ((len(one) >= LEAST_WITHIN or not one.isascii()) and one not in alone and any(one in word for word in words))
        for one in known
    )
