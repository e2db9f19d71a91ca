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
