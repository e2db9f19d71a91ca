"""Where a structure is left, in words."""

from __future__ import annotations

import numpy as np
import pytest

from hil.diagnosis.questions import Question
from hil.diagnosis.structure_left import TORQUE, Dependence
from hil.identification.structure import Structure


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (1.0, 2.0, "1.00 to 2.00 s moving backwards"),
        (11.0, 12.0, "1.00 to 2.00 s moving forwards"),
        (9.0, 10.5, "9.00 to 10.0 s moving backwards"),  # mostly before the end of the way down
        (9.8, 11.0, "0 to 1.00 s moving forwards"),
    ],
)
def test_a_range_lies_within_one_direction(low: float, high: float, said: str) -> None:
    question = Question("time", "s", "m", (), by_direction=10.0)
    found = Structure(np.array([low, high]), np.array([0.2]), np.array([0.01]), 0.04, 1e-6)
    text = Dependence(TORQUE, question, found, 0.5, 2.0, None).in_words("N m")
    assert text.startswith("the axis needs 0.200 N m more torque than the twin")
    assert said in text


def test_a_load_is_told_as_it_is_in_each_direction() -> None:
    question = Question("load", "N m", "m", (), by_direction=4.0, least=-1.0)
    found = Structure(np.array([6.0, 6.5]), np.array([0.2]), np.array([0.01]), 0.04, 1e-6)
    text = Dependence(TORQUE, question, found, 0.5, 2.0, None).in_words("N m")
    assert "at a load of 1.00 to 1.50 N m moving forwards" in text
