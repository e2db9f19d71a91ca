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
    assert found.result.verdict == "parameter_error"
    assert not found.result.missing
    corrected = found.result.parameter_corrections[f"{effect}.{parameter}"]
    assert (corrected.nominal, corrected.unit) == (0.3, "N m")
    assert corrected.value == pytest.approx(0.8, rel=0.01)
    assert f"{effect}.{parameter} +" in found.result.statement
    (entry,) = found.bench.mechanisms
    assert entry.effect == effect
    assert entry.parameters[parameter] == pytest.approx(0.8, rel=0.01)


def test_values_of_known_mechanisms_are_fitted_and_numbered() -> None:
    """Two of one effect: the second one's values have its number; an event is not fitted."""
    entries = (
        MechanismEntry(effect="periodic_lead_error", parameters={"amplitude_m": 3e-6, "phase_rad": 0.1}),
        MechanismEntry(
            effect="cogging_torque", parameters={"amplitude_n_m": 0.1, "cycles_per_rev": 6.0, "phase_rad": 0.0}
        ),
        MechanismEntry(
            effect="cogging_torque", parameters={"amplitude_n_m": 0.2, "cycles_per_rev": 12.0, "phase_rad": 0.0}
        ),
        MechanismEntry(effect="external_force", parameters={"force_n": 5.0, "start_s": 1.0, "end_s": 2.0}),
    )
    hypothesis = Hypothesis(OWNER.model_copy(update={"mechanisms": entries}))
    known = hypothesis.nominal[len(OWNER.axis.NOMINAL) :]
    assert {"cogging_torque.amplitude_n_m", "cogging_torque_2.amplitude_n_m"} <= set(known)
    assert len(known) == 8
    assert hypothesis.values == pytest.approx(hypothesis.bench_values)
    names = list(hypothesis.nominal)
    x = hypothesis.x.copy()
    x[names.index("cogging_torque_2.amplitude_n_m")] *= 1.5
    changed = hypothesis.moved(x).resolved.bench.mechanisms
    assert changed[2].parameters["amplitude_n_m"] == pytest.approx(0.3)
    assert [one.active() for one in (*changed[:2], changed[3])] == [one.active() for one in (*entries[:2], entries[3])]


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


def test_a_weight_above_coulomb_friction_is_no_friction() -> None:
    assert claimable(Term("asymmetric_friction", 0, (-0.9 * COULOMB_N_M,)), OWNER)
    assert not claimable(Term("asymmetric_friction", 0, (1.1 * COULOMB_N_M,)), OWNER)
    assert claimable(Term("constant_load", 0, (3.0 * COULOMB_N_M,)), OWNER)


@pytest.mark.parametrize(("rest_m", "spring"), [(0.4, True), (-3.0, True), (-9.5, False), (10.0, False)])
def test_a_spring_that_rests_out_of_reach_is_a_load(rest_m: float, spring: bool) -> None:
    assert claimable(Term("spring_load", 0, (20.0, rest_m)), OWNER) is spring


def test_a_spring_that_a_later_fit_moves_out_of_reach_becomes_a_load() -> None:
    lag = Term("current_loop_lag", 0, (1e-3,))
    runs = [take(recorded(OWNER, Term("constant_load", 0, (0.8,)), lag), OWNER)]
    ratio_m_rad = OWNER.axis.ratio_m_rad
    spring = Term("spring_load", 0, (0.8 / ratio_m_rad / 8.0, -8.0))
    assert claimable(spring, OWNER)
    found = fitted(Hypothesis(OWNER, (spring, lag)), runs)
    (out_of_reach, _) = found.terms
    assert not claimable(out_of_reach, OWNER)
    load, other = forward_selection.claimed(found).terms
    assert (load.effect, other.effect) == ("constant_load", "current_loop_lag")
    assert load.values == pytest.approx((0.8,), rel=0.02)


@pytest.mark.parametrize(
    ("frequency_hz", "structure"), [(120.0, True), (1700.0, True), (1900.0, False), (2000.0, False)]
)
def test_a_structure_that_sways_as_fast_as_can_be_is_a_mass(frequency_hz: float, structure: bool) -> None:
    assert claimable(Term("structural_mode", 0, (frequency_hz, 0.05, 0.3)), OWNER) is structure


def test_friction_that_falls_with_speed_is_named_beside_a_large_weight() -> None:
    truth = Term("constant_load", 0, (4.0,)), Term("stribeck_friction", 0, (1.4, 2.0))
    found = diagnose([recorded(OWNER, *truth)], [recorded(OWNER, *truth, seed=2)], OWNER)
    assert {one.effect for one in found.result.missing} == {"constant_load", "stribeck_friction"}
    falling = next(one for one in found.result.missing if one.effect == "stribeck_friction")
    assert [entry.value for entry in falling.parameters.values()] == pytest.approx([1.4, 2.0], rel=0.05)
