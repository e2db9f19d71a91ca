"""What a finding improves: nothing is said to fall that was within its noise before."""

from __future__ import annotations

import pytest
from example_result import EXAMPLE

from hil.diagnosis.improvement import improvement
from hil.diagnosis.ledger import SHAPE
from hil.diagnosis.result import Result


def result(before: float, after: float, noise: float, **more: object) -> Result:
    figures = {"before_rms": before, "after_rms": after, "noise_floor_rms": noise, "owner_rms": None}
    fit = {"motor_position_rad": EXAMPLE["fit"]["torque_n_m"] | {"unit": "rad", "train": figures, "validate": figures}}
    return Result.model_validate(EXAMPLE | {"fit": fit} | more)


def shape(chance: float, named: bool = True, accepted: bool = True) -> dict[str, object]:
    rule = {"rule": SHAPE, "accepted": accepted, "text": "", "figures": {"chance": chance}}
    return {"effect": "backlash", "named": named, "rules": (rule,)}


TORQUE = {"owner": 0.15, "refitted": 0.142, "final": 0.131, "plain": 0.14}


def test_a_residual_above_its_noise_falls_to_it() -> None:
    assert improvement(result(9e-3, 1e-3, 1e-3)).endswith("falls from 9.00 mrad rms to its noise.")
    assert improvement(result(9e-3, 9.001e-3, 1e-3)).endswith("stays at 9.00 mrad rms.")
    assert improvement(result(9e-3, 9.1e-3, 1e-3)).endswith("does not fall: 9.10 mrad instead of 9.00 mrad rms.")


def test_of_a_residual_below_its_noise_the_torque_is_told() -> None:
    told = improvement(result(3.32e-3, 3.30e-3, 9.14e-3, torque_left=TORQUE))
    assert told == "With it the torque left unexplained on held-out motion falls from 14.2 to 13.1 %."


def test_a_shape_below_the_noise_is_told_by_its_chance() -> None:
    told = improvement(result(3.32e-3, 3.30e-3, 9.14e-3, considered=(shape(1e-9),)))
    assert told == "Its effect is below the noise of one row, and clear from all rows together (by chance 1e-09)."
    both = improvement(result(3.32e-3, 3.30e-3, 9.14e-3, torque_left=TORQUE, considered=(shape(1e-20),)))
    assert both.endswith(
        "to 13.1 %; its effect is below the noise of one row, and clear from all rows together "
        "(by chance less than 1e-12)."
    )


@pytest.mark.parametrize("asked", [shape(1e-9, named=False), shape(0.4, accepted=False)])
def test_a_shape_of_another_candidate_or_a_refuted_one_is_not_told(asked: dict[str, object]) -> None:
    told = improvement(result(3.32e-3, 3.30e-3, 9.14e-3, considered=(asked,)))
    assert told == "Without it every residual was within its noise, too."


def test_a_torque_that_falls_by_less_than_its_digits_does_not_fall() -> None:
    same = TORQUE | {"final": 0.14199}
    assert "falls" not in improvement(result(3.32e-3, 3.30e-3, 9.14e-3, torque_left=same))


def test_of_several_channels_the_one_above_its_noise_is_told() -> None:
    """A quiet channel falls by more, and says nothing."""
    quiet = {"before_rms": 1e-3, "after_rms": 1e-5, "noise_floor_rms": 9e-3, "owner_rms": None}
    loud = {"before_rms": 4e-5, "after_rms": 2e-5, "noise_floor_rms": 1e-5, "owner_rms": None}
    entry = EXAMPLE["fit"]["torque_n_m"]
    fit = {
        name: entry | {"unit": unit, "train": figures, "validate": figures}
        for name, unit, figures in (("motor_position_rad", "rad", quiet), ("table_position_m", "m", loud))
    }
    told = improvement(Result.model_validate(EXAMPLE | {"fit": fit}))
    assert "table position on held-out recordings falls from 40.0 µm to 20.0 µm rms; its noise is 10.0 µm" in told
