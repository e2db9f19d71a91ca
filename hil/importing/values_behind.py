"""Constants whose words stand behind their number: 8192 per motor turn, 250 samples per second, 5 ms per line."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_PER_TURN = re.compile(
    r"^ *(?:(?:steps|pulses|increments|inkremente|counts|impulse) )?(?:per|pro) (motor )?(?:turn|rev\w*|umdrehung)"
    r"(?! of| der| des|/)"
)
_OF_COUNTS = re.compile(r"encoder|resolver|increment|inkrement|geber|codeur")
_NO_COUNTS = re.compile(r"\b(cogging|ripple|poles?|hall|stepp\w*|gear\w*|getriebe|tacho|quadratur\w*|x ?4)\b")
_PER_SECOND = re.compile(r"^ *(samples|rows|lines) ?(?:per|/) ?s(?:ec|\b)")
_PER_ROW = re.compile(r"^ *(m?s|us|\w+seconds) (?:per (?:line|row)|apart)\b")
_OF_FILE = re.compile(
    r"\b(file|rows?|sample (?:number|index|counter)|record\w*|header|separated|comma|tabs?)\b|\.\w{2,5}\b"
)


@dataclass(frozen=True)
class Statement:
    """Words, the number that follows them, the texts that may be its unit, the whole text, and the last phrase.

    `sentence` has the words of the last sentence alone. `grouped`: the number may have thousands.
    `of_motor`: it is a way, or counts, per turn of the motor. `weak`: what is said otherwise goes before it.
    """

    words: str
    number: float
    units: tuple[str, ...]
    text: str
    phrase: str = ""
    sentence: str = ""
    grouped: bool = False
    of_motor: bool = False
    weak: bool = False


def told_behind(before: str, value: float, text: str, line: str) -> Iterator[Statement]:
    """The statement of a number behind which its words stand, of counts per turn, a rate or a period."""
    text = re.split(r"[.;](?:\s|$)", text)[0]
    turn = _PER_TURN.match(text)
    if turn and _OF_COUNTS.search(before) and not _NO_COUNTS.search(before + text):
        yield Statement("", value, ("counts/rev",), line, of_motor=bool(turn[1]))
    second = _PER_SECOND.match(text)
    if second and (second[1] == "rows" or _OF_FILE.search(before)):
        yield Statement("sample rate", value, ("hz",), line, weak=True)
    if period := _PER_ROW.match(text):
        yield Statement("sample time", value, (period[1],), line, weak=True)
