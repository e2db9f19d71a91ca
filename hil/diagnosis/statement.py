"""The verdict of a diagnosis as one sentence."""

import math
from collections.abc import Sequence

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.improvement import improvement
from hil.diagnosis.open_questions import cannot_show
from hil.diagnosis.result import (
    AT_FLOOR,
    CLOCK,
    MOMENT,
    NO_STRUCTURE,
    TREND,
    AxisChange,
    Finding,
    Result,
    TorqueLeft,
    Verdict,
)
from hil.diagnosis.value import Correction
from hil.diagnosis.wording import listed, named, spoken, titles
from hil.identification.coordinates import DELAY
from hil.identification.least_squares import SIGMAS
from hil.quantities import percent, quantity

_MORE = 1.1  # times what plain least squares leave, from which a reader asks


def statement(result: Result) -> str:
    """The verdict as one sentence, after one on clocks that run apart where no other change is told."""
    clocks = [one.text for one in result.structure if one.over == CLOCK]
    if result.verdict is Verdict.UNEXPLAINED and clocks and not result.change:
        rest = tuple(one for one in result.structure if one.over != CLOCK)
        after = statement(result.model_copy(update={"structure": rest}))
        return f"{clocks[0][:1].upper()}{clocks[0][1:]}. {after}"
    if result.verdict is Verdict.MISSING_PHYSICS:
        return f"{_found('Missing physics', result.missing)} {improvement(result)}{_left(result)}"
    if result.verdict is Verdict.PARAMETER_ERROR:
        sure = [item for item in result.parameter_corrections.items() if _sure(item[1])]
        worst = sorted(sure, key=lambda item: -_growth(item[1]))
        changes = ", ".join(_changed(name, one) for name, one in worst[:3])
        told = f"parameters of the bench file are wrong: {changes}." if changes else _together(result.torque_left)
        return " ".join(filter(None, (f"No physics is missing; {told}", cannot_show(result))))
    if result.verdict is Verdict.NO_MISMATCH:
        told, wanders = _leaves(result.torque_left), _wandering(result.unexplained.description)
        nothing = "The twin reproduces these recordings to within their noise."
        if told or wanders:
            beside = f": the twin {told}, without a structure" if told else ""
            nothing = f"Nothing is missing that these recordings show{beside}."
        return " ".join(filter(None, (nothing, wanders, cannot_show(result))))
    if result.change is not None:
        return f"{_of_axis(result.change, result)}{_left(result)}"
    if result.time_budget and not result.partial:
        return f"The time budget ended before the mismatch was explained{_unexplained(result)}"
    if result.partial:
        share = percent(1.0 - result.unexplained.share)
        return (
            f"{'The time budget ended, and no' if result.time_budget else 'No'} mechanism of the library explains the "
            f"whole mismatch. {_found(f'For {share} of its energy above the noise', result.partial)}{_left(result)}"
        )
    what = "The mismatch is not explained by any mechanism of the library"
    if result.unexplained.description == AT_FLOOR:
        what = "No named physics is missing"
    return f"{what}{_unexplained(result)}"


def explained(result: Result) -> bool:
    """True if the answer is sure and nothing above the noise, and no structure, is left."""
    sure = not result.missing or max(one.confidence for one in result.missing) >= CRITERIA.likely
    whole = result.verdict is not Verdict.UNEXPLAINED and not result.time_budget and not result.partial
    nothing = result.verdict is Verdict.NO_MISMATCH or result.unexplained.description == AT_FLOOR
    return whole and sure and not result.structure and nothing


def _wandering(left: str) -> str:
    """Sentence on channels whose remainder is above their white noise and has no structure; empty without one."""
    if NO_STRUCTURE not in left:
        return ""
    return f"{left.removesuffix('.')}: noise that wanders, or a random disturbance."


def _found(before: str, found: Sequence[Finding]) -> str:
    """What is there, in one sentence each; then what may be there, in one clause."""
    likely = [one for one in found if one.confidence >= CRITERIA.likely]
    others = [one for one in found if one not in likely and one.confidence >= CRITERIA.named]
    perhaps = listed([f"{named(one)} ({percent(one.confidence)})" for one in others])
    if not likely:
        likely = [max(found, key=lambda one: one.confidence)]
        perhaps = listed([f"{named(one)} ({percent(one.confidence)})" for one in others if one not in likely])
        before = f"{before}, doubtful by its confidence ({percent(likely[0].confidence)})"
    told = f"{before}: {' '.join(map(_sentence, likely))}"
    return f"{told} Perhaps also {perhaps}." if perhaps else told


