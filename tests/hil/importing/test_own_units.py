"""Numbers of an unknown unit count as they are; what is no matter of size is asked still."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, renamed, write

from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_text import asked_lines, map_text
from hil.importing.own_units import take_own_units
from hil.importing.still_open import still_open


def imported(folder: Path, **names: str) -> tuple[dict[str, np.ndarray], list[str], list[str]]:
    """Channels of a table with these names by its own units, the notes, and the questions that stay."""
    source = write(folder / "axis.csv", renamed(axis(), **names))
    draft = draft_map(source)
    take_own_units(draft)
    text = map_text(draft)
    asked = [question for _, question in asked_lines(text)]
    if asked:
        return {}, draft.unsure, asked
    path = folder / "map.yaml"
    path.write_text(text)
    return import_recording(source, path).columns, draft.unsure, []


@pytest.mark.parametrize("name", ["torque", "current_A", "torque_pct"])
def test_an_effort_counts_as_its_own_numbers(tmp_path: Path, name: str) -> None:
    columns, notes, asked = imported(tmp_path, t="t", angle="angle_rad", torque=name)
    assert not asked
    assert columns["torque_n_m"] == pytest.approx(axis()["torque"], abs=1e-6)
    assert any("torque_n_m: its numbers count as N m" in note for note in notes)


def test_a_position_counts_as_its_own_numbers(tmp_path: Path) -> None:
    columns, notes, asked = imported(tmp_path, t="t", angle="encoder_counts", torque="torque_Nm")
    assert not asked
    (position,) = (values for name, values in columns.items() if name.startswith("motor_position"))
    assert position == pytest.approx(axis()["angle"], abs=1e-6)
    assert any("its numbers count as" in note for note in notes)


def test_without_a_lead_the_motor_is_told_in_multiples(tmp_path: Path) -> None:
    columns, notes, asked = imported(tmp_path, t="t", x_act="x_act_mm", torque="torque_Nm")
    assert not asked
    travel = 1e-3 * axis()["x_act"]
    assert columns["motor_position_rad"] == pytest.approx(2.0 * np.pi * travel / 0.010, abs=1e-6)
    assert any(note.startswith("lead_m: its numbers count as turns of 10 mm") for note in notes)


def test_a_lead_that_is_corrected_is_no_doubt(tmp_path: Path) -> None:
    draft = draft_map(write(tmp_path / "axis.csv", renamed(axis(), t="t", x_act="x_act_mm", torque="torque_Nm")))
    take_own_units(draft)
    text = map_text(draft)
    assert "0.01   # m per revolution of the motor; taken, as nothing tells it" in text
    assert any(note.startswith("lead_m: ") for note in still_open(draft, text))
    assert not any(
        note.startswith("lead_m: ") for note in still_open(draft, text.replace("lead_m: 0.01 ", "lead_m: 0.005 "))
    )


def test_a_value_beside_its_question_answers_it() -> None:
    text = "lead_m:   # <-- write: the metres per revolution\nchannels:\n    unit:   # <-- write: the unit\n"
    assert [line for line, _ in asked_lines(text)] == [1, 3]
    assert asked_lines(text.replace("lead_m:  ", "lead_m: 0.2  "))[0][0] == 3
