"""Section of a report: which rules the candidates of a diagnosis passed, and which refuted them."""

import math

from hil.diagnosis.result import CandidateLedger, Result
from hil.diagnosis.wording import title, titles
from hil.report.page import Page

_OTHERS = 3  # candidates that are shown beside the named ones; diagnosis.json has all


def ledger_section(page: Page, result: Result) -> None:
    """Add the ledgers of all named mechanisms and of the three others with the most evidence, each by its last fit."""
    named = [one for one in result.considered if one.named]
    last = {(one.effect, one.variant, one.beside): one for one in (*result.considered, *named)}
    others = sorted((one for one in last.values() if not one.named), key=_evidence, reverse=True)[:_OTHERS]
    if not named and not others:
        return
    page.heading("Which rules decided")
    for one in (*named, *others):
        name = title(one.effect).capitalize() + (f" ({one.variant})" if one.variant else "")
        beside = f", added beside {titles(one.beside)}" if one.beside else ""
        page.text(f"{name}{beside}: {_outcome(one)}.")
        page.table(
            ("rule", "accepted", "what was found"),
            [(answer.rule, "yes" if answer.accepted else "no", answer.text) for answer in one.rules],
            left=(0, 2),
            mark=1,
        )
    page.text(f"Fits of mechanisms: {len(result.considered)}; diagnosis.json has the ledger of each.")


def _outcome(one: CandidateLedger) -> str:
    stands = all(answer.accepted for answer in one.rules[-1:])  # an added one goes on where `channels` refutes
    if one.named:
        return "named" if stands else "named as a part of the mismatch"
    return "not named, not refuted" if stands else "refuted"


def _evidence(one: CandidateLedger) -> float:
    """Evidence of a candidate against the twin without it (BIC difference)."""
    evidence = (answer.figures.get("evidence") for answer in one.rules)
    return next((float(value) for value in evidence if value is not None), -math.inf)
