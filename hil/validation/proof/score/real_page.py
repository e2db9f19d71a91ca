"""Write the results of a proof on real recordings: the page, the same tables as Markdown, all numbers as JSON."""

from collections.abc import Callable
from pathlib import Path

from hil.diagnosis.wording import title
from hil.files.output import write_json, write_text
from hil.quantities import digits
from hil.report.page import Page
from hil.validation.proof.score.page import MARKDOWN, REPORT, SCORES, add_table, goal_json, time_text
from hil.validation.proof.score.real import TOLD, RealCaseScore, RealScores
from hil.validation.proof.score.statistics import quantile, rate
from hil.validation.proof.score.tables import ProofTable, checking, goals_table, markdown
from hil.validation.proof.seal import read_seal

_HEADING = "Proof on real recordings: concealed effects, diagnosed blind"


def write_real_proof(scores: RealScores, folder: Path) -> None:
    """Write report.html, proof.md and scores.json."""
    seal = read_seal(folder) or {}
    goals = scores.goals
    missed = [goal.name for goal in goals if goal.met is False]
    decided = sum(goal.met is not None for goal in goals)
    times = [case.answer.runtime_s for case in scores.cases if case.answer.runtime_s is not None]
    about = f"{len(scores.cases)} of {seal['cases']} cases, seed {seal['seed']}, sealed {seal['sealed_at']}"
    verdict = f"{decided - len(missed)} of {decided} goals reached."
    verdict += f" Not reached: {', '.join(missed)}." if missed else ""
    tables = [
        goals_table(goals),
        _grouped("By kind of edit", scores, lambda case: case.truth.kind or "untouched"),
        _grouped("By recording", scores, lambda case: case.truth.source),
        _cases(scores),
    ]
    page = Page(_HEADING, about, verdict, decided > 0 and not missed)
    for table in tables:
        add_table(page, table)
    page.heading("How to check it")
    page.items(checking(seal))
    page.write(folder / REPORT)
    parts = [
        f"# {_HEADING}",
        f"{about}. {time_text(times)}{verdict}",
        *map(markdown, tables),
        "## How to check it",
        "\n".join(f"- {text}" for text in checking(seal)),
    ]
    write_text(folder / MARKDOWN, "\n\n".join(part for part in parts if part) + "\n")
    write_json(
        folder / SCORES,
        {
            "schema_version": 1,
            "seal": seal,
            "goals": [goal_json(goal) for goal in goals],
            "runtime_s": {"median": quantile(times, 0.5), "longest": max(times, default=None)},
            "cases": [case.as_json() for case in scores.cases],
        },
    )


def _grouped(heading: str, scores: RealScores, key: Callable[[RealCaseScore], str]) -> ProofTable:
    """Return the table of cases by a property."""
    rows = []
    for name in sorted({key(case) for case in scores.cases}):
        cases = [case for case in scores.cases if key(case) == name]
        told = [case for case in cases if case.truth.right and case.truth.size >= TOLD and not case.there_already]
        first = rate(case.first_right for case in told)
        counts = (
            f"{first.hits} of {first.of}",
            str(sum(case.detected for case in cases if not case.null)),
            str(sum(bool(case.wrong) for case in cases)),
            str(sum(case.there_already for case in cases)),
            str(sum(case.unanswered for case in cases)),
        )
        rows.append((name, str(len(cases)), *counts))
    headers = ("", "cases", "named first where told", "detected", "wrong names", "there already", "no answer")
    return ProofTable(heading, headers, rows)


def _cases(scores: RealScores) -> ProofTable:
    """Return the table of all cases."""
    rows = []
    for case in scores.cases:
        truth = case.truth
        half = f"{truth.source}, {'first' if truth.part == 0 else 'second'} half{', law known' * truth.law_known}"
        size = f"{digits(truth.size)} errors" if truth.size else ""
        named = "; ".join(
            f"{title(one.effect)} {100.0 * (one.confidence or 0.0):.0f} %{'' if case.right(one) else ' (wrong)'}"
            for one in case.new
        )
        already = ", ".join(title(one.effect) for one in case.untouched.named) if not case.null else ""
        rows.append((truth.name, half, truth.kind or "untouched", size, title(case.answer.verdict), named, already))
    headers = ("case", "half", "edit", "size", "verdict", "new names", "there already")
    return ProofTable("All cases", headers, rows, left=range(len(headers)))
