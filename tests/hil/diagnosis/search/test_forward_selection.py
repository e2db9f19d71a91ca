"""Terms that lose their name when another term is fitted beside them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from diagnosis_runs import bench, fitted, moves, recorded
from geared_axis import geared

from hil.diagnosis.search import forward_selection
from hil.diagnosis.search.initial_values import claimable
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.twin.library import BY_ID

OWNER = bench()


def test_a_spring_that_a_later_fit_moves_out_of_reach_becomes_a_load() -> None:
    lag = Term("current_loop_lag", 0, (1e-3,))
    runs = [take(recorded(OWNER, Term("constant_load", 0, (0.8,)), lag), OWNER)]
    ratio_m_rad = OWNER.axis.ratio_m_rad
    spring = Term("spring_load", 0, (0.8 / ratio_m_rad / 0.08, -0.05))
    assert claimable(spring, OWNER, runs)
    found = fitted(Hypothesis(OWNER, (spring, lag)), runs)
    (out_of_reach, _) = found.terms
    assert not claimable(out_of_reach, OWNER, runs)
    load, other = forward_selection.claimed(found).terms
    assert (load.effect, other.effect) == ("constant_load", "current_loop_lag")
    assert load.values == pytest.approx((0.8,), rel=0.02)


@pytest.mark.parametrize(("arc_rad", "effect"), [(0.003, "constant_load"), (0.4, "gravity_torque")])
def test_gravity_over_an_arc_that_does_not_tell_its_size_is_a_load(arc_rad: float, effect: str) -> None:
    owner, gravity = geared(), Term("gravity_torque", 0, (8.0, 0.9))
    strokes = [
        {"kind": "sine_squared", "to_m": to, "feed_m_s": max(arc_rad, 0.02)}
        for to in (arc_rad, 0.0, arc_rad / 2.0, 0.0)
    ]
    profile = moves([{"kind": "dwell", "duration_s": 0.1}, *strokes])
    found = fitted(
        Hypothesis(owner, (gravity,)), [take(recorded(owner, gravity, profile=profile, torque_noise_n_m=1.0), owner)]
    )
    (term,) = forward_selection.claimed(found).terms
    assert term.effect == effect
    if effect == "constant_load":
        assert term.values == pytest.approx((8.0 * math.sin(0.9 + arc_rad / 2.0) / 10.0,), rel=0.02)


@pytest.mark.parametrize(
    ("ratios", "left"),
    [({"motor": 0.6, "table": 100.0}, {"table": 10.0}), ({"motor": 16.0, "table": 100.0}, {}), ({"motor": 0.6}, {})],
)
def test_a_channel_is_set_aside_where_another_is_explained(ratios: dict[str, float], left: dict[str, float]) -> None:
    known = SimpleNamespace(exact_input=False, hidden=frozenset({"command"}))
    fit: Any = SimpleNamespace(noise_ratios=(ratios | {"command": 0.0},), data=SimpleNamespace(observability=known))
    assert forward_selection.unexplained_channels(fit) == pytest.approx(left)


def test_a_channel_that_is_set_aside_is_not_set_aside_again() -> None:
    """Else two factors follow each other without end: each is told beside the noise of the other."""
    observability = SimpleNamespace(exact_input=True, hidden=frozenset())
    data = SimpleNamespace(observability=observability, set_aside={"table": 4.0})
    fit: Any = SimpleNamespace(noise_ratios=({"motor": 1.0, "table": 2.0},), data=data)
    assert forward_selection.unexplained_channels(fit)
    assert forward_selection._beside_unexplained(fit, fit, fit) is None


def test_a_term_that_is_removed_again_gives_its_place_to_the_next_that_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    def fit(*effects: str) -> Any:
        terms = tuple(Term(effect, 0, (1.0,) * len(BY_ID[effect].names)) for effect in effects)
        one = SimpleNamespace(terms=terms, cost=1.0, jacobian=None)
        one.refit = lambda evaluations, slopes: one
        return one

    def addition(effect: str, stands: bool) -> Any:
        ledger = (SimpleNamespace(accepted=True),)
        return SimpleNamespace(fit=fit(effect), stands=stands, harmless=ledger, considered=f"ledger of {effect}")

    first, refuted, second, third = (
        addition("cogging_torque", True),
        addition("backlash", False),
        addition("torque_ripple", True),
        addition("constant_load", True),
    )
    asked = list[str]()

    def pruned(one: Any, reference: Any) -> Any:
        """Remove the first term again, with its ledger."""
        asked.append(one.terms[-1].effect)
        return (fit(), {}, ["removed"]) if asked[-1] == "cogging_torque" else (one, {one.terms[-1].key: 9.0}, [])

    monkeypatch.setattr(
        forward_selection, "chosen", lambda best, left, round_: SimpleNamespace(considered=(), named=best, rivals=[])
    )
    monkeypatch.setattr(forward_selection, "_pruned", pruned)
    monkeypatch.setattr(forward_selection, "_invalid", lambda one: [])
    monkeypatch.setattr(forward_selection, "claimed", lambda one: one)
    monkeypatch.setattr(forward_selection, "revised", lambda one: one)
    additions: Any = SimpleNamespace(best=first, fits=[first, refuted, second, third])
    round_: Any = SimpleNamespace(reference=None)
    grown, considered = forward_selection._grown(additions, round_, fit(), [[]])
    assert asked == ["cogging_torque", "torque_ripple"]
    assert considered == ["removed"]
    assert grown is not None
    assert [term.effect for term in grown.fit.terms] == ["torque_ripple"]
    assert list(grown.rivals) == list(grown.needed) == [second.fit.terms[-1].key]


def test_a_fit_that_is_carried_to_other_recordings_keeps_its_values_and_how_it_ended() -> None:
    first, second = ([take(recorded(OWNER, seed=seed), OWNER)] for seed in (1, 2))
    fit = fitted(Hypothesis(OWNER), first)
    other = fit.data.over(second)
    assert fit.converged
    there = forward_selection.carried(other, fit)
    assert there.converged
    assert there.data is other
    assert there.hypothesis.x == pytest.approx(fit.hypothesis.x, rel=0.0)
    assert there.jacobian.shape == (there.residuals.vector.size, fit.hypothesis.x.size)
