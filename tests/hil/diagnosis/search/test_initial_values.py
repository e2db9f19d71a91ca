"""Where a term may begin: which values have a name on this axis and motion, and which effects pass for each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from concealed_run import concealed_run
from diagnosis_runs import bench, dataset, evaluated, fitted, one_way, recorded
from geared_axis import geared

from hil.bench.bench_file import MechanismEntry, load_bench
from hil.bench.control_section import UnknownControl
from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.search.initial_values import claimable, is_rare, likenesses, observable, possible
from hil.diagnosis.search.score_test import offered
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.twin.library import BY_ID

OWNER = bench()
LEAD_M = OWNER.axis.lead_m
TERMS = [
    Term("cogging_torque", 0, (0.2, 4.0, 0.7)),
    Term("position_dependent_friction", 0, (0.15, LEAD_M / 4.0, 0.7)),
    Term("torque_ripple", 0, (0.1, 4.0, 0.7)),
]
TRAVEL_M = 0.06  # of the recorded motion


@pytest.fixture(scope="module")
def train() -> Dataset:
    return dataset([take(recorded(OWNER), OWNER)], OWNER)


@pytest.mark.parametrize("truth", TERMS[:2], ids=lambda term: term.effect)
def test_each_passes_for_the_other_on_a_way_forwards(truth: Term) -> None:
    run = take(one_way(OWNER, truth, 0.02, 1), OWNER)
    with_nothing, with_truth = evaluated(Hypothesis(OWNER), [run]), evaluated(Hypothesis(OWNER, (truth,)), [run])
    rival = next(
        alike
        for alike in likenesses([truth], OWNER)
        if alike[0].effect == ({term.effect for term in TERMS[:2]} - {truth.effect}).pop()
    )
    nearest = min((evaluated(Hypothesis(OWNER, (term,)), [run]) for term in rival), key=lambda found: found.cost)
    best = fitted(nearest.hypothesis, [run])
    assert best.cost - with_truth.cost < 0.001 * (with_nothing.cost - with_truth.cost)


@pytest.mark.parametrize("truth", TERMS, ids=lambda term: term.effect)
def test_what_a_likeness_passes_for_is_where_it_came_from(truth: Term) -> None:
    for alike in likenesses([truth], OWNER):
        back = next(other[0] for other in likenesses([alike[0]], OWNER) if other[0].effect == truth.effect)
        assert back.values[:2] == pytest.approx(truth.values[:2])


def test_what_the_library_does_not_allow_and_what_does_not_turn_passes_for_nothing() -> None:
    fine = likenesses([Term("cogging_torque", 0, (0.2, 150.0, 0.0))], OWNER)  # friction repeats from 0.1 mm up
    assert [alike[0].effect for alike in fine] == ["torque_ripple"]
    strong = likenesses([Term("cogging_torque", 0, (2.0, 4.0, 0.0))], OWNER)
    assert [alike[0].values[0] for alike in strong if alike[0].effect == "torque_ripple"] == [0.5]
    assert likenesses([Term("constant_load", 0, (0.2,))], OWNER) == []


def test_beside_another_of_its_effect_a_likeness_takes_the_next_slot() -> None:
    first = Term("cogging_torque", 0, (0.1, 6.0, 0.0))
    (cogging, *_), _ = likenesses([first, TERMS[1]], OWNER)
    assert (cogging.effect, cogging.slot) == ("cogging_torque", 1)


def test_what_there_is_no_room_for_is_not_tried() -> None:
    """A fifth cogging, or one in the place of a cogging that the bench knows."""
    orders = (6.0, 12.0, 18.0, 24.0)
    full = [Term("cogging_torque", 0, (0.1, order, 0.0), slot) for slot, order in enumerate(orders)]
    known = OWNER.model_copy(
        update={
            "mechanisms": tuple(
                MechanismEntry(
                    effect=term.effect, parameters=dict(zip(BY_ID[term.effect].names, term.values, strict=True))
                )
                for term in full
            )
        }
    )
    cogging, ripple = (alike[0] for alike in likenesses([TERMS[1]], OWNER))
    for model, terms in ((Hypothesis(OWNER, tuple(full)), full), (Hypothesis(known), [])):
        assert not offered(cogging, model, terms)
        assert offered(ripple, model, terms)


@pytest.mark.parametrize(
    ("term", "stands"),
    [
        (Term("position_dependent_friction", 0, (0.1, 0.9 * TRAVEL_M, 0.0)), True),
        (Term("position_dependent_friction", 0, (0.1, 1.1 * TRAVEL_M, 0.0)), False),
        (Term("encoder_eccentricity", 0, (1e-3, 0.0)), True),  # once per revolution: 10 mm
        (Term("cogging_torque", 0, (0.1, 6.0, 0.0)), True),
    ],
)
def test_a_wave_longer_than_the_travel_has_no_name(train: Dataset, term: Term, stands: bool) -> None:
    assert claimable(term, OWNER, train.runs) is stands


@pytest.mark.parametrize(
    ("term", "stands"),
    [
        (Term("thermal_growth", 0, (5e-5, 20.0)), True),
        (Term("thermal_growth", 0, (5e-5, 1.0)), False),  # at once: another lead
        (Term("structural_mode", 0, (40.0, 0.05, 0.1)), True),
        (Term("structural_mode", 0, (40.0, 0.9, 0.1)), False),  # no resonance
    ],
)
def test_values_that_belong_to_another_cause_have_no_name(train: Dataset, term: Term, stands: bool) -> None:
    assert claimable(term, OWNER, train.runs) is stands


@pytest.mark.parametrize(
    ("delay_s", "variant", "stands"), [(0.0, 1, True), (-4e-4, 1, True), (-6e-4, 1, False), (-2e-3, 0, True)]
)
def test_a_hidden_lag_of_a_torque_that_acts_before_its_record_has_no_name(
    train: Dataset, delay_s: float, variant: int, stands: bool
) -> None:
    unknown = UnknownControl(law="unknown", torque_delay_s=delay_s)
    late = OWNER.model_copy(update={"control": unknown}).sampled(1e-3)
    assert claimable(Term("current_loop_lag", variant, (1e-3,)), late, train.runs) is stands


@pytest.mark.parametrize(("leads", "rare"), [(1.0, True), (0.5, True), (0.27, False)])
def test_a_scale_with_the_period_of_the_lead_is_a_rare_cause(train: Dataset, leads: float, rare: bool) -> None:
    term = Term("scale_interpolation_error", 0, (2e-6, leads * OWNER.axis.lead_m, 0.0))
    assert claimable(term, OWNER, train.runs)
    assert is_rare(term, OWNER, train.runs) is rare


def test_once_per_revolution_is_not_told_by_part_of_one() -> None:
    facts = axis_facts(load_bench("rotary").sampled(1e-3))
    mechanism = BY_ID["encoder_eccentricity"]
    assert mechanism.is_claimable((1e-3, 0.0), 0, replace(facts, travel_m=7.0))
    assert not mechanism.is_claimable((1e-3, 0.0), 0, replace(facts, travel_m=6.0))  # less than 2 pi


def test_a_dead_zone_lets_the_drive_move_the_axis(train: Dataset) -> None:
    run = train.runs[0]
    usual = float(np.median(np.abs(run.torque_command[np.abs(np.diff(run.motor, append=run.motor[-1])) > 1e-4])))
    for share, stands in ((0.1, True), (2.0, False)):
        assert claimable(Term("torque_dead_zone", 1, (share * usual,)), OWNER, train.runs) is stands


@pytest.mark.parametrize(("limit_n_m", "stands"), [(2.0, True), (4.0, False)])
def test_a_torque_limit_is_seen_as_a_plateau(train: Dataset, limit_n_m: float, stands: bool) -> None:
    """A command above 2 N m for 100 ms at a time and above 4 N m for 5 ms."""
    command = np.concatenate([np.zeros(500), np.full(100, 2.5), np.full(5, 5.0), np.full(100, -2.5), np.zeros(2000)])
    run = replace(train.runs[0], torque_command=np.tile(command, 2)[: train.runs[0].motor.size])
    assert claimable(Term("torque_saturation", 0, (limit_n_m,)), OWNER, [run]) is stands


COULOMB_N_M = OWNER.axis.physics().coulomb_n_m


def test_a_weight_above_coulomb_friction_is_no_friction() -> None:
    assert claimable(Term("asymmetric_friction", 0, (-0.9 * COULOMB_N_M,)), OWNER)
    assert not claimable(Term("asymmetric_friction", 0, (1.1 * COULOMB_N_M,)), OWNER)
    assert claimable(Term("constant_load", 0, (3.0 * COULOMB_N_M,)), OWNER)


@pytest.mark.parametrize(
    ("rest_m", "named", "there"),
    [(0.11, True, True), (-0.05, True, True), (-0.07, False, True), (1.7, False, True), (10.0, False, False)],
)
def test_a_spring_that_rests_out_of_reach_is_a_load(train: Dataset, rest_m: float, named: bool, there: bool) -> None:
    """The travel is 60 mm. Where the force still depends on the position, the spring is an equal of the load."""
    spring = Term("spring_load", 0, (20.0, rest_m))
    assert claimable(spring, OWNER, train.runs) is named
    assert possible(spring, OWNER, train.runs) is there


@pytest.mark.parametrize(
    ("frequency_hz", "structure"), [(120.0, True), (1700.0, True), (1900.0, False), (2000.0, False)]
)
def test_a_structure_that_sways_as_fast_as_can_be_is_a_mass(frequency_hz: float, structure: bool) -> None:
    assert claimable(Term("structural_mode", 0, (frequency_hz, 0.05, 0.3)), OWNER) is structure


UPPER, LOWER = 0, 1


def test_a_stop_is_reached_and_leaves_most_of_the_travel_free() -> None:
    facts = axis_facts(OWNER, [take(concealed_run(OWNER, {}), OWNER)])
    for edge_m, variant, told in (
        (0.37, UPPER, True),
        (0.45, UPPER, False),  # out of reach
        (0.10, UPPER, False),  # a spring over most of the travel
        (0.10, LOWER, True),
        (-0.01, LOWER, False),
        (0.37, LOWER, False),
    ):
        assert BY_ID["end_stop"].is_claimable((1e5, edge_m), variant, facts) is told


def test_a_zone_is_a_part_of_the_travel() -> None:
    facts = axis_facts(OWNER, [take(concealed_run(OWNER, {}), OWNER)])
    for zone, told in (
        ((0.22, 0.30, 0.004), True),
        ((0.01, 0.39, 0.004), False),  # the whole travel
        ((0.38, 0.50, 0.004), False),  # most of it is out of reach
        ((0.30, 0.22, 0.004), False),
        ((0.22, 0.30, 0.1), False),  # flanks without a zone between
    ):
        assert BY_ID["local_friction"].is_claimable((0.5, *zone), 0, facts) is told


def test_a_few_waves_in_the_whole_recording_are_a_drift() -> None:
    facts = axis_facts(OWNER, [take(concealed_run(OWNER, {}), OWNER)])
    for waves, told in ((8.0, True), (3.0, False)):
        assert BY_ID["periodic_force"].is_claimable((10.0, waves / facts.duration_s, 0.0), 0, facts) is told


def test_it_is_offered_only_for_an_encoder_on_a_load_that_turns() -> None:
    mechanism = BY_ID["load_encoder_eccentricity"]
    (variant,) = mechanism.variants
    one_encoder = load_bench("rotary")
    assert observable(mechanism, variant, geared())
    assert not observable(mechanism, variant, one_encoder)
    assert mechanism.turning  # not on an axis whose load moves along a line
    facts = axis_facts(geared().sampled(1e-3))
    for travel_m, told in ((7.0, True), (6.0, False)):
        assert mechanism.is_claimable((1e-3, 0.0), 0, replace(facts, travel_m=travel_m)) is told
