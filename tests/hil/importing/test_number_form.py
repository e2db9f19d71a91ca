"""Numbers of text files: every form reads what it writes, and the file tells the form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.importing.number_form import NumberForm, find_form, number_of, numbers_of

FORMS = [
    NumberForm("."),
    NumberForm(","),
    NumberForm(".", ","),
    NumberForm(",", "."),
    NumberForm(".", "'"),
    NumberForm(",", " "),
]


def written(value: float, form: NumberForm, decimals: int) -> str:
    text = f"{value:{',' if form.thousands else ''}.{decimals}f}"
    return "".join({",": form.thousands, ".": form.decimal}.get(one, one) for one in text)


@given(
    values=st.lists(st.floats(-1e7, 1e7), min_size=1, max_size=20),
    form=st.sampled_from(FORMS),
    decimals=st.integers(1, 6),
)
def test_a_form_reads_what_it_writes(values: list[float], form: NumberForm, decimals: int) -> None:
    read, texts = numbers_of([written(value, form, decimals) for value in values], form)
    assert not texts
    np.testing.assert_allclose(read, values, atol=10.0**-decimals)


def test_any_white_space_may_follow_a_sign() -> None:
    assert number_of("- 1.5", NumberForm()) == number_of("-\x1d1.5", NumberForm()) == -1.5


@pytest.mark.parametrize("form", FORMS)
def test_the_fields_tell_the_form(form: NumberForm) -> None:
    values = np.linspace(-5000.0, 20000.0, 200)
    rows = [[written(value, form, 4), written(value / 1e4, form, 4)] for value in values]
    assert find_form(rows) == (form, 1.0)


def test_marks_of_whole_numbers_are_thousands_only_beside_smaller_ones() -> None:
    counts = [[f"{value:,}".replace(",", ".")] for value in range(0, 40_000, 37)]
    assert find_form(counts)[0] == NumberForm(",", ".")
    lengths = [[f"{value / 1000:.3f}"] for value in range(100_000, 300_000, 999)]
    assert find_form(lengths)[0] == NumberForm(".")


@pytest.mark.parametrize(
    ("text", "value"), [("+ 0.5", 0.5), ("- 2", -2.0), ("\u22121.5", -1.5), ("1_0", None), ("OK", None)]
)
def test_signs_and_texts(text: str, value: float | None) -> None:
    assert number_of(text, NumberForm()) == value
