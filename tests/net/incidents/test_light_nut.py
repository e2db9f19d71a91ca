"""Play on a light nut, whose chain chatters, beside wrong springs."""

from __future__ import annotations

import pytest
from diagnosis_runs import recorded

from hil.bench.bench_file import load_bench
from hil.diagnosis.diagnose import diagnose
from hil.identification.terms import Term

pytestmark = pytest.mark.net


def test_play_on_a_light_nut_beside_wrong_springs() -> None:
    """The nut of the 7-dof chain chatters in 5 um; the owner's spring is too stiff, the table too light."""
    owner = load_bench("reference_7dof")
    axis = owner.axis
    true = {
        "nut_support_stiffness_n_m": 0.75 * axis.nut_support_stiffness_n_m,
        "table_mass_kg": 1.2 * axis.table_mass_kg,
    }
    truth = owner.model_copy(update={"axis": axis.model_copy(update=true)})
    play = Term("backlash", 1, (5e-6,))
    found = diagnose([recorded(truth, play, times=2)], [recorded(truth, play, seed=2)], owner)
    assert [one.effect for one in found.result.missing] == ["backlash"]
    assert found.result.missing[0].parameters["gap_m"].value == pytest.approx(5e-6, rel=0.05)
