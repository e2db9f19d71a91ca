"""Ledgers of a diagnosis: each finding in its own."""

from types import SimpleNamespace

import pytest

from hil.diagnosis.ledger import Considered, LedgerEntry
from hil.diagnosis.verdict import ledgers

EFFECT = "periodic_force"


def ablation(stands: bool) -> SimpleNamespace:
    term = SimpleNamespace(effect=EFFECT, variant=0)
    return SimpleNamespace(term=term, ledger=(LedgerEntry("held-out recordings", stands, "", {}),))


def test_of_two_terms_of_one_mechanism_each_has_its_ledger(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledgers, "explanation", lambda *_: ())
    monkeypatch.setattr(ledgers, "key_in_search", lambda _, term: (term.effect,))
    added = LedgerEntry("evidence", True, "", {})
    searched = SimpleNamespace(
        nominal=None,
        prepared=SimpleNamespace(held_out=None),
        considered=(Considered(EFFECT, 0, (), (added,)), Considered(EFFECT, 0, (EFFECT,), (added,))),
    )
    proof = SimpleNamespace(final=SimpleNamespace(terms=()), ablations=(ablation(True),), dropped=(ablation(False),))
    judged = SimpleNamespace(has_findings=True, tested=SimpleNamespace(searched=searched, proof=proof))
    found = ledgers.ledgers(judged, ())  # type: ignore[arg-type]
    assert sorted((one.named, one.rules[-1].accepted) for one in found) == [(False, False), (True, True)]
