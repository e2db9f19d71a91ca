"""Write the results of a proof: the page with its pictures, the same tables as Markdown, all numbers as scores.json."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from hil.figures.drawing import save
from hil.files.output import write_json, write_text
from hil.quantities import digits
from hil.report.page import Page
from hil.validation.proof.score import pictures
from hil.validation.proof.score.grading import GradedCase
from hil.validation.proof.score.scores import Goal, Scores, lead
from hil.validation.proof.score.statistics import Rate, by_effect, confusion, power, quantile, verdicts
from hil.validation.proof.score.tables import (
    ProofTable,
    checking,
    effects_table,
    goals_table,
    markdown,
    others_table,
    power_table,
    verdicts_table,
    worst_tables,
)
from hil.validation.proof.seal import read_seal

SCORES, REPORT, MARKDOWN = "scores.json", "report.html", "proof.md"
_PICTURES = (
    (
        "power",
        pictures.power_figure,
        "Share of the cases of the ladder that are detected, over the size of the effect: its change of the recordings "
        "beyond that of any nominal parameters, over the noise. Bars: 95 % intervals (Wilson).",
    ),
    (
        "confusion",
        pictures.confusion_figure,
        "Singles, ladder above the floor, novel physics, nulls, and wrong parameters. Rows: concealed effect; columns: "
        "the first name, or the verdict without one.",
    ),
    (
        "calibration",
        pictures.calibration_figure,
        "Findings of all tiers in bins of confidence: on the dashed line a confidence of 80 % is right in 80 % of the "
        "cases.",
    ),
    (
        "errors",
        pictures.errors_figure,
        "Each point is a parameter of a rightly named single effect. Phases in radians, harmonics relative to the "
        "first amplitude.",
    ),
    ("times", pictures.times_figure, "Time of each diagnosis on this machine, with parallel processes."),
)


def write_proof(scores: Scores, others: Mapping[str, Scores], folder: Path) -> None:
    """Write report.html with its PNGs, proof.md and scores.json; `others`: scores of other methods."""
    goals = (*scores.goals, *((lead(scores, others),) if others else ()))
    seal = read_seal(folder) or {}
    missed = [goal for goal in goals if goal.met is False]
    decided = sum(goal.met is not None for goal in goals)
    heading = "Proof: concealed effects, diagnosed blind"
    about = f"{_of(len(scores.cases), seal['cases'])} cases, seed {seal['seed']}, sealed {seal['sealed_at']}"
    verdict = f"{decided - len(missed)} of {decided} goals reached." + (
        f" Not reached: {', '.join(goal.name for goal in missed)}." if missed else ""
    )
    before = [goals_table(goals), *([others_table(scores, others)] if others else []), verdicts_table(scores)]
    after = [effects_table(scores), *worst_tables(scores)]

    page = Page(heading, about, verdict, decided > 0 and not missed)
    for table in before:
        add_table(page, table)
    for name, draw, caption in _PICTURES:
        figure = draw(scores)
        if figure is not None:
            page.heading(name.capitalize())
            page.picture(save(figure, folder / f"{name}.png"), caption)
    for table in after:
        add_table(page, table)
    page.heading("How to check it")
    page.items(checking(seal))
    page.write(folder / REPORT)
    times = [case.answer.runtime_s for case in scores.cases if case.answer.runtime_s is not None]
    parts = [
        f"# {heading}",
        f"{about}. {time_text(times)}{verdict}",
        *(markdown(table) for table in (*before, power_table(scores), *after)),
        "## How to check it",
        "\n".join(f"- {text}" for text in checking(seal)),
    ]
    write_text(folder / MARKDOWN, "\n\n".join(part for part in parts if part) + "\n")
    write_json(folder / SCORES, _scores_json(scores, goals, seal, times, others))


def _of(scored: int, sealed: int) -> str:
    return f"{scored}" if scored == sealed else f"The first {scored} of {sealed}"


def add_table(page: Page, table: ProofTable) -> None:
    """Add a table with its heading to a page; nothing if it has no rows."""
    if not table.rows:
        return
    if table.heading:
        page.heading(table.heading)
    if table.text:
        page.text(table.text)
    page.table(table.headers, table.rows, table.left, table.mark)


def time_text(times: Sequence[float]) -> str:
    """Return a sentence on the times [s] of diagnoses; empty without any."""
    if not times:
        return ""
    return f"A diagnosis took {digits(quantile(times, 0.5) or 0.0)} s in the median, {digits(max(times))} s at most. "


def _scores_json(
    scores: Scores, goals: Sequence[Goal], seal: dict[str, Any], times: Sequence[float], others: Mapping[str, Scores]
) -> dict[str, Any]:
    effects = by_effect(scores.of_tier("single"), lambda case: case.top)
    return {
        "schema_version": 1,
        "seal": seal,
        "goals": [goal_json(goal) for goal in goals],
        "verdicts": verdicts(scores.cases),
        "confusion": confusion(scores.cases),
        "effects": {effect: _rate_json(found) for effect, found in effects.items()},
        "power": [
            {"size": rung.size, "detected": _rate_json(rung.detected), "named": _rate_json(rung.named)}
            for rung in power(scores.cases)
        ],
        "calibration": [
            {"confidence": found.confidence, "right": _rate_json(found.right)} for found in scores.calibration
        ],
        "runtime_s": {"median": quantile(times, 0.5), "p90": quantile(times, 0.9), "longest": max(times, default=None)},
        "cases": [_case_json(case) for case in scores.cases],
        "others": {name: [goal_json(goal) for goal in other.goals] for name, other in others.items()},
    }


def goal_json(goal: Goal) -> dict[str, Any]:
    """Return plain data of a goal with its figure."""
    finite = goal.value is not None and isfinite(goal.value)
    number = {"value": goal.value if finite else None, "of": goal.of}
    found = _rate_json(goal.measured) if isinstance(goal.measured, Rate) else number
    high = goal.high if isfinite(goal.high) else None
    return {"name": goal.name, "detail": goal.detail, "low": goal.low, "high": high, **found, "met": goal.met}


def _rate_json(found: Rate) -> dict[str, Any]:
    return {"value": found.value, "hits": found.hits, "of": found.of, "interval_95": found.interval}


def _case_json(case: GradedCase) -> dict[str, Any]:
    answer = case.answer
    return {
        "name": case.truth.name,
        "tier": case.truth.tier,
        "axis": case.truth.axis,
        "concealed": [
            {"effect": effect.effect, "form": effect.form, "size": effect.size} for effect in case.truth.effects
        ],
        "verdict": answer.verdict,
        "named": [
            {"effect": named.effect, "equivalents": named.equivalents, "confidence": named.confidence}
            for named in answer.named
        ],
        "block": answer.location.block,
        "parameter_errors": case.parameter_errors(),
        "right": case.right,
        "wrong": case.wrong,
        "runtime_s": answer.runtime_s,
    }
