"""Tables of a proof for the page and for Markdown: goals, other methods, verdicts, effects, power, worst cases."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any

from hil.diagnosis.wording import title
from hil.errors import InputError
from hil.quantities import digits
from hil.validation.proof.score.grading import GradedCase
from hil.validation.proof.score.scores import Goal, Scores
from hil.validation.proof.score.statistics import Rate, by_effect, power, verdicts
from hil.validation.proof.seal import CASES

PUBLISHED = Path(__file__).parents[1] / "results"  # results of sealed runs, one JSON file per run
HEADERS = ("", "goal", "measured", "95 %", "of", "reached")
_WORST = 5


@dataclass(frozen=True)
class ProofTable:
    """A table with its heading and introduction; columns beside `left` and `mark`, that of yes and no, hold numbers."""

    heading: str
    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    text: str = ""
    left: Collection[int] = (0,)
    mark: int | None = None


def goals_table(goals: Sequence[Goal]) -> ProofTable:
    """Return the table of goals and measured figures."""
    return ProofTable("Goals", HEADERS, [goal_row(goal) for goal in goals], left=(0, 1), mark=5)


def goal_row(goal: Goal) -> tuple[str, ...]:
    """Return a row of the table of goals."""
    name = f"{goal.name} ({title(goal.detail)})" if goal.detail else goal.name
    interval, of = (_interval(goal.measured), goal.measured.of) if isinstance(goal.measured, Rate) else ("", goal.of)
    return (
        name,
        _wanted(goal),
        _text(goal, goal.value),
        interval,
        str(of),
        {None: "–", True: "yes", False: "no"}[goal.met],
    )


def others_table(scores: Scores, others: Mapping[str, Scores]) -> ProofTable:
    """Return the table of the rates of other methods."""
    rows = [{goal.name: goal for goal in other.goals} for other in others.values()]
    return ProofTable(
        "Beside other methods",
        ("", *(f"{name} ({len(found.cases)} cases)" for name, found in {"this diagnosis": scores, **others}.items())),
        [
            (goal.name, *(_text(goal, one.value) for one in (goal, *(row[goal.name] for row in rows))))
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
    rows = []
    for tier, counts in found.items():
        right = sum(case.right for case in scores.of_tier(tier))
        rows.append((title(tier), *(str(counts.get(verdict, 0)) for verdict in columns), str(right)))
    return ProofTable("Verdicts", ("tier", *map(title, columns), "wholly right"), rows)


def effects_table(scores: Scores) -> ProofTable:
    """Return the table of singles by effect."""
    singles = scores.of_tier("single")
    first, *columns = [
        by_effect(singles, lambda case: case.top),
        by_effect(singles, lambda case: case.in_set),
        by_effect(singles, lambda case: not case.names_too_much),
        by_effect(singles, lambda case: case.block_right),
    ]
    return ProofTable(
        "Singles, effect by effect",
        ("effect", "cases", "named first", "in the set", "nothing else named", "block right"),
        [
            (title(effect), str(named.of), *(_share(one) for one in (named, *(column[effect] for column in columns))))
            for effect, named in first.items()
        ],
    )


def power_table(scores: Scores) -> ProofTable:
    """Return the table of detection and naming over the size of the effect."""
    return ProofTable(
        "Power over the size of the effect",
        ("size over noise", "cases", "detected", "95 %", "named first", "95 %"),
        [
            (
                f"{rung.size:g}",
                str(rung.named.of),
                _share(rung.detected),
                _interval(rung.detected),
                _share(rung.named),
                _interval(rung.named),
            )
            for rung in power(scores.cases)
        ],
        left=(),
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
        ProofTable(heading if not at else "", (case.truth.name, case.wrong), _rows(case), left=(0, 1))
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
    tables = [ProofTable(**table, left=range(len(table["headers"]))) for table in data["tables"]]
    notes = "\n".join(f"- {note}" for note in data["notes"])
    parts = [f"# {data['title']}", data["about"], *map(markdown, tables), notes]
    return "\n\n".join(part for part in parts if part)


def markdown(table: ProofTable) -> str:
    """Return a table in Markdown with its heading; empty if it has no rows."""
    if not table.rows:
        return ""
    texts = {*table.left, table.mark}
    lines = [table.headers, ["---" if at in texts else "---:" for at in range(len(table.headers))], *table.rows]
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


def _share(found: Rate) -> str:
    return f"{100.0 * (found.value or 0.0):.0f} %"


def _interval(found: Rate) -> str:
    return "{:.1f}–{:.1f} %".format(*(100.0 * value for value in found.interval)) if found.of else ""
