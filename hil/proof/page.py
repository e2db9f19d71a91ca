"""The page of a proof: goals beside what was measured, pictures, the worst cases, and all numbers as scores.json."""

from __future__ import annotations

from math import inf, isfinite
from pathlib import Path
from typing import Any

from hil.proof.marking import Marked
from hil.proof.score import Goal, Scores, verdicts
from hil.proof.seal import read_seal
from hil.proof.statistics import Rate
from hil.report.look import digits
from hil.report.output import write_json
from hil.report.page import Number

SCORES, REPORT = "scores.json", "report.html"
HEADERS = ("", "goal", "measured", "95 % interval", "of", "reached")


def write_proof(scores: Scores, folder: Path) -> None:
    """Write scores.json."""
    write_json(folder / SCORES, {
        "seal": read_seal(folder), "goals": [_goal_json(goal) for goal in scores.goals],
        "verdicts": verdicts(scores.cases), "cases": [_case_json(case) for case in scores.cases]})


def goal_row(goal: Goal) -> tuple[str, ...]:
    """A row of the table of goals."""
    name = f"{goal.name} ({goal.detail.replace('_', ' ')})" if goal.detail else goal.name
    return (name, _wanted(goal), Number(_text(goal, goal.value)), Number(_interval(goal)),
            Number(str(goal.measured.of if isinstance(goal.measured, Rate) else goal.of)),
            {None: "–", True: "yes", False: "no"}[goal.met])


def _wanted(goal: Goal) -> str:
    low, high = _text(goal, goal.low), _text(goal, goal.high)
    if goal.met is None and (goal.low, goal.high) == (0.0, inf):
        return "–"
    if goal.low == 0.0:
        return f"≤ {high}"
    return f"≥ {low}" if goal.high == inf else f"{low} to {high}"


def _text(goal: Goal, value: float | None) -> str:
    if value is None:
        return "–"
    if not isfinite(value):
        return "none given"
    return digits(value) if "IoU" in goal.name or "calibration" in goal.name else f"{digits(100.0 * value)} %"


def _interval(goal: Goal) -> str:
    if not isinstance(goal.measured, Rate):
        return ""
    low, high = goal.measured.interval
    return f"{100.0 * low:.1f} to {100.0 * high:.1f} %"


def _goal_json(goal: Goal) -> dict[str, Any]:
    interval = goal.measured.interval if isinstance(goal.measured, Rate) else None
    return {"name": goal.name, "detail": goal.detail, "low": goal.low, "high": _finite(goal.high),
            "measured": _finite(goal.value), "interval_95": interval,
            "of": goal.measured.of if isinstance(goal.measured, Rate) else goal.of, "met": goal.met}


def _case_json(case: Marked) -> dict[str, Any]:
    reply = case.reply
    return {"name": case.truth.name, "tier": case.truth.tier, "axis": case.truth.axis,
            "concealed": [{"effect": effect.effect, "form": effect.form, "size": effect.size}
                          for effect in case.truth.effects],
            "verdict": reply.verdict, "named": [{"effect": named.effect, "equivalents": named.equivalents,
                                                 "confidence": named.confidence} for named in reply.named],
            "right": case.right, "wrong": case.wrong, "runtime_s": reply.runtime_s}


def _finite(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None
