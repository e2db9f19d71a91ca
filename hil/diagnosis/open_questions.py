"""Sentences on open questions: causes that the recordings do not separate, mechanisms that the motion cannot show."""

from hil.diagnosis.result import Result, Verdict
from hil.diagnosis.wording import listed, title, titles
from hil.twin.library import BY_ID, LIBRARY

_EXAMPLES = 3


def cannot_show(result: Result) -> str:
    """How many mechanisms of the library the motion cannot show, with one example of a block; empty for none."""
    hidden = result.not_testable
    if not hidden:
        return ""
    blocks = {BY_ID[effect].block: effect for effect in reversed(hidden)}
    examples = listed([title(effect) for effect in reversed(blocks.values())][:_EXAMPLES])
    return f"This motion cannot show {len(hidden)} of {len(LIBRARY)} mechanisms, such as {examples}."


def no_experiment(result: Result) -> str:
    """Say why no motion was designed: nothing is open, or nothing could be designed."""
    tied = [f"{title(one.effect)} from {titles(one.equivalents)}" for one in result.findings if one.equivalents]
    is_open = f"Open: these recordings do not separate {listed(tied)}. " if tied else ""
    if result.time_budget:
        return f"{is_open}None was designed, because the time budget ended the search."
    if result.change:
        return "None was designed: no motion tells of an axis that changed meanwhile."
    if tied or result.verdict is Verdict.UNEXPLAINED or (result.not_testable and not result.findings):
        return f"{is_open}None was designed: that needs a known control law, and a twin that holds its closed loop."
    if result.not_testable:
        return f"No other cause of what is named is open. {cannot_show(result)}"
    return "No question is open that another motion could answer."
