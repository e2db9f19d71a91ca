"""Explanations beside the named one: the same chance for each, and what sets one aside."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_runs import SEGMENTS, bench, dataset, fitted, moves, recorded

from hil.channels import AxisKind
from hil.diagnosis.search import addition, rivals
from hil.diagnosis.search.addition import Addition
from hil.diagnosis.search.next_term import SearchRound, first_standing
from hil.diagnosis.search.rivals import chosen
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term

OWNER = bench()
LOAD, OTHER = Term("constant_load", 0, (0.4,)), Term("friction_gradient", 0, (0.3,))


def test_what_explains_more_is_named_unless_there_is_an_objection(monkeypatch: pytest.MonkeyPatch) -> None:
    data = dataset([take(recorded(OWNER, LOAD), OWNER)], OWNER)
    base = fitted(Hypothesis(OWNER), data, evaluations=4)
    fits = [fitted(Hypothesis(OWNER, (term,)), data, evaluations=8) for term in (LOAD, OTHER)]
    search = SearchRound(base, base, base)
    right, wrong = map(search.addition, fits)
    choice = chosen(wrong, [right, wrong], search)
    assert choice.named.fit.terms[-1].effect == LOAD.effect
    (rival,) = choice.rivals
    assert rival.terms[-1].effect == OTHER.effect
    assert rival.evidence > 0.0
    assert not rival.tied
    rival_entry, entry = choice.considered
    assert (rival_entry.key, rival_entry.accepted, rival_entry.added) == (OTHER.key, False, False)
    assert (entry.key, entry.accepted, entry.added) == (LOAD.key, True, True)
    assert [answer.rule for answer in entry.ledger][:2] == ["values", "evidence"]

    monkeypatch.setattr(rivals, "first_standing", lambda additions: additions[-1])
    monkeypatch.setattr(
        rivals, "objection", lambda one, *_: "it is excluded" if one.fit.terms[-1].effect != OTHER.effect else ""
    )
    choice = chosen(wrong, [right, wrong], search)
    assert choice.named.fit.terms[-1].effect == OTHER.effect
    (rival,) = choice.rivals
    assert rival.evidence < 0.0
    assert rival.objection == "it is excluded"
    assert not rival.tied
    assert choice.considered[0].ledger[-1].text == "it is excluded"

    for name in ("claimable", "possible"):
        monkeypatch.setattr(addition, name, lambda term, *_: term.effect != LOAD.effect)
    choice = chosen(wrong, [search.addition(fits[0]), wrong], search)
    assert choice.rivals == []
    assert [(one.rule, one.accepted) for one in choice.considered[0].ledger] == [("values", False)]


@pytest.mark.parametrize(("fast", "named"), [(True, "scale_interpolation_error"), (False, "periodic_lead_error")])
def test_a_rare_cause_gives_way_unless_the_recordings_tell_it(fast: bool, named: str) -> None:
    """A scale with the period of the lead, by motion in which an error of the screw takes torque or none."""
    scale = Term("scale_interpolation_error", 0, (3e-6, OWNER.axis.lead_m, 0.3))
    screw = Term("periodic_lead_error", 0, (3e-6, 0.3, 0.0, 0.0, 0.0, 0.0))
    slow = [{"kind": "sine_squared", "to_m": to_m, "feed_m_s": 0.01} for to_m in (0.03, 0.0)]
    data = dataset([take(recorded(OWNER, scale, profile=moves(SEGMENTS if fast else slow)), OWNER)], OWNER)
    base = fitted(Hypothesis(OWNER), data, evaluations=4)
    search = SearchRound(base, base, base)
    right, other = (search.addition(fitted(Hypothesis(OWNER, (one,)), data, evaluations=12)) for one in (scale, screw))
    assert (right.rare, other.rare) == (True, False)
    choice = chosen(right, [right, other], search)
    assert choice.named.fit.terms[-1].effect == named
    (rival,) = choice.rivals
    assert rival.tied is not fast


def explained(cost: float, motor: float, table: float) -> Any:
    """Stand-in for a fit: its cost, and the mean squares of motor and table residuals over their noise."""
    run = SimpleNamespace(motor=np.zeros(1000), evaluated=slice(None), kind=AxisKind.ROTARY)
    data = SimpleNamespace(runs=(run,))
    ratios = ({"motor": motor, "table": table},)
    return SimpleNamespace(
        cost=cost,
        rows=2000,
        excess=0.0,
        within_noise=False,
        terms=(),
        data=data,
        noise_ratios=ratios,
        bench=OWNER,
    )


def test_a_little_harm_does_not_set_aside_what_explains_nearly_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """An eccentric pulley explained nine tenths of what play left, and a third more remained in the motor."""
    for name, value in {
        "evidence": 1e3,
        "removed": 1e3,
        "explained": 0.9,
        "unrepeated": (0.0, 0.0),
        "inside": None,
        "torque": None,
        "claimable": True,
    }.items():
        monkeypatch.setattr(Addition, name, value)
    search = SearchRound(base := explained(5e5, 12.0, 1000.0), base, explained(6e5, 16.0, 1100.0))
    most, play = (search.addition(fit) for fit in (explained(4e4, 16.0, 75.0), explained(3e5, 6.0, 60.0)))
    assert first_standing([most, play]) is most
    below = search.addition(explained(4e4, 25.0, 75.0))  # worse than by the bench file
    assert first_standing([below, play]) is play
