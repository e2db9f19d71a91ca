"""Encoding of a text file: that in which most of its words are known, and its signs are those of a language."""

import re
import unicodedata
from collections.abc import Sequence

from hil.importing.column_names import label

ENCODINGS = ("utf-8", "cp1252", "cp850", "cp437", "mac_roman", "cp932", "gb18030", "cp1251")
_MOST_LINES = 400  # beginning of a file, with its names and units
_SEPARATORS = re.compile(r"[\t;,|\"]|\s{2,}|\s(?=\[)")
# letters of western languages and signs of units; other scripts are judged by their category
_USUAL = set("äöüÄÖÜßéèêëàâáåçñíìîïóòôúùûøæœ°º²³·µμΩω‰±×÷–—’‘“”…«»€®©½") | {"\u00a0", "\u202f", "\ufeff"}
_BESIDE_WORDS = set("°‰±÷©®€«»“”")  # signs that stand within no word


def encoding_of(lines: Sequence[bytes]) -> str:
    """Encoding of the lines of a file; cp850, which reads every byte, if no other one does."""
    if _decoded(lines, "utf-8") is not None:
        return "utf-8"
    odd = [line for line in lines[:_MOST_LINES] if not line.isascii()]
    read = {one: text for one in ENCODINGS[1:] if _decoded(lines, one) is not None and (text := _decoded(odd, one))}
    return max(read, key=lambda one: _sense(read[one]), default="cp850")


def _decoded(lines: Sequence[bytes], encoding: str) -> list[str] | None:
    try:
        return [line.decode(encoding) for line in lines]
    except UnicodeDecodeError:
        return None


def _sense(lines: Sequence[str]) -> tuple[float, float]:
    """Share of the signs that are usual, and the number of words and units that are known."""
    around = [(line[at - 1 : at + 2], sign) for line in lines for at, sign in enumerate(line) if ord(sign) > 127]
    usual = sum(_usual(sign) for beside, sign in around if not _amid(beside, sign)) / max(len(around), 1)
    words = {word.strip() for line in lines for word in _SEPARATORS.split(line) if not word.isascii()}
    known = sum(one.sure or one.unit is not None for one in map(label, words))
    return round(usual, 1), known + usual


def _amid(beside: str, sign: str) -> bool:
    """True if a sign that stands within no word has letters on both sides: Ger‰t."""
    return sign in _BESIDE_WORDS and len(beside) == 3 and beside[0].isalpha() and beside[2].isalpha()


def _usual(sign: str) -> float:
    if sign in _USUAL:
        return 1.0
    name = unicodedata.name(sign, "")
    if name.startswith("HALFWIDTH"):
        return 0.5
    return float(name.startswith(("CJK", "KATAKANA", "HIRAGANA", "FULLWIDTH", "CYRILLIC", "IDEOGRAPHIC")))
