"""The page of a proof: goals beside what was measured, pictures, the worst cases, and all numbers as scores.json."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.wording import title
from hil.proof import pictures
from hil.proof.marking import Marked
from hil.proof.score import Goal, Scores, lead
from hil.proof.seal import CASES, read_seal
from hil.proof.statistics import Rate
from hil.proof.tallies import by_effect, confusion, power, verdicts
from hil.report.figures import save
from hil.report.look import digits
from hil.report.output import write_json
from hil.report.page import Number, Page

SCORES, REPORT = "scores.json", "report.html"
HEADERS = ("", "goal", "measured", "95 %", "of", "reached")
_WORST = 5
_PICTURES = (
    ("power", pictures.power_figure, "Share of the cases of the ladder that are found, over the size of what is "
     "concealed: what it changes in the recordings beyond anything that other nominal parameters could, over the "
     "noise. Bars: 95 % intervals (Wilson)."),
    ("confusion", pictures.confusion_figure, "Singles, the ladder from the floor on, novel physics, nulls, and wrong "
     "parameters. Rows: what is concealed; columns: the first name, or the verdict where none is given."),
    ("calibration", pictures.calibration_figure, "Findings of all tiers in bins of confidence: on the dashed line a "
     "confidence of 80 % is right four times in five."),
    ("errors", pictures.errors_figure, "Each point is a parameter of a single effect that was rightly named. Phases "
     "count in radians, harmonics relative to the first amplitude."),
    ("times", pictures.times_figure, "Time of each diagnosis on this machine, beside as many others as ran at once."))


def write_proof(scores: Scores, others: Mapping[str, Scores], folder: Path) -> None:
    """Write report.html with its PNGs, and scores.json; `others` are those of other methods on the same cases."""
    goals = (*scores.goals, *((lead(scores, others),) if others else ()))
    seal = read_seal(folder) or {}
    missed = [goal for goal in goals if goal.met is False]
    told = sum(goal.met is not None for goal in goals)
    page = Page("Proof: concealed effects, diagnosed blind",
                f"{len(scores.cases)} cases, seed {seal['seed']}, sealed {seal['sealed_at']}",
                f"{told - len(missed)} of {told} goals reached."
                + (f" Not reached: {', '.join(goal.name for goal in missed)}." if missed else ""), not missed)
    page.heading("Goals")
    page.table(HEADERS, [goal_row(goal) for goal in goals], mark=5)
    if others:
        _beside(page, scores, others)
    page.heading("Verdicts")
    page.table(("tier", "verdicts"), [
        (title(tier), ", ".join(f"{title(verdict)} {number}" for verdict, number in found.items()))
        for tier, found in verdicts(scores.cases).items()])
    for name, draw, caption in _PICTURES:
        figure = draw(scores)
        if figure is not None:
            page.heading(title(name).capitalize())
            page.picture(save(figure, folder / f"{name}.png"), caption)
    _effects(page, scores)
    _worst(page, scores)
    page.heading("How to check it")
    page.items([
        f"What is concealed was written to sealed/truths.json before any diagnosis; its SHA-256 is "
        f"{seal['truths_sha256']}. It holds the SHA-256 of every recording and bench.",
        "The diagnosis ran in a process of its own that is given the folder of recordings: python -m hil.proof.blind "
        "cases answers gives the same answers without sealed/ on the machine.",
        f"Drawn and diagnosed by {seal['command']}, commit {seal['git_commit'] or 'unknown'}"
        f"{' with changes' if seal['git_changed'] else ''}, "
        + ", ".join(f"{name} {version}" for name, version in seal["versions"].items()) + "."])
    write_json(folder / SCORES, _scores_json(scores, goals, seal)
               | {"others": {name: [_goal_json(goal) for goal in other.goals] for name, other in others.items()}})
    page.write(folder / REPORT)


def goal_row(goal: Goal) -> tuple[str, ...]:
    """A row of the table of goals."""
    name = f"{goal.name} ({title(goal.detail)})" if goal.detail else goal.name
    interval = ""
    if isinstance(goal.measured, Rate) and goal.measured.of:
        interval = "{:.1f}–{:.1f} %".format(*(100.0 * value for value in goal.measured.interval))
    return (name, _wanted(goal), Number(_text(goal, goal.value)), Number(interval),
            Number(str(goal.measured.of if isinstance(goal.measured, Rate) else goal.of)),
            {None: "–", True: "yes", False: "no"}[goal.met])


def _wanted(goal: Goal) -> str:
    low, high = _text(goal, goal.low), _text(goal, goal.high)
    if (goal.low, goal.high) == (0.0, inf):
        return "–"
    if goal.low == 0.0:
        return f"≤ {high}"
    return f"≥ {low}" if goal.high == inf else f"{low.removesuffix(' %')}–{high}"


def _text(goal: Goal, value: float | None) -> str:
    if value is None:
        return "–"
    if not isfinite(value):
        return "none given"
    return f"{digits(100.0 * value)} %" if goal.percent else digits(value)


def _beside(page: Page, scores: Scores, others: Mapping[str, Scores]) -> None:
    """Other methods on the same cases, by the same score."""
    page.heading("Beside other methods")
    page.text("The same recordings, the same score. What a method does not say is not scored.")
    rows = {name: {goal.name: goal for goal in other.goals} for name, other in others.items()}
    page.table(("", "this diagnosis", *rows),
               [(goal.name, Number(_text(goal, goal.value)),
                 *(Number(_text(found[goal.name], found[goal.name].value)) for found in rows.values()))
                for goal in scores.goals if isinstance(goal.measured, Rate)
                and any(found[goal.name].value is not None for found in rows.values())])


def _effects(page: Page, scores: Scores) -> None:
    singles = scores.of_tier("single")
    if not singles:
        return
    page.heading("Singles, effect by effect")
    columns = [by_effect(singles, lambda case: case.top), by_effect(singles, lambda case: case.in_set),
               by_effect(singles, lambda case: not case.spurious), by_effect(singles, lambda case: case.block_right)]
    page.table(("effect", "cases", "named first", "in the set", "nothing else named", "block right"),
               [(title(effect), Number(str(columns[0][effect].of)),
                 *(Number(f"{100.0 * (column[effect].value or 0.0):.0f} %") for column in columns))
                for effect in columns[0]])


def _worst(page: Page, scores: Scores) -> None:
    """The cases that are wrong in the surest way: by the confidence of what is not there, then by size."""
    wrong = sorted((case for case in scores.cases if not case.right), reverse=True,
                   key=lambda case: (max((named.confidence or 0.0 for named in case.spurious), default=0.0), case.size))
    page.heading(f"The worst cases of {len(wrong)} that are not wholly right" if wrong else "Every answer is right")
    for case in wrong[:_WORST]:
        truth, reply = case.truth, case.reply
        hidden = [f"{title(effect.effect)}{f' ({effect.form})' if effect.form else ''}, {digits(effect.size)} × the "
                  "noise: " + ", ".join(f"{name} {digits(value, 4)}" for name, value in effect.parameters.items())
                  for effect in truth.effects]
        page.table((truth.name, case.wrong), [
            ("tier and axis", f"{title(truth.tier)}, {title(truth.axis)}"),
            ("concealed", "; ".join(hidden) or "nothing"), ("verdict", title(reply.verdict)),
            ("named", "; ".join(_finding(case, index) for index in range(len(reply.named))) or "nothing"),
            ("in its words", reply.statement),
            ("to see it", f"hil diagnose {CASES}/{truth.name}/train_*.parquet --validate {CASES}/{truth.name}/"
                          f"holdout.parquet --bench {CASES}/{truth.name}/bench.yaml")])


def _finding(case: Marked, index: int) -> str:
    named = case.reply.named[index]
    parts = [title(named.effect)]
    parts += [f"or {', '.join(map(title, named.equivalents))}"] if named.equivalents else []
    parts += [f"confidence {100.0 * named.confidence:.0f} %"] if named.confidence is not None else []
    parts += [f"{name} {digits(value, 4)}" for name, (value, _) in named.parameters.items()]
    return ", ".join(parts)


def _scores_json(scores: Scores, goals: tuple[Goal, ...], seal: dict[str, Any]) -> dict[str, Any]:
    times = [case.reply.runtime_s for case in scores.cases if case.reply.runtime_s is not None]
    singles = scores.of_tier("single")
    return {
        "schema_version": 1, "seal": seal, "goals": [_goal_json(goal) for goal in goals],
        "verdicts": verdicts(scores.cases), "confusion": confusion(scores.cases),
        "effects": {effect: _rate_json(found) for effect, found in by_effect(singles, lambda case: case.top).items()},
        "power": [{"size": rung.size, "detected": _rate_json(rung.detected), "named": _rate_json(rung.named)}
                  for rung in power(scores.cases)],
        "calibration": [{"confidence": found.confidence, "right": _rate_json(found.right)}
                        for found in scores.calibration],
        "runtime_s": {"median": float(np.median(times)), "p90": float(np.quantile(times, 0.9)), "longest": max(times)}
        if times else None,
        "cases": [_case_json(case) for case in scores.cases]}


def _goal_json(goal: Goal) -> dict[str, Any]:
    found = _rate_json(goal.measured) if isinstance(goal.measured, Rate) else {
        "value": goal.value if goal.value is not None and isfinite(goal.value) else None, "of": goal.of}
    return {"name": goal.name, "detail": goal.detail, "low": goal.low,
            "high": goal.high if isfinite(goal.high) else None, **found, "met": goal.met}


def _rate_json(found: Rate) -> dict[str, Any]:
    return {"value": found.value, "hits": found.hits, "of": found.of, "interval_95": found.interval}


def _case_json(case: Marked) -> dict[str, Any]:
    reply = case.reply
    return {"name": case.truth.name, "tier": case.truth.tier, "axis": case.truth.axis,
            "concealed": [{"effect": effect.effect, "form": effect.form, "size": effect.size}
                          for effect in case.truth.effects],
            "verdict": reply.verdict, "named": [{"effect": named.effect, "equivalents": named.equivalents,
                                                 "confidence": named.confidence} for named in reply.named],
            "block": reply.location.get("block"), "parameter_errors": case.parameter_errors(), "right": case.right,
            "wrong": case.wrong, "runtime_s": reply.runtime_s}
