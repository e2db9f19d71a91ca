"""Result of a session."""

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.port import Condition
from hil.loop.supervision import Ending

_STOPS = {
    Condition.RUNAWAY: "the drive's own stop accelerated the axis, which happens with a wrong phase order or encoder "
    "direction in the drive: its power was switched off",
    Condition.UNANSWERED: "the drive did not follow its controlword: SYNC, heartbeat and set-points were withheld",
}


@dataclass(frozen=True)
class Outcome:
    """Ending of a run, its reason in words, number of rows, lateness of its ticks [s], ticks left out, and whether the
    user asked for a stop, for whatever reason it ended."""

    ending: Ending
    reason: str
    rows: int
    lateness_s: Sequence[float]
    skipped: int = 0
    stop_asked: bool = False


def with_stop(ending: Ending, reason: str, tripped: Condition) -> tuple[Ending, str]:
    """Return ending and reason with what the drive did of its last stop command; tripped: its conditions."""
    texts = [text for condition, text in _STOPS.items() if tripped & condition]
    failed = Ending.DRIVE_FAULT if texts and ending is Ending.COMPLETE else ending
    return failed, "; ".join([reason, *texts])
