"""A README tells the travel per turn of the motor by a wheel and its gear."""

from __future__ import annotations

from math import pi
from pathlib import Path

import pytest
from foreign_axis import axis, write

from hil.importing.draft_map import draft_map
from hil.importing.header_values import HeaderValue
from hil.importing.wheel_told import travel_told


@pytest.mark.parametrize(
    ("text", "lead_m"),
    [
        ("Servo motor -> gearbox 8:1 -> toothed pulley (pitch radius 31.8 mm) -> carriage.", 2e-3 * pi * 31.8 / 8.0),
        ("- pinion 200 mm travel per revolution, gearbox 10:1", 0.02),
        ("One motor, planetary gear 10:1, pinion pitch diameter 40 mm on a straight rack.", 4e-3 * pi),
        ("pulley 150 mm per rev, planetary gear i = 5 between motor and pulley.", 0.03),
        ("* pinion pitch circle 80.00 mm, gearbox 10:1, play free", 8e-3 * pi),
        ("Ritzel Teilkreisdurchmesser 63,66 mm, Getriebe 5:1", 63.66e-3 * pi / 5.0),
        ("Riemenscheibe 30 Zähne, Teilung 5 mm, Motor direkt", 0.15),
        ("* belt pulley 120 mm per turn, motor flanged directly to it (no gear)", 0.12),
    ],
)
def test_wheel_and_gear_make_the_travel(text: str, lead_m: float) -> None:
    found = travel_told(text.splitlines())
    assert found is not None
    assert found.value == pytest.approx(lead_m)


@pytest.mark.parametrize(
    "text",
    [
        "Rack and pinion, gearbox 10:1.",
        "pinion 200 mm per turn, gear 10:1 on axis X, gear 7:1 on axis Y",
        "pulley radius 40 mm, idler pulley radius 30 mm",
        "pinion module 2 mm, face width 20 mm",
        "the pulley stands 300 mm from the motor",
        "pulley 0 mm per turn",
        "belt 25 mm wide, pulley with flanges",
    ],
)
def test_other_sentences_tell_none(text: str) -> None:
    assert travel_told(text.splitlines()) is None


def test_the_travel_of_a_wheel_is_none_of_the_motor() -> None:
    text = ["pulley radius 40 mm, gear 4:1"]
    of_wheel, of_motor = HeaderValue(0.08 * pi, "of the wheel"), HeaderValue(0.0628, "of the motor")
    found = travel_told(text, of_wheel)
    assert found is not None
    assert found.value == pytest.approx(0.02 * pi)
    assert travel_told(text, of_motor) is of_motor


def test_a_length_is_converted_with_the_wheel_of_a_readme(tmp_path: Path) -> None:
    columns = axis()
    table = {"time_s": columns["t"], "s_mm": 20.0 * columns["angle"] / (2.0 * pi), "torque_Nm": columns["torque"]}
    path = write(tmp_path / "log.csv", table)
    (tmp_path / "README.md").write_text("- pinion 200 mm travel per revolution, gearbox 10:1\n")
    draft = draft_map(path, readme=tmp_path / "README.md")
    assert draft.lead_m == pytest.approx(0.02)
    assert not draft.asked
