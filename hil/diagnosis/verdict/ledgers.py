"""Ledgers of all candidates that were fitted, with the answers of the verdict on those that were added."""

import math
from collections.abc import Container

from hil.diagnosis.ledger import Considered, Ledger, LedgerEntry
from hil.diagnosis.result import CandidateLedger, RuleAnswer
from hil.diagnosis.stages import Judged
from hil.diagnosis.verdict.findings import key_in_search
from hil.diagnosis.verdict.judge import explanation
from hil.twin.library import BY_ID


def ledgers(judged: Judged, forms: Container[int]) -> tuple[CandidateLedger, ...]:
    """The candidates in the order in which they were fitted.

    One that was added has the answers on held-out recordings too, and that on all terms together. A term that the
    search did not add itself (another form, an event of a held-out recording) has these alone. `forms` are the indices
    of terms that are reported as part of another one: they have no name of their own.
    """
    searched, proof = judged.tested.searched, judged.tested.proof
    together: Ledger = ()
    if proof.final.terms:
        prepared = searched.prepared
        together = explanation(searched.nominal, proof.final, prepared.held_out, prepared.law.channels)
    answers = {index: _candidate(one) for index, one in enumerate(searched.considered)}
    places = {one.key: index for index, one in enumerate(searched.considered) if one.added}
    for index, ablation in enumerate((*proof.ablations, *proof.dropped)):
        kept, term = index < len(proof.ablations), ablation.term
        place = places.pop(key_in_search(searched, term), len(answers))
        before = searched.considered[place] if place in answers else Considered(term.key, (), ())
        ledger = (*before.ledger, *ablation.ledger, *(together if kept else ()))
        # the same torque may be named by a more frequent cause of it
        of_term = Considered(term.key, before.beside, ledger)
        answers[place] = _candidate(of_term, kept and index not in forms and judged.has_findings)
    return tuple(answers.values())


def _candidate(one: Considered, named: bool = False) -> CandidateLedger:
    effect, variant, _ = one.key
    return CandidateLedger(
        effect=effect,
        variant=BY_ID[effect].forms[variant],
        beside=one.beside,
        named=named,
        rules=tuple(map(_answer, one.ledger)),
    )


def _answer(entry: LedgerEntry) -> RuleAnswer:
    figures = {
        name: value if isinstance(value, str) or math.isfinite(value) else None for name, value in entry.figures.items()
    }
    return RuleAnswer(rule=entry.rule, accepted=entry.accepted, text=entry.text, figures=figures)
