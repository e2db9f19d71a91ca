"""Weights and friction beside what the bench knows of them, and weights heavier than any friction."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, fitted, recorded

from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.search import forward_selection
from hil.diagnosis.search.initial_values import claimable
from hil.diagnosis.search.score_test import screen_library
from hil.identification.dataset import prepare_dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term

OWNER = bench()
COULOMB_N_M = OWNER.axis.physics().coulomb_n_m


def knowing(effect: str, parameter: str, value: float) -> Bench:
    """The bench with a mechanism that its owner knows of."""
    return OWNER.model_copy(update={"mechanisms": (MechanismEntry(effect=effect, parameters={parameter: value}),)})


@pytest.mark.parametrize(
    ("effect", "parameter"), [("constant_load", "load_torque_n_m"), ("asymmetric_friction", "offset_torque_n_m")]
)
def test_a_load_that_is_known_too_small_is_corrected_not_doubled(effect: str, parameter: str) -> None:
    truth = Term("constant_load", 0, (0.8,))
    found = diagnose([recorded(OWNER, truth)], [recorded(OWNER, truth, seed=2)], knowing(effect, parameter, 0.3))
    assert [one.effect for one in found.result.missing] == [effect]
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
    assert lead.term.values[0] == pytest.approx(0.15, rel=0.1)
    found = diagnose(train, [recorded(OWNER, truth, seed=2)], owner)
    assert [one.effect for one in found.result.missing] == ["asymmetric_friction"]
    (entry,) = found.bench.mechanisms
    assert (entry.effect, entry.variant) == ("asymmetric_friction", "with speed")
    assert entry.parameters["offset_torque_n_m"] == pytest.approx(0.15, rel=0.02)


def test_a_weight_above_coulomb_friction_is_no_friction() -> None:
    assert claimable(Term("asymmetric_friction", 0, (-0.9 * COULOMB_N_M,)), OWNER)
    assert not claimable(Term("asymmetric_friction", 0, (1.1 * COULOMB_N_M,)), OWNER)
    assert claimable(Term("constant_load", 0, (3.0 * COULOMB_N_M,)), OWNER)


@pytest.mark.parametrize(("rest_m", "spring"), [(0.4, True), (-3.0, True), (-9.5, False), (10.0, False)])
def test_a_spring_that_rests_out_of_reach_is_a_load(rest_m: float, spring: bool) -> None:
    assert claimable(Term("spring_load", 0, (20.0, rest_m)), OWNER) is spring


def test_a_spring_that_a_later_fit_moves_out_of_reach_goes() -> None:
    lag = Term("current_loop_lag", 0, (1e-3,))
    runs = [take(recorded(OWNER, Term("constant_load", 0, (0.8,)), lag), OWNER)]
    ratio_m_rad = OWNER.axis.ratio_m_rad
    spring = Term("spring_load", 0, (0.8 / ratio_m_rad / 8.0, -8.0))
    assert claimable(spring, OWNER)
    found = fitted(Hypothesis(OWNER, (spring, lag)), runs)
    (out_of_reach, _) = found.terms
    assert not claimable(out_of_reach, OWNER)
    assert [term.effect for term in forward_selection.claimed(found).terms] == ["current_loop_lag"]


@pytest.mark.parametrize(
    ("frequency_hz", "structure"), [(120.0, True), (1700.0, True), (1900.0, False), (2000.0, False)]
)
def test_a_structure_that_sways_as_fast_as_can_be_is_a_mass(frequency_hz: float, structure: bool) -> None:
    assert claimable(Term("structural_mode", 0, (frequency_hz, 0.05, 0.3)), OWNER) is structure
