"""Result of a session."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil.loop.supervision import Ending


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
