"""A term whose confidence is too low for a name is dropped, and what stands beside it stays."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import pytest
from diagnosis_runs import bench, dataset, fitted, recorded

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.verdict import findings
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.diagnosis.verdict.findings import confidences
from hil.diagnosis.verdict.held_out import likely
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term

OWNER = bench()
COGGING, LOAD = Term("cogging_torque", 0, (0.3, 6.0, 0.2)), Term("constant_load", 0, (0.1,))


@dataclass
class Search:
    """Stands for a search: its recordings, the rivals of its terms, and the evidence for each term."""

    prepared: Any = None
    rivals: dict[Any, list[RivalFit]] = field(default_factory=dict)
    needed: dict[Any, float] = field(default_factory=dict)


def test_an_error_of_a_sensor_that_two_encoders_tell_needs_no_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the twin misses half of the torque, a late second encoder is as sure as without; friction is not."""
    late, fades = Term("channel_time_skew", 0, (2e-3,)), Term("table_side_friction", 0, (0.5,))
    data = dataset([take(recorded(OWNER, late, fades, seed=1), OWNER)], OWNER)
    final = fitted(Hypothesis(OWNER, (late, fades)), data, evaluations=6)
    nominal, held_out = fitted(Hypothesis(OWNER), data, evaluations=6), data.over(())
    proof = cross_validate(nominal, final, held_out)
    assert {(one.term.effect, one.channel) for one in proof.ablations} == {
        ("channel_time_skew", "table"),
        ("table_side_friction", "table"),
    }
    sure = [list[float](), list[float]()]
    for own, missed in zip(sure, (0.0, 0.5), strict=True):
        monkeypatch.setattr(findings, "missed_beyond_noise", lambda *of, missed=missed: missed)
        own += confidences(Search(), proof.final, proof.ablations, held_out)  # type: ignore[arg-type]
    by_effect = [dict(zip([one.effect for one in proof.final.terms], own, strict=True)) for own in sure]
    assert by_effect[0]["channel_time_skew"] == by_effect[1]["channel_time_skew"]
    assert by_effect[0]["table_side_friction"] > by_effect[1]["table_side_friction"]


def test_a_term_that_hardly_stands_is_no_name() -> None:
    """A small load beside a large effect that has no name: its odds fall where the search hardly needed it."""
    data = dataset([take(recorded(OWNER, COGGING, LOAD, seed=1), OWNER)], OWNER)
    final = fitted(Hypothesis(OWNER, (LOAD,)), data, evaluations=6)
    nominal, held_out = fitted(Hypothesis(OWNER), data, evaluations=6), data.over(())
    proof, search = cross_validate(nominal, final, held_out), Search(SimpleNamespace(train=data, held_out=held_out))
    assert [one.term.effect for one in proof.ablations] == ["constant_load"]
    (sure,) = confidences(search, proof.final, proof.ablations, held_out)  # type: ignore[arg-type]
    assert sure > CRITERIA.named
    assert likely(search, nominal, proof, held_out).final is proof.final  # type: ignore[arg-type]
    doubted = replace(search, needed={final.terms[0].key: 1.0})
    (doubtful,) = confidences(doubted, proof.final, proof.ablations, held_out)  # type: ignore[arg-type]
    assert doubtful < CRITERIA.named
    kept = likely(doubted, nominal, proof, held_out)  # type: ignore[arg-type]
    assert not kept.final.terms
    assert [one.term.effect for one in kept.dropped] == ["constant_load"]
