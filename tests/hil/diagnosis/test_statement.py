"""The verdict as one sentence, where nothing is named."""

from __future__ import annotations

from typing import Any

from example_result import EXAMPLE

from hil.diagnosis.result import AT_FLOOR, CLOCK, NO_STRUCTURE, Result
from hil.diagnosis.statement import statement
from hil.twin.library import LIBRARY

TORQUE = {"owner": 0.0587, "refitted": 0.0569, "final": 0.0587, "plain": 0.0586}
TIME = {
    "channel": "torque",
    "over": "time",
    "share": 0.07,
    "by_chance": 7e-4,
    "text": "the axis needs 2.94 mN m more torque than the twin at a time of 4.80 to 9.53 s (by chance 0.0007)",
}
NOTHING = EXAMPLE | {"missing": (), "parameter_corrections": {}, "unexplained": {"description": AT_FLOOR, "share": 0.0}}


def said(**changes: Any) -> str:
    return statement(Result.model_validate(NOTHING | changes))


def test_an_all_clear_says_what_is_left_and_what_the_motion_cannot_show() -> None:
    assert said(verdict="no_mismatch", torque_left=TORQUE) == (
        "Nothing is missing that these recordings show: the twin leaves 5.87 % of the torque on held-out motion "
        "unexplained, plain least squares 5.86 %, without a structure. This motion cannot show 1 of "
        f"{len(LIBRARY)} mechanisms, such as thermal growth."
    )
    told = said(verdict="no_mismatch", torque_left=TORQUE | {"final": 0.0065, "plain": 0.0046})
    assert "plain least squares 0.460 % (right models differ by up to 0.500 %), without a structure. This" in told
    assert said(verdict="no_mismatch", not_testable=()) == (
        "The twin reproduces these recordings to within their noise."
    )


def test_the_moment_of_a_change_is_told_beside_a_stronger_structure() -> None:
    left = {"description": "Residuals above the noise (rms): torque 3.00 times.", "share": 0.5}
    moment = TIME | {"over": "moment", "text": "from 3.54 s on the Coulomb friction is 0.169 N m smaller than before"}
    told = said(verdict="unexplained", unexplained=left, structure=(TIME, TIME | {"over": "speed"}, moment))
    assert told.endswith(f"Structure is left: {TIME['text']}; {moment['text']}.")


def test_what_is_below_the_noise_of_a_row_is_no_mismatch_above_it() -> None:
    told = said(verdict="unexplained", structure=(TIME,))
    assert told == f"No named physics is missing; below the noise of a row, {TIME['text']}."


def test_without_a_structure_the_torque_tells_why_it_is_not_explained() -> None:
    told = said(verdict="unexplained", torque_left=TORQUE)
    assert told.startswith("No named physics is missing; every channel is within its noise, and the twin leaves 5.87 %")
    assert said(verdict="unexplained").endswith("every channel is within its noise.")


def test_noise_that_wanders_beside_a_name_is_not_called_unexplained() -> None:
    left = f"Residuals above the noise (rms): motor position 3.16 times in 3 of 17 recordings or parts {NO_STRUCTURE}."
    wanders = said(missing=EXAMPLE["missing"], unexplained={"description": left, "share": 0.0})
    assert f"{left.removesuffix('.')}: noise that wanders, or a random disturbance." in wanders
    assert "Not explained" not in wanders
    both = left.replace("motor position", "table position 2.00 times, motor position")
    assert "Not explained: residuals" in said(
        missing=EXAMPLE["missing"], unexplained={"description": both, "share": 0.3}
    )


def test_residuals_above_the_noise_are_a_mismatch() -> None:
    left = {"description": "Residuals above the noise (rms): torque 3.00 times.", "share": 0.5}
    told = said(verdict="unexplained", unexplained=left, structure=(TIME,))
    assert told.startswith("The mismatch is not explained by any mechanism of the library: Residuals above the noise")
    assert f"Structure is left: {TIME['text']}." in told


def test_clocks_that_run_apart_are_told_first() -> None:
    left = {"description": "Residuals above the noise (rms): motor position 2.47 times.", "share": 1.0}
    apart = TIME | {"over": CLOCK, "text": "the clocks of torque and position run apart by 186 ppm"}
    told = said(verdict="unexplained", unexplained=left, structure=(TIME, apart))
    assert told.startswith("The clocks of torque and position run apart by 186 ppm. The mismatch is not explained by")
    assert told.count("186 ppm") == 1
    assert f"Structure is left: {TIME['text']}." in told


def test_a_part_of_the_mismatch_is_told_with_its_share() -> None:
    left = {"description": "Residuals above the noise (rms): table position 3.71 times.", "share": 0.68}
    told = said(verdict="unexplained", unexplained=left, partial=EXAMPLE["missing"])
    assert told.startswith("No mechanism of the library explains the whole mismatch. For 32.0 % of its energy above")


def test_a_search_that_ended_says_what_is_below_the_noise() -> None:
    budget = {"budget_s": 10.0, "stopped_before": "fitting", "not_tried": ()}
    told = said(verdict="unexplained", structure=(TIME,), time_budget=budget)
    assert told == f"The time budget ended before the mismatch was explained; below the noise of a row, {TIME['text']}."


def test_parameters_that_are_only_better_together_are_told_by_the_torque() -> None:
    within = {"x": {"nominal": 1.0, "value": 1.01, "std": 0.01, "unit": "kg"}}
    told = said(verdict="parameter_error", parameter_corrections=within, torque_left=TORQUE | {"final": 0.0132})
    assert (
        "none of them is surely wrong by itself. The torque left on held-out motion is 1.32 %, by the bench file"
        in told
    )
    assert "This motion cannot show 1 of" in told
