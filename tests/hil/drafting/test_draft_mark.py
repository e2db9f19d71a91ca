"""The mark of a drafted bench: whether it was edited, and whether its recordings are others since."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis

from hil.bench.bench_file import load_bench
from hil.drafting.draft_mark import draft_state, marked
from hil.drafting.drafted_bench import drafted
from hil.explanation import OUTDATED, _bench
from hil.recording.recording import Recording


def recording(factor: float = 1.0) -> Recording:
    columns = axis(2500)
    named = {
        "time_s": columns["t"],
        "motor_position_rad": columns["angle"],
        "torque_n_m": factor * columns["torque"],
        "torque_command_n_m": factor * columns["torque"],
    }
    return Recording("axis", named, 1e-3, {"lead_m": 0.01})


def test_a_mark_tells_an_edit_and_another_recording() -> None:
    text = marked("axis:\n  lead_m: 0.01\n", [recording()])
    assert draft_state(text, [recording()]) == (False, False)
    assert draft_state(text.replace("0.01", "0.02"), [recording()]) == (True, False)
    assert draft_state(text, [recording(1.48)]) == (False, True)
    assert draft_state(text, [replace(recording(), metadata={"lead_m": 0.02})]) == (False, True)
    assert draft_state("axis:\n  lead_m: 0.01\n", [recording()]) is None


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A bench drafted from a torque that counts a constant of 1."""
    _, draft, _ = _bench([recording()], tmp_path / "bench.yaml")
    assert draft is not None
    return tmp_path / "bench.yaml"


def test_a_draft_that_nobody_edited_is_kept_as_long_as_its_recordings_are_the_same(path: Path) -> None:
    before = path.read_text()
    bench, draft, notes = _bench([recording()], path)
    assert (draft, path.read_text()) == (None, before)
    assert notes == [f"{path}: used as it is"]
    assert bench == drafted([recording()]).bench


def test_a_draft_that_nobody_edited_follows_a_corrected_map(path: Path) -> None:
    before = load_bench(path).axis.physics().coulomb_n_m
    bench, draft, notes = _bench([recording(1.48)], path)
    assert draft is not None
    assert "drafted anew" in notes[0]
    assert bench.axis.physics().coulomb_n_m == pytest.approx(1.48 * before, rel=1e-3)
    assert load_bench(path) == bench


def test_an_edited_draft_is_kept_and_it_is_told_that_the_map_changed(path: Path) -> None:
    edited = path.read_text() + "# mine\n"
    path.write_text(edited)
    bench, draft, notes = _bench([recording(1.48)], path)
    assert (draft, path.read_text()) == (None, edited)
    assert OUTDATED in notes[0]
    assert np.isfinite(bench.axis.physics().coulomb_n_m)
    assert OUTDATED not in _bench([recording()], path)[2][0]
