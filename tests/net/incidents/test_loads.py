"""Weights and friction beside what the bench knows of them."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, recorded

from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.search.score_test import screen_library
from hil.identification.dataset import prepare_dataset
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term

pytestmark = pytest.mark.net

OWNER = bench()


def knowing(effect: str, parameter: str, value: float) -> Bench:
    """The bench with a mechanism that its owner knows of."""
    return OWNER.model_copy(update={"mechanisms": (MechanismEntry(effect=effect, parameters={parameter: value}),)})


@pytest.mark.parametrize(
    ("effect", "parameter"), [("constant_load", "load_torque_n_m"), ("asymmetric_friction", "offset_torque_n_m")]
)
def test_a_load_that_is_known_too_small_is_corrected_not_doubled(effect: str, parameter: str) -> None:
    truth = Term("constant_load", 0, (0.8,))
    found = diagnose([recorded(OWNER, truth)], [recorded(OWNER, truth, seed=2)], knowing(effect, parameter, 0.3))
    assert found.result.verdict == "parameter_error"
    assert not found.result.missing
    corrected = found.result.parameter_corrections[f"{effect}.{parameter}"]
    assert (corrected.nominal, corrected.unit) == (0.3, "N m")
    assert corrected.value == pytest.approx(0.8, rel=0.01)
    assert f"{effect}.{parameter} +" in found.result.statement
    (entry,) = found.bench.mechanisms
    assert entry.effect == effect
    assert entry.parameters[parameter] == pytest.approx(0.8, rel=0.01)


def test_another_law_takes_the_place_of_what_is_known() -> None:
    """Friction that differs the more the faster, where the owner knows of a difference that is alike at every speed."""
    truth = Term("asymmetric_friction", 1, (0.15,))
    owner = knowing("asymmetric_friction", "offset_torque_n_m", 0.2)
    train = [recorded(OWNER, truth)]
    lead = screen_library(fit_nominal_parameters(prepare_dataset([take(train[0], owner)], owner)))[0]
    assert (lead.term.effect, lead.term.variant) == ("asymmetric_friction", 1)
    assert lead.share > 0.7
    found = diagnose(train, [recorded(OWNER, truth, seed=2)], owner)
    assert [one.effect for one in found.result.missing] == ["asymmetric_friction"]
    (entry,) = found.bench.mechanisms
    assert (entry.effect, entry.variant) == ("asymmetric_friction", "with speed")
    assert entry.parameters["offset_torque_n_m"] == pytest.approx(0.15, rel=0.02)


def test_friction_that_falls_with_speed_is_named_beside_a_large_weight() -> None:
    truth = Term("constant_load", 0, (4.0,)), Term("stribeck_friction", 0, (1.4, 2.0))
    found = diagnose([recorded(OWNER, *truth)], [recorded(OWNER, *truth, seed=2)], OWNER)
    assert {one.effect for one in found.result.missing} == {"constant_load", "stribeck_friction"}
    falling = next(one for one in found.result.missing if one.effect == "stribeck_friction")
    assert [entry.value for entry in falling.parameters.values()] == pytest.approx([1.4, 2.0], rel=0.05)
