"""Ledgers of a diagnosis: each finding in its own."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from hil.diagnosis.ledger import Considered, LedgerEntry
from hil.diagnosis.result import CandidateLedger
from hil.diagnosis.verdict import ledgers
from hil.identification.terms import Term

FIRST = Term("periodic_force", 0, (5.0, 30.0, 0.0))
SECOND = replace(FIRST, slot=1)


def entries(**answers: bool) -> tuple[LedgerEntry, ...]:
    return tuple(LedgerEntry(rule, stands, "", {}) for rule, stands in answers.items())


def made(
    monkeypatch: pytest.MonkeyPatch, considered: tuple[Considered, ...], kept: Term, dropped: tuple[Term, ...] = ()
) -> list[CandidateLedger]:
    """Ledgers after the tests on held-out recordings, which refute the dropped terms."""
    monkeypatch.setattr(ledgers, "explanation", lambda *_: ())
    proof = SimpleNamespace(
        final=SimpleNamespace(terms=()),
        ablations=(SimpleNamespace(term=kept, ledger=entries(held_out=True)),),
        dropped=tuple(SimpleNamespace(term=term, ledger=entries(held_out=False)) for term in dropped),
    )
    prepared = SimpleNamespace(held_out=None)
    searched = SimpleNamespace(nominal=None, prepared=prepared, rivals={}, needed={}, considered=considered)
    judged = SimpleNamespace(has_findings=True, tested=SimpleNamespace(searched=searched, proof=proof))
    return list(ledgers.ledgers(judged, ()))  # type: ignore[arg-type]


def test_of_two_terms_of_one_mechanism_each_has_its_ledger(monkeypatch: pytest.MonkeyPatch) -> None:
    first = Considered(FIRST.key, (), entries(evidence=True), added=True)
    second = Considered(SECOND.key, (FIRST.effect,), entries(evidence=True), added=True)
    found = made(monkeypatch, (first, second), SECOND, (FIRST,))
    assert [(one.beside, one.named, one.rules[-1].accepted) for one in found] == [
        ((), False, False),
        ((FIRST.effect,), True, True),
    ]


def test_a_term_that_was_added_though_a_rule_refuted_it_has_one_ledger(monkeypatch: pytest.MonkeyPatch) -> None:
    rival = Considered(FIRST.key, (), entries(evidence=True))
    added = Considered(FIRST.key, (), entries(evidence=True, channels=False), added=True)
    of_rival, named = made(monkeypatch, (rival, added), FIRST)
    assert not of_rival.named
    assert named.named
    assert [answer.rule for answer in named.rules] == ["evidence", "channels", "held_out"]
