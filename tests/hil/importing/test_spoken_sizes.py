"""Sizes of a count in the words of a README."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, csv_text

from hil.importing.draft_map import draft_map
from hil.importing.spoken_sizes import plain_sizes

AXIS = axis(3000)
RAD = np.pi / 180.0


@pytest.mark.parametrize(
    ("told", "plain"),
    [
        ("in 0.01 deg steps", ", 1 digit = 0.01 deg"),
        ("increments of 0.088 deg", ", 1 digit = 0.088 deg"),
        ("optical scale, counts of 0.1 um (int64)", "optical scale, , 1 digit = 0.1 um (int64)"),
        ("in steps of 10 mA", ", 1 digit = 10 mA"),
        ("current, 10 mA units", "current, , 1 digit = 10 mA"),
        ("in 1/100 A", ", 1 digit = 0.01 A"),
        ("position in 1e-3 mm", "position , 1 digit = 0.001 mm"),
        ("position, deg x 100", "position, , 1 digit = 0.01 deg"),
        ("current, A/100", "current, , 1 digit = 0.01 A"),
        ("angle scaled by 100 (deg)", "angle , 1 digit = 0.01 deg)"),
        ("hundredths of a degree", ", 1 digit = 0.01 degree"),
        ("in milli-degrees", ", 1 digit = 0.001 degree"),
        ("in 0.1 % of the rated torque", ", 0.1 % of the rated torque"),
        ("16384 = rated torque", ", 0.006103515625 % of rated"),
        ("10 V = 3 N m", ", 0.3 N m/V"),
        ("torque per volt: 0,3 Nm", "torque , 0.3 Nm/V"),
        ("2500 lines, x4", "10000 counts per turn"),
        ("2500 ppr quadrature", "10000 counts per turn"),
    ],
)
def test_sizes_in_words_are_phrases_that_are_read(told: str, plain: str) -> None:
    assert plain_sizes(told) == plain


@pytest.mark.parametrize(
    "told",
    [
        "torque in Nm",
        "position in 5 mm",
        "resolution 0.088 deg",
        "10 V = full scale",
        "mode x 10",
        "encoder, 2500 lines",
        "100 % = 1.27 Nm",
        "moves in 20 strange steps",
        "speed in m/s",
        "in 0 deg steps",
        "in 1/0 A",
        "",
    ],
)
def test_other_words_stay_as_they_are(told: str) -> None:
    assert plain_sizes(told) == told


@pytest.mark.parametrize(
    ("position", "turned", "torque", "driven"),
    [
        ("motor position in 0.01 deg steps", 0.01 * RAD, "torque monitor, 10 V = 30 N m", 3.0),
        ("motor encoder, 2500 lines, x4", 2.0 * np.pi / 1e4, "motor torque, 1000 = rated torque", 0.02),
    ],
)
def test_a_map_has_the_size_that_a_readme_says(
    tmp_path: Path, position: str, turned: float, torque: str, driven: float
) -> None:
    volts = " V " in torque
    columns = {"t": AXIS["t"], "pos": np.round(AXIS["angle"] / turned), "trq": AXIS["torque"] / driven}
    if not volts:
        columns["trq"] = np.round(columns["trq"])
    (tmp_path / "log.csv").write_text(csv_text(columns))
    readme = f"Rotary joint. Rated torque 20 Nm.\n\n| t | time in s |\n| pos | {position} |\n| trq | {torque} |\n"
    (tmp_path / "README.md").write_text(readme)
    draft = draft_map(tmp_path / "log.csv", readme=tmp_path / "README.md")
    assert not draft.asked
    entries = {one.channel: one.entry for one in draft.channels}
    moved = entries["motor_position_rad"]
    if "counts_per_rev" in moved:
        assert moved["counts_per_rev"] == pytest.approx(2.0 * np.pi / turned)
    else:
        assert (moved["unit"], moved["scale"]) == ("deg", pytest.approx(turned / RAD))
    drive = entries["torque_n_m"]
    expected = {"unit": "N m", "scale": driven} if volts else {"unit": "permille", "rated": 20.0}
    assert {key: drive[key] for key in expected} == expected
