"""Read numbers as text files write them: decimal and thousands marks, a blank after the sign."""

import re
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.importing.lexicon import lexicon

# A value beyond the range of its channel (+++++++, ******, ∞), and an error of a spreadsheet (#VALUE!, #N/A).
_MARK = re.compile(r"[+*#-]{2,}|[+-]?[∞]|#[a-z/0]+[!?]?")
_MANY = 20  # fields with a mark that tell thousands from decimals
_SIGNS = str.maketrans({"\u2212": "-", "\u2019": "'", "\u00a0": " ", "\u202f": " "})


class NumberForm(NamedTuple):
    """Decimal mark, and the mark between thousands ("" without one)."""

    decimal: str = "."
    thousands: str = ""


# simplest first: of two forms that read the same fields the earlier one counts
_FORMS = tuple(NumberForm(decimal, thousands) for thousands in ("", ".", ",", "'", " ") for decimal in ".,"
               if decimal != thousands)  # fmt: skip


@cache
def _pattern(form: NumberForm) -> re.Pattern[str]:
    mark, group = re.escape(form.decimal), re.escape(form.thousands)
    whole = rf"(\d+|[1-9]\d{{0,2}}({group}\d{{3}})+)" if form.thousands else r"\d+"
    return re.compile(rf"([+-]?)\s*({whole}({mark}\d*)?|{mark}\d+)([eE][+-]?\d+)?")


def number_of(text: str, form: NumberForm) -> float | None:
    """Number of a field, NaN where it is empty or stands for a missing number; None for other text."""
    text = text.strip().translate(_SIGNS)
    if _pattern(form).fullmatch(text):
        plain = text.replace(form.thousands, "") if form.thousands else text
        return float("".join(plain.replace(form.decimal, ".").split()))
    word = text.lower()
    if word in lexicon().infinite:
        return float(word)
    return float("nan") if word in ("", *lexicon().missing) or _MARK.fullmatch(word) else None


def numbers_of(fields: Sequence[str], form: NumberForm) -> tuple[FloatArray, dict[int, str]]:
    """Numbers (n,) of the fields of one column, NaN without one, and the texts among them by row.

    A column that is written throughout with the other decimal mark than its file is read by that.
    """
    try:  # most columns hold nothing but plain numbers
        joined = "".join(fields)
        if form.decimal == "." and "_" not in joined and "n" not in joined and "N" not in joined:
            return np.array([float(field) for field in fields]), {}
    except ValueError:
        pass
    given = [number_of(field, form) for field in fields]
    if None in given:
        other = [number_of(field, NumberForm("," if form.decimal == "." else ".")) for field in fields]
        given = given if None in other else other
    values = np.array(given, dtype=np.float64)
    return values, {row: fields[row] for row, value in enumerate(given) if value is None}


def find_form(rows: Sequence[Sequence[str]]) -> tuple[NumberForm, float]:
    """The form that reads most fields of `rows`, and the share of the fields that it reads."""
    fields = [field for row in rows for field in row]
    # a mark that some field has as its decimal mark stands between no thousands of this file
    decimal = {mark for mark in ".," if any(_is_decimal(field, mark) for field in fields if mark in field)}
    forms = [form for form in _FORMS if form.thousands not in decimal]
    share = {form: sum(number_of(field, form) is not None for field in fields) / max(len(fields), 1) for form in forms}
    best = max(forms, key=lambda form: share[form])
    other = NumberForm("," if best.decimal == "." else ".", best.decimal)
    if not best.thousands and share.get(other) == share[best] and _are_thousands(list(zip(*rows, strict=False)), other):
        best = other
    return best, share[best]


def _is_decimal(field: str, mark: str) -> bool:
    """True for a number that reads only with `mark` before its decimals: 0,5 or 12,34."""
    form = NumberForm(mark)
    other = NumberForm("," if mark == "." else ".", mark)
    return number_of(field, form) is not None and number_of(field, other) is None


def _are_thousands(columns: list[tuple[str, ...]], form: NumberForm) -> bool:
    """True if the marks of a file stand between thousands only, and one column has smaller numbers without a mark.

    A decimal mark stands before other than three digits somewhere, or in every number of its column.
    """
    found = 0
    for column in columns:
        texts = [field.strip().lstrip("+- ") for field in column]
        marked = [text for text in texts if form.thousands in text]
        plain = [text for text in texts if text.isdigit()]
        if not marked:
            continue
        if any(not _pattern(form).fullmatch(text) for text in marked) or any(len(text) > 3 for text in plain):
            return False
        found += len(marked) if plain else 0
    return found >= _MANY
