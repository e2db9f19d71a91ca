"""Stalls of the loop of any length, at any phase of the heartbeats: a late loop, whichever frame is missing then."""

from __future__ import annotations

import random

import pytest
from fault_kinds import _late_cycle, _stall_within
from observed_run import Stage, bench_with, observe

from drivers.cia402 import DriveState
from drivers.port import Condition
from hil.loop.stall import late_limit_s
from hil.loop.supervision import Ending

MODES = ("cst", "csv", "csp")
MARGIN_S = 0.001  # a stall inside a tick is one period longer than the lateness of the next


@pytest.mark.parametrize("within", [False, True], ids=["before a tick", "within a tick"])
@pytest.mark.parametrize("seed", range(36))
def test_a_stall_ends_as_a_late_loop_or_not_at_all(seed: int, within: bool) -> None:
    rng = random.Random(seed)
    deadline_s = rng.choice((None, 0.05, 0.2)) if seed % 2 else None
    bench = bench_with(drive={"mode": MODES[seed % 3], "command_deadline_s": deadline_s, "overrun_s": 0.5})
    stall_s = rng.uniform(0.002, 0.3) if seed % 4 else rng.uniform(0.038, 0.062)  # around both watchdogs, too
    make = _stall_within if within else _late_cycle
    stage = Stage(DriveState.OPERATION_ENABLED, rng.randrange(30, 250), 1)
    seen = observe(bench, stage, make(stall_s, stall_s), rng)
    assert seen.outcome is not None, seen.error
    limit_s, about = late_limit_s(bench), f"{stall_s:.4f} s: {seen.outcome.reason}"
    if stall_s > limit_s + MARGIN_S:
        assert seen.outcome.ending is Ending.OVERRUN, about
        assert "the loop was" in seen.outcome.reason
    else:  # the axis may not follow afterwards, but no watchdog has acted
        assert seen.outcome.ending in (Ending.COMPLETE, Ending.OVERRUN), about
        assert not seen.rig.drive.tripped & (Condition.FAULT | Condition.EMERGENCY | Condition.HEARTBEAT_LOST), about
