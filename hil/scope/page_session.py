"""What one open page sees: rows that roll, a stretch at rest, or a capture of the trigger. It knows no network.

`step` takes the messages of the page and returns what is to be sent. It is called 30 times a second.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.scope import answers
from hil.scope import messages as page
from hil.scope.capture import Still, Waiting
from hil.scope.decimation import min_max, point_times, stretch
from hil.scope.messages import frame, note
from hil.scope.rows import FixedRows, ReplayedRows, RingRows, ScopeRows
from hil.scope.status import status
from hil.scope.traces import Trace, compute, traces_of

STATUS_STEPS = 6  # status is told every sixth step: 5 Hz


class PageSession:
    """What a page sees. live: returns the rows of the run that goes on; or one or two recordings."""

    def __init__(
        self,
        live: Callable[[], RingRows | None] | None = None,
        recordings: Sequence[FixedRows] = (),
        about: dict[str, Any] | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s  # of a replay
        self._live, self._recordings, self._about = live, tuple(recordings), about or {}
        self._second = traces_of(recordings[1].channels, recordings[1].metadata) if len(recordings) > 1 else {}
        self._rows: ScopeRows | None = None
        self._traces: dict[str, Trace] = {}
        self._seen = page.See(do="see", traces=[], window_s=10.0, points=1000)
        self._still: Still | None = None
        self._waiting: Waiting | None = None
        self._sent = -1  # rows before it are on the page; -1: the whole window is to be sent
        self._steps = 0
        self._told = ""  # the mode that the page knows
        self._out: list[str | bytes] = []

    def step(self, texts: Sequence[str] = ()) -> list[str | bytes]:
        """Take messages of the page, return messages and frames for it."""
        self._out = []
        self._find_rows()
        for text in texts:
            try:
                self._take(page.read_message(text))
            except InputError as error:
                self._out.append(note("refused", text=str(error)))
        if self._rows is not None:
            if self._waiting is not None:
                self._search(self._rows, self._waiting)
            elif self._still is None:
                self._roll(self._rows)
            if self._steps % STATUS_STEPS == 0 or self.mode != self._told:
                self._told = self.mode
                self._out.append(note("status", mode=self.mode, **status(self._rows, self._traces)))
        self._steps += 1
        return self._out

    @property
    def mode(self) -> str:
        """Rolling, held (rows at rest), or waiting for a trigger."""
        if self._waiting is not None:
            return "waiting"
        return "rolling" if self._still is None else "held"

    def cut(self, from_s: float | None, to_s: float | None) -> FixedRows:
        """Copy of the rows of a stretch of time, or of what is shown. Raises InputError if nothing is."""
        rows, first, end = self._stretch(from_s, to_s)
        return FixedRows.copy(rows, first, end)

    # -- rows ---------------------------------------------------------------------------------------------------------

    def _find_rows(self) -> None:
        """Take up the rows of a new run, unless the page holds what it shows."""
        if self._live is not None:
            rows = self._live()
            if rows is not None and rows is not self._rows and (self._still is None or self._waiting is not None):
                self._begin(rows)
        elif self._rows is None:
            self._begin(self._recordings[0])
            self._show_all()

    def _begin(self, rows: ScopeRows) -> None:
        self._rows, self._still, self._sent = rows, None, -1
        self._traces = traces_of(rows.channels, rows.metadata)
        if self._waiting is not None:  # in the new run, too, if it has the trace
            message = self._waiting.message
            self._waiting = Waiting(message, rows.first) if message.event or message.trace in self._traces else None
        self._out.append(answers.of_rows(rows, self._traces, self._recordings, self._about))

    def _show_all(self) -> None:
        recording = self._recordings[0]
        self._still = Still(recording, recording.first, recording.end)

    def _window(self, rows: ScopeRows) -> tuple[int, int]:
        """Rows of the rolling window."""
        end = rows.end
        return max(rows.first, end - round(self._seen.window_s / rows.period_s)), end

    def _stretch(self, from_s: float | None, to_s: float | None) -> tuple[ScopeRows, int, int]:
        if self._rows is None:
            raise InputError("there are no rows yet: start a run")
        if self._still is None:
            rows: ScopeRows = self._rows
            first, end = self._window(rows)
            if from_s is not None and to_s is not None:
                rows = FixedRows.copy(rows, rows.first, end)
        else:
            rows, first, end = self._still.rows, self._still.first, self._still.end
        if from_s is not None and to_s is not None and isinstance(rows, FixedRows):
            first = rows.number_at(min(from_s, to_s))
            end = max(first + 2, rows.number_at(max(from_s, to_s)) + 1)
        first, end = max(first, rows.first), min(end, rows.end)
        if first >= end:
            raise InputError("there are no rows in this stretch of time: choose another one")
        return rows, first, end

    # -- messages -----------------------------------------------------------------------------------------------------

    def _take(self, message: page.AnyMessage) -> None:
        match message:
            case page.See():
                self._seen, self._sent = message, -1
                self._draw_still()
            case page.Hold():
                self._hold(message.on)
            case page.Show():
                self._show(message)
            case page.Arm():
                self._arm(message)
            case page.Disarm():
                self._waiting, self._sent = None, -1
                self._draw_still()
            case page.Play():
                self._play(message)
            case page.Measure():
                names = [name for name in self._seen.traces if name in self._traces]
                _, values = self._values(message.from_s, message.to_s, names)
                self._out.append(answers.measured(names, values))
            case page.AskSpectrum():
                rows, values = self._values(message.from_s, message.to_s, [message.trace])
                self._out.append(answers.spectrum(message.trace, values, rows.period_s))
            case page.AgainstEachOther():
                names = [message.x, message.y]
                self._out.append(answers.against(names, self._values(message.from_s, message.to_s, names)[1]))

    def _hold(self, on: bool) -> None:
        if on and self._still is None and self._rows is not None:
            first, end = self._window(self._rows)
            self._still = Still(FixedRows.copy(self._rows, self._rows.first, end), first, end)
            self._draw_still()
        elif not on:
            self._still, self._waiting, self._sent = None, None, -1
            if self._recordings and not isinstance(self._rows, ReplayedRows):
                self._show_all()
                self._draw_still()

    def _show(self, message: page.Show) -> None:
        self._hold(True)
        if self._still is None:
            return
        rows, zero_s = self._still.rows, self._still.zero_s
        if message.from_s is None or message.to_s is None:
            self._still = Still(rows, rows.first, rows.end, zero_s)
        else:
            _, first, end = self._stretch(message.from_s, message.to_s)
            self._still = Still(rows, first, end, zero_s)
        self._draw_still()

    def _play(self, message: page.Play) -> None:
        if not self._recordings:
            raise InputError("play: given a run that goes on, allowed a recording: hil scope RECORDING")
        recording = self._recordings[0]
        begin = recording.number_at(message.from_s)
        self._begin(
            ReplayedRows(recording, begin if begin < recording.end else recording.first, message.speed, self._now_s)
        )

    # -- drawing ------------------------------------------------------------------------------------------------------

    def _chosen(self, names: Sequence[str]) -> list[Trace]:
        unknown = [name for name in names if name not in self._traces]
        if unknown:
            raise InputError(f"trace: given {unknown[0]!r:.60}, allowed {listed(self._traces)}")
        return [self._traces[name] for name in names]

    def _values(self, from_s: float | None, to_s: float | None, names: Sequence[str]) -> tuple[ScopeRows, FloatArray]:
        traces = self._chosen(names)
        rows, first, end = self._stretch(from_s, to_s)
        return rows, compute(rows, first, end, traces)[1]

    def _points(
        self, kind: str, rows: ScopeRows, traces: Mapping[str, Trace], first: int, end: int, step: int,
        shift_s: float = 0.0, **content: Any,
    ) -> int:  # fmt: skip
        """Send the points of the traces that the page shows; returns the number of the first row."""
        shown = [traces[name] for name in self._seen.traces if name in traces]
        first, values = compute(rows, first, end, shown)
        points = np.vstack((point_times(values[0], step) + shift_s, min_max(values[1:], step)))
        self._out.append(frame(kind, points, traces=[trace.name for trace in shown], step=step, **content))
        return first

    def _draw_still(self) -> None:
        """Send the stretch at rest, and that of the second recording beside it."""
        if self._still is None:
            return
        rows, first, end, zero_s = self._still.rows, self._still.first, self._still.end, self._still.zero_s
        step = stretch(end - first, self._seen.points)
        self._points("view", rows, self._traces, first, end, step, zero_s=zero_s, still=True)
        if len(self._recordings) > 1 and first < end:
            other, shift_s = self._recordings[1], self._seen.shift_s
            times = rows.columns["time_s"]
            begin = other.number_at(float(times[first - rows.first]) - shift_s)
            stop = other.number_at(float(times[end - 1 - rows.first]) - shift_s) + 1
            step = stretch(stop - begin, self._seen.points)
            self._points("second", other, self._second, begin, stop, step, shift_s=shift_s)

    def _roll(self, rows: ScopeRows) -> None:
        """Send the rows that came since the last step, or the whole window."""
        window = round(self._seen.window_s / rows.period_s)
        step = stretch(window, self._seen.points)
        end = rows.end // step * step
        if self._sent < 0 or self._sent < rows.first:
            first = -(-self._window(rows)[0] // step) * step
            if first < end:
                self._points(
                    "view", rows, self._traces, first, end, step, zero_s=0.0, still=False, window_s=self._seen.window_s
                )
                self._sent = end
        elif end > self._sent:
            came = self._points("append", rows, self._traces, self._sent, end, step)
            self._sent = end if came == self._sent else -1  # lapped meanwhile: send the whole window
        if isinstance(rows, ReplayedRows) and rows.ended:
            self._begin(self._recordings[0])
            self._show_all()
            self._draw_still()

    # -- trigger and measurements -------------------------------------------------------------------------------------

    def _arm(self, message: page.Arm) -> None:
        if self._rows is None:
            raise InputError("arm: there are no rows yet: start a run")
        if message.event is None:
            self._chosen([message.trace])
        rows, begin = self._rows, self._rows.end
        if isinstance(rows, FixedRows):  # a recording is searched from the last trigger on
            last = self._still.zero_s if self._still is not None and self._still.zero_s else None
            begin = rows.first if last is None else rows.number_at(last) + 1
        self._waiting = Waiting(message, begin)

    def _search(self, rows: ScopeRows, waiting: Waiting) -> None:
        """Show the capture when the trigger has come and all of its rows are there."""
        captured = waiting.look(rows, self._traces)
        if captured is not None:
            again = waiting.message.again and not rows.ended
            self._still, self._waiting = captured, Waiting(waiting.message, captured.end) if again else None
            self._draw_still()
            self._out.append(note("triggered", time_s=captured.zero_s, again=again))
        elif rows.ended and isinstance(rows, FixedRows):
            self._waiting = None
            self._out.append(note("refused", text="the trigger does not come in the rest of this recording"))
