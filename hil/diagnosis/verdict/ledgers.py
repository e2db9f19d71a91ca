"""Ledgers of all candidates that were fitted, with the answers of the verdict on those that were found."""

import math
from collections.abc import Container
from dataclasses import replace

from hil.diagnosis.ledger import Considered, Ledger, LedgerEntry
from hil.diagnosis.result import CandidateLedger, RuleAnswer
from hil.diagnosis.stages import Judged
from hil.diagnosis.verdict.findings import key_in_search
from hil.diagnosis.verdict.judge import explanation
from hil.twin.library import BY_ID


def ledgers(judged: Judged, forms: Container[int]) -> tuple[CandidateLedger, ...]:
    """The candidates in the order in which they were fitted.

    One that was found has the answers on held-out recordings too, and that on all terms together. A term that the
    search did not add itself (another form, an event of a held-out recording) has these alone. `forms` are the indices
    of terms that are reported as part of another one: they have no name of their own.
    """
    searched, proof = judged.tested.searched, judged.tested.proof
    together: Ledger = ()
    if proof.final.terms:
        together = explanation(searched.nominal, proof.final, searched.prepared.held_out)
    answers, more = (
        {index: _candidate(one, False) for index, one in enumerate(searched.considered)},
        list[CandidateLedger](),
    )
    taken = set[int]()
    for index, ablation in enumerate((*proof.ablations, *proof.dropped)):
        kept = index < len(proof.ablations)
        term, effect = ablation.term, key_in_search(searched, ablation.term)[0]
        places = [
            place
            for place, one in enumerate(searched.considered)
            if one.effect == effect and one.accepted and place not in taken
        ]
        # the same torque may be named by a more frequent cause of it
        before = replace(searched.considered[places[-1]], effect=term.effect) if places else None
        found = before or Considered(term.effect, term.variant, (), ())
        answer = _candidate(
            found.asked(ablation.ledger).asked(together if kept else ()),
            kept and index not in forms and judged.has_findings,
        )
        if places:
            answers[places[-1]] = answer
            taken.add(places[-1])  # several terms may be of one mechanism
        else:
            more.append(answer)
    return (*answers.values(), *more)


def _candidate(one: Considered, named: bool) -> CandidateLedger:
    return CandidateLedger(
        effect=one.effect,
        variant=BY_ID[one.effect].forms[one.variant],
        beside=one.beside,
        named=named,
        rules=tuple(map(_answer, one.ledger)),
    )


def _answer(entry: LedgerEntry) -> RuleAnswer:
    figures = {
        name: value if isinstance(value, str) or math.isfinite(value) else None for name, value in entry.figures.items()
    }
    return RuleAnswer(rule=entry.rule, accepted=entry.accepted, text=entry.text, figures=figures)
