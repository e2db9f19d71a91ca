"""Masses, inertias and the stiffness that an owner tells in sentences: of the load, of the motor, between them.

"Table with fixture about 335 kg. Motor + coupling + screw about 2.8e-3 kg m2." Recordings tell their sum alone below
the resonance of the transmission. Words between the last number and this one tell whose it is. A sum of both, a limit,
a workpiece or a force tells nothing, nor does a number that may have thousands.
"""

import re

from hil.importing.lexicon import Constant, lexicon, without_accents
from hil.importing.values_behind import Statement

_SHORT = 4  # letters: a longer word may have another ending
_INERTIA = re.compile(r"inertia|tragheitsmoment|inertie|inerzia|inercia")
_OF_LINE = re.compile(rf"^(?:\w+ )?(?:{_INERTIA.pattern})(?: about the axis)?$")
_SENTENCE = re.compile(r"(?<!\bmin)(?<!\bmax)(?<!\bca)[.;]\s")
_GOES_ON = re.compile(r"k?g[cm]?m|(?:kg|lbs?)(?:\+|plus).*|lbs?(?:in|ft).*")  # kg m, lb in, kg plus others


def nominal_told(told: Statement) -> tuple[Constant, float] | None:
    """Constant and value [SI] of a mass, an inertia or a stiffness that a statement tells; None for others."""
    return _stiffness_told(told) or _mass_told(told)


def _stiffness_told(told: Statement) -> tuple[Constant, float] | None:
    """Stiffness of the whole transmission; that of a part, or of a stop, tells nothing."""
    known = lexicon().masses
    says = any(_is_one_of(word, known.stiffness) for word in told.sentence.split())
    sentences = (re.findall(r"[^\W\d_]+", one) for one in _SENTENCE.split(without_accents(told.text).lower()))
    words = next((one for one in sentences if any(_is_one_of(word, known.stiffness) for word in one)), [])
    of_others = any(_is_one_of(word, (*known.other_stiffness, *known.limits)) for word in words)
    of_part = sum(any(_is_one_of(word, (one,)) for word in words) for one in known.parts) == 1
    if not says or of_others or of_part or told.grouped or ">" in told.text or not told.number > 0.0:
        return None
    kinds = ((Constant.STIFFNESS, known.stiffness_units), (Constant.TORSION, known.torsion_units))
    return next(((kind, units[one] * told.number) for one in told.units for kind, units in kinds if one in units), None)


def _mass_told(told: Statement) -> tuple[Constant, float] | None:
    """Constant and value [SI] of a statement; None for one that tells neither mass nor inertia of one part."""
    known, words = lexicon().masses, told.sentence.split()
    if _OF_LINE.search(told.sentence):  # arm 4.5 kg, inertia about the axis 0.9 kg m^2
        words = [*re.findall(r"[^\W\d_]+", _INERTIA.split(without_accents(told.text).lower())[0]), *words]
    of_load, of_motor, of_neither = (
        [place for place, word in enumerate(words) if _is_one_of(word, some)]
        for some in (known.load, known.motor, known.neither)
    )
    if of_neither or not (of_load or of_motor) or told.grouped or not told.number > 0.0:
        return None
    unit = "" if any(map(_GOES_ON.fullmatch, told.units)) else next((one for one in told.units if _is_unit(one)), "")
    if factor := known.mass_units.get(unit):
        nearest = max(of_load, default=-1) > max(of_motor, default=-1)
        return (Constant.LOAD_MASS, factor * told.number) if nearest else None
    if not unit or (of_load and of_motor):  # a sum, or one seen from the other
        return None
    return (Constant.LOAD_INERTIA if of_load else Constant.MOTOR_INERTIA), known.inertia_units[unit] * told.number


def _is_one_of(word: str, some: tuple[str, ...]) -> bool:
    """True for a word, or a long one with another ending."""
    return any(word == one or (len(one) > _SHORT and word.startswith(one)) for one in some)


def _is_unit(text: str) -> bool:
    return text in lexicon().masses.mass_units or text in lexicon().masses.inertia_units
