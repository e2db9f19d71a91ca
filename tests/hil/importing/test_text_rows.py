"""Rows of plain numbers are read at once: the result is that of the reader that takes each line."""

from __future__ import annotations

import itertools
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hil.errors import InputError
from hil.importing import text_rows
from hil.importing.map_file import CsvOptions
from hil.importing.text_rows import TextRows, read_rows

NAMES = ("a", "b")
FIELDS = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(["", " 1", "1 ", "+2", "-.5", "3.", "1e5", "1,5", "nan", "inf", "NULL", "1_0", "0x1", '"4"', "x"]),
    st.sampled_from(["- 1", "\u22121", "1\0", "true", "12:00:01.5", "1e999", "\t7", "\ufeff1", "N/A", "1;2"]),
)


def read(text: str, delimiter: str, decimal: str) -> TextRows | str:
    options = CsvOptions(delimiter=delimiter, decimal_point=decimal, column_names=NAMES)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_text(text, encoding="utf-8", newline="")
        try:
            return read_rows(path, NAMES, options)
        except InputError as error:
            return str(error).replace(folder, "")


@given(
    st.lists(st.lists(FIELDS, min_size=1, max_size=3), min_size=1, max_size=12),
    st.sampled_from([",", ";", "\t", " "]),
    st.sampled_from([".", ","]),
    st.sampled_from(["\n", "\r\n", "\n\n"]),
    st.integers(1, 4),
)
@example([["1", "2"], ["3", "4"], ["x", "5"], ["6", "7"], ["8", "9"]], ",", ".", "\n", 2)
@example([["1"], ["2"], ["3", "12:00:01.5"], ["4", "5"]], ",", ".", "\n", 3)
@example([["1,5", "2"], ["3", "4"]], ";", ",", "\r\n", 4)
def test_lines_read_at_once_are_those_read_in_turn(
    rows: list[list[str]], delimiter: str, decimal: str, ending: str, chunk: int
) -> None:
    text = ending.join(delimiter.join(row) for row in rows)
    with patch.object(text_rows, "_CHUNK", chunk):
        at_once = read(text, delimiter, decimal)
    with patch.object(text_rows, "_CHUNK", chunk), patch.object(text_rows._Reader, "_take_plain", lambda *_: False):
        in_turn = read(text, delimiter, decimal)
    if isinstance(in_turn, str) or isinstance(at_once, str):
        assert at_once == in_turn
        return
    assert (at_once.texts, at_once.notes) == (in_turn.texts, in_turn.notes)
    np.testing.assert_array_equal(at_once.lines, in_turn.lines)
    for one, other in ((at_once.numbers, in_turn.numbers), (at_once.dates, in_turn.dates)):
        assert one.keys() == other.keys()
        for name, values in one.items():
            np.testing.assert_array_equal(values, other[name])


@pytest.mark.parametrize("decimal", [".", ","])
def test_plain_rows_are_read_at_once(decimal: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_rows._Reader, "_take_line", None)
    text = "\n".join(f"{k}.5;{-k}" for k in range(50)).replace(".", decimal)
    rows = read(text, ";", decimal)
    assert isinstance(rows, TextRows)
    np.testing.assert_array_equal(rows.numbers["a"], np.arange(50) + 0.5)
    assert list(itertools.islice(rows.lines, 3)) == [1, 2, 3]
