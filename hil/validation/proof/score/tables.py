"""Tables of a proof for the page and for Markdown: goals, other methods, verdicts, effects, power, worst cases."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any

from hil.diagnosis.wording import title
from hil.errors import InputError
from hil.quantities import digits
from hil.report.page import Number
from hil.validation.proof.score.grading import GradedCase
from hil.validation.proof.score.scores import Goal, Scores
from hil.validation.proof.score.statistics import Rate, by_effect, power, verdicts
from hil.validation.proof.seal import CASES

PUBLISHED = Path(__file__).parents[1] / "results"  # results of sealed runs, one JSON file per run
HEADERS = ("", "goal", "measured", "95 %", "of", "reached")
_WORST = 5


@dataclass(frozen=True)
class ProofTable:
    """A table with its heading and introduction; `mark`: index of a column of yes and no."""

    heading: str
    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    text: str = ""
    mark: int | None = None


def goals_table(goals: Sequence[Goal]) -> ProofTable:
    """Return the table of goals and measured figures."""
    return ProofTable("Goals", HEADERS, [goal_row(goal) for goal in goals], mark=5)


def goal_row(goal: Goal) -> tuple[str, ...]:
    """Return a row of the table of goals."""
    name = f"{goal.name} ({title(goal.detail)})" if goal.detail else goal.name
    interval = _interval(goal.measured) if isinstance(goal.measured, Rate) else ""
    return (
        name,
        _wanted(goal),
        Number(_text(goal, goal.value)),
        Number(interval),
        Number(str(goal.measured.of if isinstance(goal.measured, Rate) else goal.of)),
        {None: "–", True: "yes", False: "no"}[goal.met],
    )


def others_table(scores: Scores, others: Mapping[str, Scores]) -> ProofTable:
    """Return the table of the rates of other methods."""
    rows = [{goal.name: goal for goal in other.goals} for other in others.values()]
    headers = [f"{name} ({len(found.cases)} cases)" for name, found in {"this diagnosis": scores, **others}.items()]
    return ProofTable(
        "Beside other methods",
        ("", *headers),
        [
            (goal.name, Number(_text(goal, goal.value)), *(Number(_text(goal, row[goal.name].value)) for row in rows))
            for goal in scores.goals
            if isinstance(goal.measured, Rate) and any(row[goal.name].value is not None for row in rows)
        ],
        "Same recordings, same score. What a method does not report counts as wrong; the number of cases that it was "
        "given is in the heading. All other methods use this project's refit of the nominal parameters, its periods, "
        "orders and windows, and its materiality limit; fit_everything also uses the starts and the fit of its search.",
    )


def verdicts_table(scores: Scores) -> ProofTable:
    """Return the table of verdicts by tier."""
    found = verdicts(scores.cases)
    columns = sorted({verdict for counts in found.values() for verdict in counts})
    return ProofTable(
        "Verdicts",
        ("tier", *map(title, columns), "wholly right"),
        [
            (
                title(tier),
                *(Number(str(counts.get(verdict, 0))) for verdict in columns),
                Number(str(sum(case.right for case in scores.of_tier(tier)))),
            )
            for tier, counts in found.items()
        ],
    )


def effects_table(scores: Scores) -> ProofTable:
    """Return the table of singles by effect."""
    singles = scores.of_tier("single")
    columns = [
        by_effect(singles, lambda case: case.top),
        by_effect(singles, lambda case: case.in_set),
        by_effect(singles, lambda case: not case.names_too_much),
        by_effect(singles, lambda case: case.block_right),
    ]
    return ProofTable(
        "Singles, effect by effect",
        ("effect", "cases", "named first", "in the set", "nothing else named", "block right"),
        [
            (
                title(effect),
                Number(str(columns[0][effect].of)),
                *(Number(f"{100.0 * (column[effect].value or 0.0):.0f} %") for column in columns),
            )
            for effect in columns[0]
        ],
    )


def power_table(scores: Scores) -> ProofTable:
    """Return the table of detection and naming over the size of the effect."""
    return ProofTable(
        "Power over the size of the effect",
        ("size over noise", "cases", "detected", "95 %", "named first", "95 %"),
        [
            (
                Number(f"{rung.size:g}"),
                Number(str(rung.named.of)),
                *(
                    Number(text)
                    for found in (rung.detected, rung.named)
                    for text in (f"{100.0 * (found.value or 0.0):.0f} %", _interval(found))
                ),
            )
            for rung in power(scores.cases)
        ],
    )


def worst_tables(scores: Scores) -> list[ProofTable]:
    """Return a table for each of the worst cases, ordered by the confidence of spurious findings, then by size."""
    wrong = sorted(
        (case for case in scores.cases if not case.right),
        reverse=True,
        key=lambda case: (max((named.confidence or 0.0 for named in case.spurious), default=0.0), case.size),
    )
    heading = f"The worst of {len(wrong)} cases that are not wholly right"
    return [
        ProofTable(heading if not at else "", (case.truth.name, case.wrong), _rows(case))
        for at, case in enumerate(wrong[:_WORST])
    ]


def checking(seal: Mapping[str, Any]) -> list[str]:
    """Return how to check and repeat the proof."""
    libraries = ", ".join(f"{name} {version}" for name, version in seal["versions"].items())
    return [
        f"The truth was written to sealed/truths.json before any diagnosis; its SHA-256 is {seal['truths_sha256']}. It "
        "contains the SHA-256 of every recording and bench.",
        "The diagnosis ran in a separate process that only gets the folder of recordings: python -m "
        "hil.validation.proof.answer.blind cases answers gives the same answers without sealed/ on the machine.",
        f"Drawn and diagnosed by {seal['command']}, commit {seal['git_commit'] or 'unknown'}"
        f"{' with changes' if seal['git_changed'] else ''}, {libraries}.",
    ]


def published(name: str) -> str:
    """Return the published results of a sealed run in Markdown. Raises InputError for an unknown name."""
    path = PUBLISHED / f"{name}.json"
    if not path.is_file():
        names = ", ".join(sorted(path.stem for path in PUBLISHED.glob("*.json")))
        raise InputError(f"--show: given {name}, allowed {names}")
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    tables = [ProofTable(table["heading"], table["headers"], table["rows"], table["text"]) for table in data["tables"]]
    notes = "\n".join(f"- {note}" for note in data["notes"])
    parts = [f"# {data['title']}", data["about"], *map(markdown, tables), notes]
    return "\n\n".join(part for part in parts if part)


def markdown(table: ProofTable) -> str:
    """Return a table in Markdown with its heading; empty if it has no rows."""
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


def _rows(case: GradedCase) -> list[tuple[str, str]]:
    truth, answer = case.truth, case.answer
    hidden = [
        f"{title(effect.effect)}{f' ({title(effect.form)})' if effect.form else ''}, {digits(effect.size)} × the "
        "noise: " + ", ".join(f"{name} {digits(value, 4)}" for name, value in effect.parameters.items())
        for effect in truth.effects
    ]
    place = f"{CASES}/{truth.name}"
    return [
        ("tier and axis", f"{title(truth.tier)}, {title(truth.axis)}"),
        ("concealed", "; ".join(hidden) or "nothing"),
        ("verdict", title(answer.verdict)),
        ("named", "; ".join(_finding(case, index) for index in range(len(answer.named))) or "nothing"),
        ("in its words", answer.statement),
        (
            "to see it",
            f"hil diagnose {place}/train_*.parquet --validate {place}/holdout.parquet --bench {place}/bench.yaml",
        ),
    ]


def _finding(case: GradedCase, index: int) -> str:
    named = case.answer.named[index]
    parts = [title(named.effect)]
    parts += [f"or {', '.join(map(title, named.equivalents))}"] if named.equivalents else []
    parts += [f"confidence {100.0 * named.confidence:.0f} %"] if named.confidence is not None else []
    parts += [f"{name} {digits(value, 4)}" for name, (value, _) in named.parameters.items()]
    return ", ".join(parts)


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


def _interval(found: Rate) -> str:
    return "{:.1f}–{:.1f} %".format(*(100.0 * value for value in found.interval)) if found.of else ""
