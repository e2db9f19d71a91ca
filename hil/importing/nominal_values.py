"""Masses and inertias that an owner tells in sentences: of the load, of the motor.

"Table with fixture about 335 kg. Motor + coupling + screw about 2.8e-3 kg m2." Recordings tell their sum alone below
the resonance of the transmission. The word nearest to the number tells whose it is; a sum of both tells nothing.
"""

import re
from collections.abc import Iterator

from hil.importing.lexicon import Constant, lexicon

_SHORT = 4  # letters: a longer word may have another ending
_BEGUN = re.compile(r"k?g[cm]?m")  # kg m: the unit goes on behind kg


def mass_told(words: str, value: float, units: tuple[str, ...]) -> tuple[Constant, float] | None:
    """Constant and value [SI] of a number behind plain `words`, with texts that may be its unit, longest first."""
    known = lexicon().masses
    unit = next(iter(_read(units)), "")
    of_load, of_motor, of_neither = (
        [place for place, word in enumerate(words.split()) if _is_one_of(word, some)]
        for some in (known.load, known.motor, known.neither)
    )
    if not unit or not (of_load or of_motor) or of_neither or not value > 0.0:
        return None
    if factor := known.mass_units.get(unit):  # a slide with its motor slides
        return (Constant.LOAD_MASS, factor * value) if of_load else None
    nearest = max(of_load, default=-1) > max(of_motor, default=-1)
    return (Constant.LOAD_INERTIA if nearest else Constant.MOTOR_INERTIA), known.inertia_units[unit] * value


def _is_one_of(word: str, some: tuple[str, ...]) -> bool:
    """True for a word, or a long one with another ending."""
    return any(word == one or (len(one) > _SHORT and word.startswith(one)) for one in some)


def _read(units: tuple[str, ...]) -> Iterator[str]:
    """Units of a mass or an inertia among the texts; none behind one that goes on."""
    known = lexicon().masses
    for text in units:
        if _BEGUN.fullmatch(text):
            return
        if text in known.mass_units or text in known.inertia_units:
            yield text
