"""The verdict of a diagnosis as one sentence."""

import math
from collections.abc import Sequence

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import AT_FLOOR, AxisChange, Correction, Finding, FitFigures, Result, Verdict
from hil.diagnosis.wording import title
from hil.quantities import percent, quantity


def statement(result: Result) -> str:
    """The verdict as one sentence."""
    if result.verdict is Verdict.MISSING_PHYSICS:
        named = _sentences(result.missing)
        name, entry = max(result.fit.items(), key=lambda item: _improvement(item[1].train))
        found = entry.validate_ or entry.train
        before, after, noise = (
            quantity(value, entry.unit) for value in (found.best_before_rms, found.after_rms, found.noise_floor_rms)
        )
        change = (
            f"decreases from {before} to {after}"
            if found.after_rms < found.best_before_rms
            else (f"does not decrease: {after} instead of {before}")
        )
        surest = max(one.confidence for one in result.missing)
        doubt = "" if surest >= CRITERIA.likely else f", doubtful by its confidence ({percent(surest)})"
        where = "held-out" if entry.validate_ else "these"
        return (
            f"Missing physics{doubt}: {named} With all of it the residual of {name} on {where} recordings {change} "
            f"rms; the noise floor is {noise}.{_left(result)}"
        )
    if result.verdict is Verdict.PARAMETER_ERROR:
        worst = sorted(result.parameter_corrections.items(), key=lambda item: -_growth(item[1]))
        changes = ", ".join(_changed(name, one) for name, one in worst[:3])
        if not changes:
            return "No physics is missing, but parameters of the bench file are wrong; this motion does not tell them."
        return f"No physics is missing; parameters of the bench file are wrong: {changes}."
    if result.verdict is Verdict.NO_MISMATCH:
        return "The twin reproduces these recordings to within their noise."
    if result.change is not None:
        return f"{_of_axis(result.change, result)}{_left(result)}"
    if result.time_budget:
        return f"The time budget ended before a mechanism was found: {result.unexplained.description}"
    if result.partial:
        part = _sentences(result.partial)
        share = percent(1.0 - result.unexplained.share)
        return (
            f"No mechanism of the library explains the whole mismatch. Found, for {share} of its energy above the "
            f"noise: {part} {result.unexplained.description}"
        )
    return f"The mismatch is not explained by any mechanism of the library: {result.unexplained.description}"


def _of_axis(change: AxisChange, result: Result) -> str:
    """Say which parameters of the axis changed, where, and their value in each recording or before and after."""
    where, parts = "between the recordings", [f"in {part}" for part in change.parts]
    if change.moment_s is not None:
        where, parts = f"at {change.moment_s:.2f} s of {change.recording}", list(change.parts)
    told = "; ".join(
        f"{one.name} "
        + ", ".join(
            f"{quantity(entry.value, entry.unit)} {part}" for entry, part in zip(one.values, parts, strict=True)
        )
        for one in change.parameters
    )
    if result.verdict is Verdict.AXIS_CHANGED:
        return f"The axis changed {where}: {told}. With values of each part no physics is missing."
    share = percent(1.0 - result.unexplained.share)
    return (
        f"No mechanism of the library explains the whole mismatch. Parameters that change {where} explain {share} of "
        f"it: {told}."
    )


def _growth(one: Correction) -> float:
    """Absolute logarithm of value over nominal, infinite over a zero; 0 where their ratio says nothing: of angles."""
    if one.unit == "rad" or one.value * one.nominal < 0.0:
        return 0.0
    return abs(math.log(one.value / one.nominal)) if one.nominal else math.inf


def _changed(name: str, one: Correction) -> str:
    if 0.0 < _growth(one) < math.inf:
        return f"{name} {100.0 * (one.value / one.nominal - 1.0):+.1f} %"
    return f"{name} {quantity(one.value, one.unit)} instead of {quantity(one.nominal, one.unit)}"


def _left(result: Result) -> str:
    """Return the residuals above the noise floor as a sentence; empty if there are none."""
    told = result.unexplained.description
    return "" if told == AT_FLOOR else f" Not explained: {told[0].lower()}{told[1:]}"


def _sentences(found: Sequence[Finding]) -> str:
    """The sentences of findings that are more likely there than not, and the names of the others."""
    likely = [one for one in found if one.confidence >= CRITERIA.likely] or found
    doubtful = ", ".join(f"{title(one.effect)} ({percent(one.confidence)})" for one in found if one not in likely)
    sentences = " ".join(one.sentence for one in likely)
    return f"{sentences} Doubtful, by their confidence: {doubtful}." if doubtful else sentences


def _improvement(found: FitFigures) -> float:
    return found.best_before_rms / max(found.after_rms, 1e-300)
