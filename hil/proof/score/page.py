"""The results of a proof: the page with its pictures, the same tables as Markdown, and all numbers as scores.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from hil.figures.drawing import save
from hil.files.output import write_json, write_text
from hil.proof.score import pictures
from hil.proof.score.confusion import by_effect, confusion, power, verdicts
from hil.proof.score.grading import Marked
from hil.proof.score.scores import Goal, Scores, lead
from hil.proof.score.statistics import Rate, quantile
from hil.proof.score.tables import (
    Table,
    checking,
    effects_table,
    goals_table,
    others_table,
    power_table,
    verdicts_table,
    worst_tables,
)
from hil.proof.seal import read_seal
from hil.quantities import digits
from hil.report.page import Number, Page

SCORES, REPORT, MARKDOWN = "scores.json", "report.html", "proof.md"
_PICTURES = (
    (
        "power",
        pictures.power_figure,
        "Share of the cases of the ladder that are found, over the size of what is "
        "concealed: what it changes in the recordings beyond anything that other nominal parameters could, over the "
        "noise. Bars: 95 % intervals (Wilson).",
    ),
    (
        "confusion",
        pictures.confusion_figure,
        "Singles, the ladder from the floor on, novel physics, nulls, and wrong "
        "parameters. Rows: what is concealed; columns: the first name, or the verdict where none is given.",
    ),
    (
        "calibration",
        pictures.calibration_figure,
        "Findings of all tiers in bins of confidence: on the dashed line a "
        "confidence of 80 % is right four times in five.",
    ),
    (
        "errors",
        pictures.errors_figure,
        "Each point is a parameter of a single effect that was rightly named. Phases "
        "count in radians, harmonics relative to the first amplitude.",
    ),
    ("times", pictures.times_figure, "Time of each diagnosis on this machine, beside as many others as ran at once."),
)


def write_proof(scores: Scores, others: Mapping[str, Scores], folder: Path) -> None:
    """Write report.html with its PNGs, proof.md and scores.json; `others` are the scores of other methods."""
    goals = (*scores.goals, *((lead(scores, others),) if others else ()))
    seal = read_seal(folder) or {}
    missed = [goal for goal in goals if goal.met is False]
    told = sum(goal.met is not None for goal in goals)
    heading, about = (
        "Proof: concealed effects, diagnosed blind",
        (f"{_of(len(scores.cases), seal['cases'])} cases, seed {seal['seed']}, sealed {seal['sealed_at']}"),
    )
    verdict = f"{told - len(missed)} of {told} goals reached." + (
        f" Not reached: {', '.join(goal.name for goal in missed)}." if missed else ""
    )
    before = [goals_table(goals), *([others_table(scores, others)] if others else []), verdicts_table(scores)]
    after = [effects_table(scores), *worst_tables(scores)]

    page = Page(heading, about, verdict, told > 0 and not missed)
    for table in before:
        _add(page, table)
    for name, draw, caption in _PICTURES:
        figure = draw(scores)
        if figure is not None:
            page.heading(name.capitalize())
            page.picture(save(figure, folder / f"{name}.png"), caption)
    for table in after:
        _add(page, table)
    page.heading("How to check it")
    page.items(checking(seal))
    page.write(folder / REPORT)
    parts = [
        f"# {heading}",
        f"{about}. {_time(scores)}{verdict}",
        *(_markdown(table) for table in (*before, power_table(scores), *after)),
        "## How to check it",
        "\n".join(f"- {text}" for text in checking(seal)),
    ]
    write_text(folder / MARKDOWN, "\n\n".join(part for part in parts if part) + "\n")
    write_json(
        folder / SCORES,
        _scores_json(scores, goals, seal)
        | {"others": {name: [_goal_json(goal) for goal in other.goals] for name, other in others.items()}},
    )


def _of(scored: int, sealed: int) -> str:
    return f"{scored}" if scored == sealed else f"The first {scored} of {sealed}"


def _add(page: Page, table: Table) -> None:
    if not table.rows:
        return
    if table.heading:
        page.heading(table.heading)
    if table.text:
        page.text(table.text)
    page.table(table.headers, table.rows, table.mark)


def _markdown(table: Table) -> str:
    """A table in Markdown with its heading; empty where it has no rows."""
    if not table.rows:
        return ""
    right = [all(isinstance(row[at], Number) for row in table.rows) for at in range(len(table.headers))]
    lines = [table.headers, ["---:" if number else "---" for number in right], *table.rows]
    parts = [
        f"## {table.heading}" if table.heading else "",
        table.text,
        "\n".join("| " + " | ".join(cell.replace("|", "/") for cell in line) + " |" for line in lines),
    ]
    return "\n\n".join(part for part in parts if part)


def _times(scores: Scores) -> list[float]:
    return [case.reply.runtime_s for case in scores.cases if case.reply.runtime_s is not None]


def _time(scores: Scores) -> str:
    times = _times(scores)
    return (
        f"A diagnosis took {digits(quantile(times, 0.5) or 0.0)} s in the median, {digits(max(times))} s at most. "
        if times
        else ""
    )


def _scores_json(scores: Scores, goals: Sequence[Goal], seal: dict[str, Any]) -> dict[str, Any]:
    times, singles = _times(scores), scores.of_tier("single")
    return {
        "schema_version": 1,
        "seal": seal,
        "goals": [_goal_json(goal) for goal in goals],
        "verdicts": verdicts(scores.cases),
        "confusion": confusion(scores.cases),
        "effects": {effect: _rate_json(found) for effect, found in by_effect(singles, lambda case: case.top).items()},
        "power": [
            {"size": rung.size, "detected": _rate_json(rung.detected), "named": _rate_json(rung.named)}
            for rung in power(scores.cases)
        ],
        "calibration": [
            {"confidence": found.confidence, "right": _rate_json(found.right)} for found in scores.calibration
        ],
        "runtime_s": {"median": quantile(times, 0.5), "p90": quantile(times, 0.9), "longest": max(times, default=None)},
        "cases": [_case_json(case) for case in scores.cases],
    }


def _goal_json(goal: Goal) -> dict[str, Any]:
    found = (
        _rate_json(goal.measured)
        if isinstance(goal.measured, Rate)
        else {"value": goal.value if goal.value is not None and isfinite(goal.value) else None, "of": goal.of}
    )
    return {
        "name": goal.name,
        "detail": goal.detail,
        "low": goal.low,
        "high": goal.high if isfinite(goal.high) else None,
        **found,
        "met": goal.met,
    }


def _rate_json(found: Rate) -> dict[str, Any]:
    return {"value": found.value, "hits": found.hits, "of": found.of, "interval_95": found.interval}


def _case_json(case: Marked) -> dict[str, Any]:
    reply = case.reply
    return {
        "name": case.truth.name,
        "tier": case.truth.tier,
        "axis": case.truth.axis,
        "concealed": [
            {"effect": effect.effect, "form": effect.form, "size": effect.size} for effect in case.truth.effects
        ],
        "verdict": reply.verdict,
        "named": [
            {"effect": named.effect, "equivalents": named.equivalents, "confidence": named.confidence}
            for named in reply.named
        ],
        "block": reply.location.get("block"),
        "parameter_errors": case.parameter_errors(),
        "right": case.right,
        "wrong": case.wrong,
        "runtime_s": reply.runtime_s,
    }
