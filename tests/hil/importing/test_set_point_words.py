"""Words for set-points and stamps that are parts of other words, or mean another thing beside a word more."""

from __future__ import annotations

import pytest

from hil.importing.column_names import label
from hil.importing.lexicon import Quantity


@pytest.mark.parametrize("name", ["RPOS(0)[mm]", "RVEL(0)", "Profile Position (counts)", "s nominal [mm]"])
def test_words_of_drives_for_a_set_point_are_known(name: str) -> None:
    assert label(name).command


@pytest.mark.parametrize("name", ["motorposition_rad", "motorvelocity", "encoderpos", "carvel", "halfpos"])
def test_they_are_no_part_of_a_longer_word(name: str) -> None:
    assert not label(name).command
    assert not label(name).measured


@pytest.mark.parametrize("name", ["Profile Position Actual [mm]", "torque % of nominal", "Nominal current [A]"])
def test_what_is_measured_or_in_parts_of_a_rating_is_no_set_point(name: str) -> None:
    assert not label(name).command


@pytest.mark.parametrize(("name", "is_time"), [("ts", True), ("Ts", True), ("ts_torque", False), ("pos_ts", False)])
def test_ts_is_a_time_if_it_is_the_whole_name(name: str, is_time: bool) -> None:
    assert (label(name).quantity is Quantity.TIME) == is_time
