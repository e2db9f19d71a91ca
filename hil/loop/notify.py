"""Tell systemd that the loop is ready, alive and ending: the sd_notify protocol, and a clock that uses it.

The protocol (sd_notify(3)): one datagram of lines NAME=VALUE to the AF_UNIX socket that NOTIFY_SOCKET names; a name
that begins with @ is in the abstract namespace. WATCHDOG_USEC is the time within which WATCHDOG=1 must come again.

The watchdog is fed by the clock of the loop, from the loop's own thread, and only when a later tick is waited for: a
loop that hangs, or that waits for the same tick again, is ended by systemd, and the drive misses its heartbeat.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from contextlib import suppress

from hil.loop.clock import WallClock

FEEDS = 4  # per time-out of the watchdog: three may be lost
CLOSING_S = 30.0  # for the recording to be written, on a slow disk, and for the process to end


class Notifier:
    """Sends states to the service manager; does nothing where the program was not started by one.

    environ: NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID as systemd sets them.
    """

    def __init__(self, environ: Mapping[str, str] = os.environ) -> None:
        self._socket: socket.socket | None = None
        self._address = environ.get("NOTIFY_SOCKET", "")
        if self._address[:1] in ("/", "@"):  # sd_notify knows no others on AF_UNIX
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)  # the loop never waits for the manager
            self._address = "\0" + self._address[1:] if self._address[0] == "@" else self._address
        for_us = environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        microseconds = environ.get("WATCHDOG_USEC", "") if for_us else ""
        self.watchdog_s = int(microseconds) * 1e-6 if microseconds.isdecimal() else 0.0  # 0: no watchdog

    def send(self, *states: str) -> None:
        """Send states such as READY=1 in one datagram. A manager that does not listen is no reason to stop an axis:
        errors are ignored, and an unfed watchdog shows them."""
        if self._socket is not None:
            lines = "\n".join(state.replace("\n", " ") for state in states)  # a line of a text would be another state
            with suppress(OSError):
                self._socket.sendto(lines.encode(), self._address)

    def stopping(self, status: str) -> None:
        """Tell that the loop has ended: no tick feeds the watchdog any more, which then allows CLOSING_S."""
        longer = (f"WATCHDOG_USEC={CLOSING_S * 1e6:.0f}", "WATCHDOG=1") if self.watchdog_s else ()
        self.send("STOPPING=1", f"STATUS={status}", *longer)

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class NotifyingClock(WallClock):
    """Wall clock that reports its start and its ticks to the service manager."""

    def __init__(self, period_s: float, notifier: Notifier) -> None:
        super().__init__(period_s)
        self._notifier, self._tick_s = notifier, period_s
        # without a watchdog the status is renewed once in 10 s
        self._spacing = max(1, int((notifier.watchdog_s / FEEDS or 10.0) / period_s))
        self._next_feed = 0

    def start(self) -> None:
        """Start the clock; the service counts as started."""
        super().start()
        self._next_feed = self._spacing
        self._notifier.send("READY=1", "WATCHDOG=1", "STATUS=the loop runs")

    def wait(self, tick: int) -> float:
        """Wait for the tick and feed the watchdog if it is due by the number of the tick."""
        late_s = super().wait(tick)
        if tick >= self._next_feed:
            self._next_feed = tick + self._spacing
            self._notifier.send("WATCHDOG=1", f"STATUS=the loop runs: tick {tick}, {tick * self._tick_s:.0f} s")
        return late_s
