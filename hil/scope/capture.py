"""Rows at rest that a page shows, and the search for the trigger that makes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hil.scope.messages import Arm
from hil.scope.rows import FixedRows, ScopeRows
from hil.scope.traces import BEFORE, Trace
from hil.scope.trigger import beginnings, crossings


@dataclass(frozen=True)
class Still:
    """Rows at rest and the stretch of them that is shown, by row numbers. zero_s: time of the trigger."""

    rows: FixedRows
    first: int
    end: int
    zero_s: float = 0.0


class Waiting:
    """A trigger that is armed at the row `begin`."""

    def __init__(self, message: Arm, begin: int) -> None:
        self.message = message
        self._searched = begin  # rows before it are searched
        self._found: int | None = None  # row at which it came

    def look(self, rows: ScopeRows, traces: Mapping[str, Trace]) -> Still | None:
        """Search the rows that came; return the capture as soon as all of its rows are there, or no further one comes.

        It holds the rows of the loop, not points of the screen.
        """
        message, ended, end = self.message, rows.ended, rows.end
        if self._found is None and end > self._searched:
            # two rows more: the one before the first searched one, and the one before that for its velocity
            block = rows.read(self._searched - 1 - BEFORE, end)
            if message.event is None:
                at = block.first + crossings(traces[message.trace].values(block.columns), message.level, message.slope)
            else:
                at = block.first + beginnings(block.columns, message.event)
            at = at[at >= self._searched]
            self._searched = end
            self._found = int(at[0]) if at.size else None
        if self._found is None:
            return None
        first = self._found - round(message.pre_s / rows.period_s)
        after = self._found + round(message.post_s / rows.period_s) + 1
        if end < after and not ended:
            return None
        source = rows if isinstance(rows, FixedRows) else FixedRows.copy(rows, first - BEFORE, after)
        if source.first == source.end:  # written over, since the page was slow: the next trigger
            self._found = None
            return None
        at_trigger = min(max(self._found - source.first, 0), source.end - source.first - 1)
        zero_s = float(source.columns["time_s"][at_trigger])
        return Still(source, max(first, source.first), min(after, source.end), zero_s)
