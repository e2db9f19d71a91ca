"""Effects that repeat with the screw cannot be told apart on a motion in one direction; all are reported as a set."""

from __future__ import annotations

from dataclasses import replace

import pytest
from diagnosis_runs import bench, evaluated, fitted, moves, recorded

from hil.bench.bench_file import MechanismEntry
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.search.initial_values import likenesses
from hil.diagnosis.search.score_test import offered
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.twin.library import BY_ID

OWNER = bench()
LEAD_M = OWNER.axis.lead_m
TERMS = [
    Term("cogging_torque", 0, (0.2, 4.0, 0.7)),
    Term("position_dependent_friction", 0, (0.15, LEAD_M / 4.0, 0.7)),
    Term("torque_ripple", 0, (0.1, 4.0, 0.7)),
]


def one_way(truth: Term, feed_m_s: float, seed: int) -> Recording:
    """A stroke forwards, recorded until shortly before its end: at rest friction holds, and cogging does not."""
    profile = moves(
        [{"kind": "dwell", "duration_s": 0.2}, {"kind": "sine_squared", "to_m": 0.08, "feed_m_s": feed_m_s}]
    )
    whole = recorded(OWNER, truth, seed=seed, profile=profile)
    rows = slice(0, round(0.95 * len(whole)))
    return replace(whole, columns={name: values[rows] for name, values in whole.columns.items()})


@pytest.mark.parametrize("truth", TERMS[:2], ids=lambda term: term.effect)
def test_each_passes_for_the_other_on_a_way_forwards(truth: Term) -> None:
    run = take(one_way(truth, 0.02, 1), OWNER)
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
    """A third cogging, or one in the place of a cogging that the bench knows."""
    two = [Term("cogging_torque", 0, (0.1, 6.0, 0.0)), Term("cogging_torque", 0, (0.1, 12.0, 0.0), 1)]
    known = OWNER.model_copy(
        update={
            "mechanisms": tuple(
                MechanismEntry(
                    effect=term.effect, parameters=dict(zip(BY_ID[term.effect].names, term.values, strict=True))
                )
                for term in two
            )
        }
    )
    cogging, ripple = (alike[0] for alike in likenesses([TERMS[1]], OWNER))
    for model, terms in ((Hypothesis(OWNER, tuple(two)), two), (Hypothesis(known), [])):
        assert not offered(cogging, model, terms)
        assert offered(ripple, model, terms)


def test_friction_along_the_screw_is_not_named_alone_where_it_goes_one_way() -> None:
    truth = TERMS[1]
    found = diagnose([one_way(truth, 0.02, 1), one_way(truth, 0.025, 2)], [one_way(truth, 0.03, 3)], OWNER)
    (named,) = found.result.missing
    assert {named.effect, *named.equivalents} >= {"cogging_torque", "position_dependent_friction"}
