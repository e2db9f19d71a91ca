"""What recordings leave open: rivals that they do not separate, and mechanisms that they cannot show."""

from __future__ import annotations

from typing import Any

import pytest
from example_result import EXAMPLE

from hil.diagnosis.open_questions import cannot_show, no_experiment
from hil.diagnosis.result import Result
from hil.diagnosis.statement import statement
from hil.diagnosis.wording import named
from hil.twin.library import LIBRARY

(FOUND,) = EXAMPLE["missing"]


def result(**changes: Any) -> Result:
    return Result.model_validate(EXAMPLE | changes)


def alone(**changes: Any) -> Result:
    """A finding without an equal rival."""
    return result(missing=(FOUND | {"equivalents": ()},), **changes)


def test_a_verdict_names_the_equal_rival_beside_the_finding() -> None:
    assert "lost motion (or preload loss: these recordings do not separate them)." in statement(result())
    assert named(result().missing[0]) == "backlash or preload loss"
    assert "do not separate" not in statement(alone())


def test_a_perhaps_names_the_equal_rival_too() -> None:
    sure = FOUND | {"effect": "cogging_torque", "equivalents": (), "confidence": 0.95}
    told = statement(result(missing=(sure, FOUND | {"confidence": 0.2})))
    assert "Perhaps also backlash or preload loss (20.0 %)." in told


def test_a_question_is_open_beside_an_equal_rival() -> None:
    told = no_experiment(result())
    assert told.startswith("Open: these recordings do not separate backlash from preload loss.")
    assert "known control law" in told


@pytest.mark.parametrize(("hidden", "told"), [((), "No question is open"), (("thermal_growth",), "No other cause")])
def test_without_a_rival_only_hidden_mechanisms_are_open(hidden: tuple[str, ...], told: str) -> None:
    assert no_experiment(alone(not_testable=hidden)).startswith(told)


def test_without_findings_hidden_mechanisms_are_open() -> None:
    nothing = {"verdict": "no_mismatch", "missing": ()}
    assert no_experiment(result(**nothing)).startswith("None was designed")
    assert no_experiment(result(**nothing, not_testable=())).startswith("No question is open")


def test_an_ended_search_is_the_reason_of_no_design() -> None:
    budget = {"budget_s": 10.0, "stopped_before": "fitting", "not_tried": ()}
    assert "time budget" in no_experiment(alone(time_budget=budget))


def test_hidden_mechanisms_are_told_by_their_number_with_an_example_of_a_block() -> None:
    hidden = ("transport_delay", "torque_dead_zone", "cogging_torque", "constant_load", "backlash", "gravity_torque")
    assert cannot_show(result(not_testable=hidden)) == (
        f"This motion cannot show 6 of {len(LIBRARY)} mechanisms, such as transport delay, cogging torque and backlash."
    )
    assert cannot_show(result(not_testable=())) == ""
