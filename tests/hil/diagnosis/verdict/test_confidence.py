"""Confidence grows with what speaks for a name."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hil.diagnosis.verdict.confidence import confidence

LEFT, FACTORS, MARGINS = st.floats(0.0, 1e3), st.floats(0.0, 1e6), st.floats(-1e3, 1e7)
MISSED = st.floats(0.0, 10.0)


@given(LEFT, FACTORS, MARGINS, MISSED, LEFT, FACTORS, MARGINS, MISSED)
def test_confidence_grows_with_each_thing_that_speaks_for_a_name(
    left: float, factor: float, margin: float, missed: float, less: float, more: float, clearer: float, fewer: float
) -> None:
    low = confidence(left, factor, margin, missed)
    assert 0.0 <= low <= 1.0
    assert confidence(min(left, less), max(factor, more), max(margin, clearer), min(missed, fewer)) >= low


def test_confidence_tells_a_sure_name_from_a_guess() -> None:
    assert confidence(1.0, 10.0, 1e4) > 0.95
    assert confidence(1.0, 1.01, 1e4) < 0.8
    assert confidence(1.6, 1.05, 1e4) < 0.8
    assert confidence(8.0, 1.05, 1e4) < 0.2
    assert confidence(8.0, 46.0, 1e4) > 0.95  # there, though much is left unexplained
    assert confidence(1.0, 10.0, 10.0) < confidence(1.0, 10.0, 1e3)


def test_on_an_axis_that_is_half_described_no_name_of_little_gain_is_sure() -> None:
    assert confidence(1.0, 10.0, 1e4, missed=0.005) > 0.95
    assert confidence(1.0, 1.5, 1e4, missed=0.5) < 0.85 < 0.98 < confidence(1.0, 1e3, 1e4, missed=0.5)
    assert confidence(1.0, 1e3, 1e4, missed=float("inf")) == 0.0
