"""Ledgers in a report: which candidates are shown, and the outcome of each."""

from types import SimpleNamespace
from typing import Any

from hil.diagnosis.result import CandidateLedger, RuleAnswer
from hil.report.ledger_report import ledger_section


def candidate(bic: float, named: bool = False, **answers: bool) -> CandidateLedger:
    figures: dict[str, float | str | None] = {"evidence": bic}
    rules = [RuleAnswer(rule=rule, accepted=stands, text="", figures=figures) for rule, stands in answers.items()]
    return CandidateLedger(effect="backlash", named=named, rules=tuple(rules))


def shown(*considered: CandidateLedger) -> list[str]:
    """Paragraphs of the section."""
    texts = list[str]()
    page: Any = SimpleNamespace(heading=lambda text: None, table=lambda *_, **__: None, text=texts.append)
    result: Any = SimpleNamespace(considered=considered)
    ledger_section(page, result)
    return texts


def test_a_candidate_that_was_fitted_twice_is_shown_by_its_last_fit() -> None:
    assert shown(candidate(90.0, evidence=True), candidate(1.0, evidence=False))[:-1] == ["Backlash: refuted."]
    assert shown(candidate(9.0, True, evidence=True), candidate(1.0, evidence=False))[:-1] == ["Backlash: named."]


def test_the_last_rule_decides_on_a_named_candidate() -> None:
    assert shown(candidate(90.0, True, channels=False, held_out=True))[0] == "Backlash: named."
    assert shown(candidate(90.0, True, explains=False))[0] == "Backlash: named as a part of the mismatch."
