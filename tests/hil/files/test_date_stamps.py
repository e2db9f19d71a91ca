"""Dates and times of day in a file become seconds."""

from __future__ import annotations

import numpy as np
import pytest

from hil.files.date_stamps import is_date, seconds_of


@pytest.mark.parametrize(
    ("texts", "seconds"),
    [
        (["2024-03-01T12:00:00.001Z", "2024-03-01T12:00:01.001Z"], 1.0),
        (["2024-02-29 23:59:59.5", "2024-03-01 00:00:00.5"], 1.0),
        (["31.12.2023 23:59:59,5", "01.01.2024 00:00:00,75"], 1.25),
        (["12:00:00.001", "12:00:00.003"], 0.002),
        (["23:59:59.9", "00:00:00.1"], 0.2),
        (["3/1/2024 11:59:59 AM", "3/1/2024 12:00:00 PM"], 1.0),
        (["12:00:00:123", "12:00:00:125"], 0.002),
        (["30/03/2025 10:00:00.5", "30/03/2025 10:00:01.5"], 1.0),
        (["03/05/2024 23:59:59.5", "04/05/2024 00:00:00.5"], 1.0),  # the order in which they follow closely
        (["15-Jan-2024 23:59:59.5", "16-Jan-2024 00:00:00.5"], 1.0),
        (["20240115 10:00:00", "20240115 10:00:01"], 1.0),
        (["01:59.999", "02:00.001"], 0.002),
    ],
)
def test_dates_and_times_of_day_are_seconds(texts: list[str], seconds: float) -> None:
    assert is_date(texts[0])
    assert np.diff(seconds_of(texts))[0] == pytest.approx(seconds, abs=1e-9)


@pytest.mark.parametrize("text", ["", "1.5", "OK", "2024-03-01", "12"])
def test_other_texts_are_no_dates(text: str) -> None:
    assert not is_date(text)
