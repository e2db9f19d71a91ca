"""Truths, answers and their marks, made by hand."""

from __future__ import annotations

from typing import Any

from hil.validation.proof.answer.answers import parse_answer
from hil.validation.proof.draw.expected import block, same_law
from hil.validation.proof.draw.generator import Concealed, Truth
from hil.validation.proof.score.grading import GradedCase
from hil.validation.proof.score.scores import Goal, Scores, score

VERDICTS = {"null": "no_mismatch", "parameters_only": "parameter_error", "insufficient": "parameter_error",
            "novel": "unexplained"}  # fmt: skip


def concealed(effect: str, size: float = 10.0, place: dict[str, Any] | None = None, **parameters: float) -> Concealed:
    return Concealed(
        effect,
        "",
        parameters,
        size,
        same_law(effect),
        block(effect),
        place or {},
        parameters if same_law(effect) else {},
    )


def truth(tier: str, *effects: Concealed, **more: Any) -> Truth:
    plain: dict[str, Any] = {
        "name": "case",
        "number": 0,
        "seed": 0,
        "axis": "two_mass",
        "rivals": (),
        "not_testable": (),
        "believed_parameters": {},
        "noise": {},
        "true_parameters": {"lead_m": 0.01, "table_mass_kg": 100.0},
    }
    return Truth(tier=tier, effects=effects, verdict=VERDICTS.get(tier, "missing_physics"), **plain | more)


def finding(
    effect: str, *equivalents: str, confidence: float | None = None, **parameters: tuple[float, float]
) -> dict[str, Any]:
    return {
        "effect": effect,
        "equivalents": equivalents,
        "confidence": confidence,
        "parameters": {name: {"value": value, "std": std} for name, (value, std) in parameters.items()},
    }


def marked(of: Truth, *missing: dict[str, Any], verdict: str = "", **more: Any) -> GradedCase:
    said = verdict or ("missing_physics" if missing else "unexplained")
    return GradedCase(of, parse_answer({"verdict": said, "missing": missing, **more}))


def scores(*cases: tuple[Truth, dict[str, Any] | None]) -> Scores:
    """Score truths with their answers."""
    return score(
        {str(at): of for at, (of, _) in enumerate(cases)},
        {str(at): parse_answer(answer) for at, (_, answer) in enumerate(cases) if answer is not None},
    )


def goals(found: Scores) -> dict[str, Goal]:
    return {goal.name: goal for goal in found.goals}
