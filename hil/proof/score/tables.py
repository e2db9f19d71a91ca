"""The tables of a proof, for the page and for Markdown: goals, other methods, verdicts, effects, power, worst cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

from hil.diagnosis.wording import title
from hil.proof.score.confusion import by_effect, power, verdicts
from hil.proof.score.grading import Marked
from hil.proof.score.scores import Goal, Scores
from hil.proof.score.statistics import Rate
from hil.proof.seal import CASES
from hil.quantities import digits
from hil.report.page import Number

HEADERS = ("", "goal", "measured", "95 %", "of", "reached")
_WORST = 5


@dataclass(frozen=True)
class Table:
    """A table with its heading and what is to be said before it; `mark` is a column of yes and no."""

    heading: str
    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    text: str = ""
    mark: int | None = None


def goals_table(goals: Sequence[Goal]) -> Table:
    """Goals beside what was measured."""
    return Table("Goals", HEADERS, [goal_row(goal) for goal in goals], mark=5)


def goal_row(goal: Goal) -> tuple[str, ...]:
    """A row of the table of goals."""
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


def others_table(scores: Scores, others: Mapping[str, Scores]) -> Table:
    """Rates of other methods by the same score, of so many of the cases."""
    rows = [{goal.name: goal for goal in other.goals} for other in others.values()]
    headers = [f"{name} ({len(found.cases)} cases)" for name, found in {"this diagnosis": scores, **others}.items()]
    return Table(
        "Beside other methods",
        ("", *headers),
        [
            (goal.name, Number(_text(goal, goal.value)), *(Number(_text(goal, row[goal.name].value)) for row in rows))
            for goal in scores.goals
            if isinstance(goal.measured, Rate) and any(row[goal.name].value is not None for row in rows)
        ],
        "The same recordings, the same score. What a method does not say counts as wrong; where it was not given all "
        "cases, its rates are of those that it was given.",
    )


def verdicts_table(scores: Scores) -> Table:
    """How often each verdict was given, by tier."""
    found = verdicts(scores.cases)
    columns = sorted({verdict for counts in found.values() for verdict in counts})
    return Table(
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


def effects_table(scores: Scores) -> Table:
    """Singles, effect by effect."""
    singles = scores.of_tier("single")
    columns = [
        by_effect(singles, lambda case: case.top),
        by_effect(singles, lambda case: case.in_set),
        by_effect(singles, lambda case: not case.names_too_much),
        by_effect(singles, lambda case: case.block_right),
    ]
    return Table(
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


def power_table(scores: Scores) -> Table:
    """Detection and naming over the size of the effect."""
    return Table(
        "Power over the size of the effect",
        ("size over noise", "cases", "said to be missing", "95 %", "named first", "95 %"),
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


def worst_tables(scores: Scores) -> list[Table]:
    """The cases that are wrong in the surest way: by the confidence of what is not there, then by size."""
    wrong = sorted(
        (case for case in scores.cases if not case.right),
        reverse=True,
        key=lambda case: (max((named.confidence or 0.0 for named in case.spurious), default=0.0), case.size),
    )
    heading = f"The worst of {len(wrong)} cases that are not wholly right"
    return [
        Table(heading if not at else "", (case.truth.name, case.wrong), _rows(case))
        for at, case in enumerate(wrong[:_WORST])
    ]


def checking(seal: Mapping[str, Any]) -> list[str]:
    """How the proof can be checked and done again."""
    libraries = ", ".join(f"{name} {version}" for name, version in seal["versions"].items())
    return [
        f"What is concealed was written to sealed/truths.json before any diagnosis; its SHA-256 is "
        f"{seal['truths_sha256']}. It holds the SHA-256 of every recording and bench.",
        "The diagnosis ran in a process of its own that is given the folder of recordings: python -m "
        "hil.proof.answer.blind cases answers gives the same answers without sealed/ on the machine.",
        f"Drawn and diagnosed by {seal['command']}, commit {seal['git_commit'] or 'unknown'}"
        f"{' with changes' if seal['git_changed'] else ''}, {libraries}.",
    ]


def _rows(case: Marked) -> list[tuple[str, str]]:
    truth, reply = case.truth, case.reply
    hidden = [
        f"{title(effect.effect)}{f' ({title(effect.form)})' if effect.form else ''}, {digits(effect.size)} × the "
        "noise: " + ", ".join(f"{name} {digits(value, 4)}" for name, value in effect.parameters.items())
        for effect in truth.effects
    ]
    place = f"{CASES}/{truth.name}"
    return [
        ("tier and axis", f"{title(truth.tier)}, {title(truth.axis)}"),
        ("concealed", "; ".join(hidden) or "nothing"),
        ("verdict", title(reply.verdict)),
        ("named", "; ".join(_finding(case, index) for index in range(len(reply.named))) or "nothing"),
        ("in its words", reply.statement),
        (
            "to see it",
            f"hil diagnose {place}/train_*.parquet --validate {place}/holdout.parquet --bench {place}/bench.yaml",
        ),
    ]


def _finding(case: Marked, index: int) -> str:
    named = case.reply.named[index]
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