def _sentence(one: Finding) -> str:
    """The sentence of a finding, with its equal rivals."""
    if not one.equivalents:
        return one.sentence
    return f"{one.sentence.removesuffix('.')} (or {titles(one.equivalents)}: these recordings do not separate them)."


def _of_axis(change: AxisChange, result: Result) -> str:
    """Say which parameters of the axis changed, where, and their value in each recording or before and after."""
    where, parts = "between the recordings", [f"in {part}" for part in change.parts]
    if change.moment_s is not None:
        where, parts = f"at {change.moment_s:.2f} s of {change.recording}", list(change.parts)
    told = "; ".join(
        f"{spoken(one.name.rpartition('.')[2])} "
        + ", ".join(
            f"{quantity(entry.value, entry.unit)} {part}" for entry, part in zip(one.values, parts, strict=True)
        )
        for one in change.parameters
    )
    if result.verdict is Verdict.AXIS_CHANGED:
        delays = all(one.name == DELAY for one in change.parameters)
        clocks = "The clocks of torque and position shifted (rows lost, or a clock that was set)"
        what = clocks if delays else "The axis changed"
        return f"{what} {where}: {told}. With values of each part no physics is missing."
    share = percent(1.0 - result.unexplained.share)
    return (
        f"No mechanism of the library explains the whole mismatch. Parameters that change {where} explain {share} of "
        f"it: {told}."
    )


def _sure(one: Correction) -> bool:
    return abs(one.value - one.nominal) > SIGMAS * one.std


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
    """What is left above the noise as a sentence, and what it depends on; empty if nothing is."""
    told = result.unexplained.description
    if told == AT_FLOOR:
        return _depends(result)
    noise = told.count(NO_STRUCTURE) == told.count(" times")
    return f" {_wandering(told) if noise else f'Not explained: {told[:1].lower()}{told[1:]}'}{_depends(result)}"


def _unexplained(result: Result) -> str:
    """Describe a mismatch without a name: residuals above the noise, else the structure below the noise of a row."""
    if result.unexplained.description != AT_FLOOR:
        return f": {result.unexplained.description}{_depends(result)}"
    if result.structure:
        return f"; below the noise of a row, {'; '.join(_strongest(result))}."
    told = _leaves(result.torque_left)
    return f"; every channel is within its noise{f', and the twin {told}' if told else ''}."


def _leaves(left: TorqueLeft | None) -> str:
    """The share of the torque that a twin leaves, and plain least squares, as a verb; empty if it is not known."""
    if left is None or left.final is None:
        return ""
    more = _MORE * left.plain < left.final <= left.plain + CRITERIA.discrepancy
    by_far = f" (right models differ by up to {percent(CRITERIA.discrepancy)})" if more else ""
    return (
        f"leaves {percent(left.final)} of the torque on held-out motion unexplained, plain least squares "
        f"{percent(left.plain)}{by_far}"
    )


def _together(left: TorqueLeft | None) -> str:
    """Say of parameters that are better together, none of which is surely wrong alone."""
    told = "its parameters fit better together as refitted, and none of them is surely wrong by itself"
    if left is None or left.owner is None or left.final is None:
        return f"{told}."
    return (
        f"{told}. The torque left on held-out motion is {percent(left.final)}, by the bench file {percent(left.owner)}."
    )


def _strongest(result: Result) -> list[str]:
    """The strongest structure that is left, and how a parameter or a clock changes over time."""
    return [one.text for at, one in enumerate(result.structure) if at == 0 or one.over in (MOMENT, TREND, CLOCK)]


def _depends(result: Result) -> str:
    """Sentences on the structure that is left, and on how much of it maps leave; empty without a structure."""
    told = _strongest(result)
    maps = "".join(
        f" On held-out motion a map of the {one.effect.removeprefix('unnamed_').replace('_', ' ')} leaves "
        f"{percent(one.held_out_after / one.held_out_before)} of that residual (rms; bench.diagnosed.yaml has it)."
        for one in result.unnamed
    )
    return f" Structure is left: {'; '.join(told)}.{maps}" if told else ""
