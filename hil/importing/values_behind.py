"""Constants whose words stand behind their number: 8192 per motor turn, 250 samples per second, 5 ms per line.

And those of a sentence or a phrase of their own: logged at 4 kHz; leg 3   500 Hz; 1 count = 0.05 um.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_PER_TURN = re.compile(
    r"^ *(?:(?:steps|pulses|increments|inkremente|counts|impulse) )?(?:per|pro) (motor )?(?:turn|rev\w*|umdrehung)"
    r"(?! of| der| des|/)"
)
_OF_COUNTS = re.compile(r"encoder|resolver|increment|inkrement|geber|codeur")
_NO_COUNTS = re.compile(
    r"\b(cogging|ripple|poles?|hall|stepp\w*|gear\w*|getriebe|tacho|quadratur\w*|(?<!after )x ?4)\b"
)
_PER_SECOND = re.compile(r"^ *(samples|rows|lines) ?(?:per|/) ?s(?:ec|\b)")
_PER_ROW = re.compile(r"^ *(m?s|us|\w+seconds) (?:per (?:line|row)|apart)\b")
_LOGGED_AT = re.compile(
    r"\b(?:logged|recorded|sampled|captured|traced|polled|aufgezeichnet|abgetastet|aufgenommen|enregistre\w*)"
    r"(?: by(?: the)? \w+| on the \w+| von \w+)?(?: at| with| mit| a)?(?: about| ca| nominal(?:ly)?)? *$"
)
_HERTZ = re.compile(r"^ *(k?hz)\b")
_ALONE = re.compile(r"^ *(k?hz) *(?:$|[,;:.)|\t]|  )")  # between separators: leg 3   500 Hz; two lines, 500 Hz
_LASTS = re.compile(r"^ *(k?hz) *, *\d+(?:[.,]\d+)? ?(?:s|sec|min|seconds|minutes|sekunden|minuten)\b")  # 2 kHz, 28 s
_BEGINS = re.compile(r"(?:^|  |\t|[(|]|[^\W\d][^,;]*[,;]) *$")
_OF_RUN = re.compile(r"\b(leg|run|test|trace|log|axis|achse|messung|versuch|recording|aufzeichnung|fahrt|lauf)\b")
_FORMAT = re.compile(
    r"\b(separated|delimited|getrennt|header|tabs?|comma|semicolons?|columns?|spalten|rows|zeilen)\b|\w\.[a-z]\w{1,6}\b"
)
_OTHER_HERTZ = re.compile(
    r"\b(\w*loops?|\w*kreis|bandwi?d?th|bandbreite|\w*filter\w*|\w*pass|cut\w*|corner|pwm|switching|carrier|modes?"
    r"|sin(?:es?|us)|resonan\w*|eigen\w*|natural|first|chirp|sweep|multi\w*|noise|rauschen|\w*regler|control\w*"
    r"|umrichter|bus|ethercat|takt|internal\w*|notch|supply|mains|netz|rated|frequency|frequenz|decimated|thinned"
    r"|resampled|excit\w*|anregung|dither|square|circle|ripple|reversal|vibrat\w*|oscillat\w*)\b"
)
_COUNT_IS = re.compile(
    r"\b1 ?(?:count|cnt|inc|increment|inkrement|digit|tick|lsb) ?(?:=|is|are|equals|entspricht) ?"
    r"(\d+(?:[.,]\d+)?(?:e-?\d+)?) ?([nu]?m|mm)\b"
)
_OF_SCALE = re.compile(r"\b(?:\w*encoder|scale|massstab|glass|linear|position)\b(?!.*\b(?:error|probe|display)\b)")
_OF_FILE = re.compile(
    r"\b(file|rows?|sample (?:number|index|counter)|record\w*|header|separated|comma|tabs?)\b|\.\w{2,5}\b"
)


@dataclass(frozen=True)
class Statement:
    """Words, the number that follows them, the texts that may be its unit, the whole text, and the last phrase.

    `sentence` has the words of the last sentence alone. `grouped`: the number may have thousands.
    `of_motor`: it is a way, or counts, per turn of the motor. `weak`: what is said otherwise goes before it, and before
    what stands `alone`, without words of its own.
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
    alone: bool = False


def size_of_count(text: str, line: str) -> Statement | None:
    """The statement of a length of one count, of an encoder or alone: 1 count = 0.05 um."""
    told = _COUNT_IS.search(text)
    if told and re.search(r"\w", text[: told.start()] + text[told.end() :]) and not _OF_SCALE.search(text):
        return None
    size = float(told[1].replace(",", ".")) if told else 0.0
    return Statement("", 1.0 / size, (f"counts/{told[2]}",), line) if told and size else None


def told_behind(around: tuple[str, str], before: str, value: float, text: str, line: str) -> Iterator[Statement]:
    """The statement of a number behind which its words stand, of counts per turn, a rate or a period.

    `before` and `text` are the words since the last number and up to the next one, `around` all of the line.
    """
    ahead, rest = around
    other = _OTHER_HERTZ.search(re.split(r"[.;]\s", ahead)[-1] + text.partition(";")[0])
    blank = re.search(r"(?:^|  |\t) *$", before)
    of_rows = _LASTS.match(rest) or (_OF_RUN if blank else _FORMAT).search(ahead)
    alone = _ALONE.match(text) if of_rows and _BEGINS.search(before) else None
    logged = _HERTZ.match(text) if _LOGGED_AT.search(before) else None
    if (rate := logged or alone) and not other:
        yield Statement("sample rate", value, (rate[1],), line, weak=True, alone=not logged)
    text = re.split(r"[.;](?:\s|$)", text)[0]
    turn = _PER_TURN.match(text)
    if turn and _OF_COUNTS.search(before) and not _NO_COUNTS.search(before + text):
        yield Statement("", value, ("counts/rev",), line, of_motor=bool(turn[1]))
    second = _PER_SECOND.match(text)
    if second and (second[1] == "rows" or _OF_FILE.search(before)):
        yield Statement("sample rate", value, ("hz",), line, weak=True)
    if period := _PER_ROW.match(text):
        yield Statement("sample time", value, (period[1],), line, weak=True)
