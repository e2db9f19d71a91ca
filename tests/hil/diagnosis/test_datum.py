"""Nobody knows the datum of a linear encoder: where its zero lies says nothing about the axis."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.compare import compare
from hil.diagnosis.model import Model, Term
from hil.diagnosis.preflight import prepare

OWNER = bench()
PLAY = Term("backlash", 0, (20e-6,))


@pytest.mark.parametrize("shift_m", [3e-6, -50e-6, 0.4])
@pytest.mark.parametrize("terms", [(), (PLAY,), (Term("table_side_friction", 0, (0.4,)),)])
def test_residuals_are_the_same_wherever_its_zero_lies(shift_m: float, terms: tuple[Term, ...]) -> None:
    recording = recorded(OWNER, PLAY)
    shifted = changed(recording, table_position_m=recording["table_position_m"] + shift_m)
    model = Model(OWNER, terms)
    known, moved = (model.residuals(model.initial(), prepare([run], OWNER)) for run in (recording, shifted))
    np.testing.assert_allclose(moved, known, atol=1e-3 * np.std(known))


def test_the_comparison_takes_it_off_and_says_so() -> None:
    recording = recorded(OWNER)
    shifted = changed(recording, table_position_m=recording["table_position_m"] + 50e-6)
    before, after = compare(recording, OWNER), compare(shifted, OWNER)
    for one, other in zip(before.channels, after.channels, strict=True):
        assert other.rms == pytest.approx(one.rms, rel=1e-6, abs=1e-12)
    assert any("datum" in note and "50 µm" in note for note in after.notes)


@pytest.mark.parametrize("term", [
    Term("periodic_lead_error", 0, (5e-6, 1.0, 0.0, 0.0, 0.0, 0.0)), Term("spring_load", 0, (5e3, 0.05)),
    Term("backlash", 0, (20e-6,)), Term("preload_loss", 0, (10e-6, 0.4))])
def test_an_axis_that_stands_has_stood_before(term: Term) -> None:
    """The twin begins at rest under whatever bends the transmission, it does not spring there."""
    model = Model(OWNER, (Term("external_force", 0, (200.0, 0.0, 10.0)), term))
    still = np.zeros(300)
    answer = model.twin(model.initial()).simulate(still, still)
    assert np.ptp(answer.table_position_m) < 2e-9
