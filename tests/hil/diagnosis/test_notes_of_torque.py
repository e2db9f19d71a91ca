"""The note on a twin whose torque plain least squares beats."""

from __future__ import annotations

import pytest

from hil.diagnosis.notes import on_torque
from hil.diagnosis.result import TorqueLeft


@pytest.mark.parametrize(("final", "told"), [(0.30, True), (0.10, False), (None, False)])
def test_a_twin_that_plain_least_squares_beats_is_told(final: float | None, told: bool) -> None:
    notes = on_torque(TorqueLeft(owner=0.5, refitted=0.4, final=final, plain=0.10))
    assert bool(notes) is told
    assert not told or ("30.0 %" in notes[0] and "10.0 %" in notes[0])


def test_without_a_plain_model_nothing_is_said() -> None:
    assert on_torque(None) == []
