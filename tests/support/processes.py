"""Waiting for what another process does, and whether it is over."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

DEADLINE_S = 300.0  # a hang, not a measure of speed: a machine may stand still for seconds


def wait_for(condition: Callable[[], bool], deadline_s: float = DEADLINE_S, step_s: float = 0.005) -> None:
    """Wait until it is true, asking every `step_s`; fails after `deadline_s`."""
    end = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(step_s)


def state_of(pid: int) -> str:
    """Letter of a process's state in /proc: T when stopped; empty or Z when it is over."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return ""


def is_over(pid: int) -> bool:
    """Return True if a process has ended; its parent may not have been told yet."""
    return state_of(pid) in ("", "Z")
