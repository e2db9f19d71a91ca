"""The summary of a diagnosis on the terminal."""

from __future__ import annotations

import pytest
from example_result import EXAMPLE

from hil.diagnosis.result import Result
from hil.report.summary import print_diagnosis


def test_a_search_that_ended_names_the_way_on(capsys: pytest.CaptureFixture[str]) -> None:
    budget = {"budget_s": 110.0, "stopped_before": "fitting backlash", "not_tried": ()}
    print_diagnosis(Result.model_validate(EXAMPLE | {"time_budget": budget}))
    told = capsys.readouterr().out
    assert "ended with its time budget of 110 s before fitting backlash" in told
    assert "--budget SECONDS" in told


def test_a_complete_search_says_nothing_of_a_budget_and_names_an_equal_rival(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_diagnosis(Result.model_validate(EXAMPLE))
    told = capsys.readouterr().out
    assert "budget" not in told
    assert "backlash or preload loss" in told


@pytest.mark.parametrize(
    ("std", "told"),
    [
        (1e-6, True),
        (2.5e-5, False),  # more than the size itself
        (0.0, True),
    ],
)
def test_a_size_within_its_error_is_not_told(std: float, told: bool, capsys: pytest.CaptureFixture[str]) -> None:
    finding = EXAMPLE["missing"][0] | {"parameters": {"gap_m": {"value": 2.4e-5, "std": std, "unit": "m"}}}
    print_diagnosis(Result.model_validate(EXAMPLE | {"missing": (finding,)}))
    out = capsys.readouterr().out
    assert ("not told by itself" not in out) is told
    assert ("24.0 µm" in out or "24 µm" in out) is told
