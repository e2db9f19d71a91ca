"""What a late tick is: its lateness, its cycle time, and when the loop no longer waits for one in time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from bench_runs import MOVE, MOVING, bench_with, run

from drivers.cia402 import POWERED
from hil.errors import HilError
from hil.loop.bounds import make_cycle
from hil.loop.clock import VirtualClock, next_due
from hil.loop.devices import Rig
from hil.loop.session import Session
from hil.loop.stall import late_limit_s
from hil.loop.supervision import Ending
from hil.motion.trajectory import plan

PERIOD_S = 1e-3
WORK_S = 0.0003


class Late(VirtualClock):
    """Each tick is late by a value of `late_s`, and its work takes WORK_S."""

    def __init__(self, late_s: Callable[[int], float]) -> None:
        self.late_s, self.waits = late_s, 0

    def wait(self, tick: int) -> float:
        self.waits += 1
        assert self.waits < 5000, "the loop waits for a tick in time for ever"
        return self.late_s(tick)

    def since(self, tick: int) -> float:
        return self.late_s(tick) + WORK_S


class Rows:
    """Rows of a run, by channel."""

    def __init__(self, channels: tuple[str, ...]) -> None:
        self.channels, self.rows = channels, []

    def record(self, row: Any) -> None:
        self.rows.append(list(row))

    def __getitem__(self, channel: str) -> list[float]:
        return [row[self.channels.index(channel)] for row in self.rows]


def run_late(late_s: Callable[[int], float]) -> tuple[Any, Rows, Rig]:
    """Run MOVE by that clock."""
    with Rig(bench_with(drive={"mode": "csp"})) as rig:
        rig.set_up()
        limits = MOVE.motion_limits
        cycle = make_cycle(rig, rig.drive.read(0.0).motor_position_rad, limits)
        rows = Rows(cycle.channels)
        session = Session(rig, cycle, plan(MOVE, PERIOD_S, 0.0), limits, Late(late_s), rows)
        return session.run(), rows, rig


def test_lateness_counts_from_the_first_tick_left_out() -> None:
    class Stalled(VirtualClock):
        def wait(self, tick: int) -> float:
            return {10: 0.0029, 13: 0.0006, 14: 0.0002}.get(tick, 0.0)

    assert next_due(Stalled(), 10, PERIOD_S, 0.0029) == (14, pytest.approx(0.0042), 4)
    assert next_due(VirtualClock(), 2, PERIOD_S, 0.1008) == (103, pytest.approx(0.101), 101)


@pytest.mark.parametrize("limit_s", [0.0, 0.001, 0.0075])
def test_no_tick_is_waited_for_beyond_the_limit(limit_s: float) -> None:
    clock = Late(lambda tick: 0.0009)
    due = next_due(clock, 100, PERIOD_S, 0.0009, limit_s)
    assert limit_s < due.lateness_s < limit_s + 2 * PERIOD_S
    assert due.skipped == due.tick - 100 == clock.waits


def test_a_loop_that_is_always_late_is_stopped() -> None:
    """Each tick is late by more than half a period, none by a whole one: no tick in time ever comes."""
    outcome, rows, rig = run_late(lambda tick: 0.0009 if tick >= MOVING else 0.0)
    assert outcome.ending is Ending.OVERRUN
    limit_s = late_limit_s(rig.bench)
    assert limit_s < max(rows["lateness_s"]) < limit_s + 2 * PERIOD_S
    assert rig.nodes.drive.state not in POWERED


def test_the_work_of_a_tick_counts_from_its_own_wake_up() -> None:
    """With every tick a little late, and ten left out in between, whose time is no work of the next one."""
    outcome, rows, _ = run_late(lambda tick: 0.0105 if tick == MOVING else 0.0001)
    assert outcome.ending is Ending.COMPLETE
    assert outcome.skipped == 11
    assert rows["cycle_s"][:-1] == pytest.approx([WORK_S] * (len(rows.rows) - 1))
    assert sorted(rows["lateness_s"])[-2:] == pytest.approx([0.0001, 0.0111])


def test_a_stall_within_a_tick_while_arming_is_told_as_such(tmp_path: Path) -> None:
    """The drive misses its master at the tick that stalls: the loop was late, not the drive at fault."""

    def script(rig: Rig, session: Session) -> Mapping[int, Callable[[], Any]]:
        def stall() -> None:
            session._clock.since = lambda tick: 0.2
            rig.nodes.drive.emergency(0x8130, 0x11, 0.003)

        return {3: stall}

    with pytest.raises(HilError, match=r"the loop was 0\.200 s late while the drive was armed"):
        run(tmp_path, script=script)
