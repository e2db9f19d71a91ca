"""ctrl-C at every line of the session, any number of times: the power stage is off afterwards."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from bench_runs import ScriptedClock, bench_with

from drivers.cia402 import POWERED, DriveState
from hil.errors import StoppedByUser
from hil.loop import session as session_module
from hil.loop.bounds import make_cycle
from hil.loop.devices import Rig
from hil.loop.run import _interruptible
from hil.loop.session import Session
from hil.motion.profile import Profile
from hil.motion.trajectory import plan

SOURCE = str(Path(session_module.__file__))
SHORT = Profile.model_validate(
    {
        "schema_version": 1,
        "limits": {"velocity_m_s": 0.6, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
        "segments": [{"kind": "dwell", "duration_s": 0.02}],
    }
)
ASKED = 10  # tick


class NoRows:
    """A recorder that keeps nothing."""

    def record(self, row: Sequence[float]) -> None:
        """Discard the row."""


def interrupted_run(asked: int, at_line: Callable[[int, Rig], None]) -> tuple[DriveState, bool]:
    """Run a short profile, `asked` ctrl-C coming at one tick, and `at_line` being told each line of the session.

    Returns the state of the drive itself, and whether it had been enabled.
    """
    enabled = []

    with Rig(bench_with()) as rig:
        rig.set_up()
        limits = SHORT.motion_limits
        cycle = make_cycle(rig, rig.drive.read(0.0).motor_position_rad, limits)
        clock = ScriptedClock({ASKED: lambda: [signal.raise_signal(signal.SIGINT) for _ in range(asked)] and 0.0})
        session = Session(rig, cycle, plan(SHORT, 0.001, 0.0), limits, clock, NoRows())

        def trace(frame: FrameType, event: str, argument: Any) -> Any:
            if frame.f_code.co_filename != SOURCE:
                return None
            if event == "line":
                enabled.append(rig.nodes.drive.state is DriveState.OPERATION_ENABLED)
                at_line(frame.f_lineno, rig)
            return trace

        before = sys.gettrace()
        with _interruptible(session):
            sys.settrace(trace)
            try:
                session.run()
            except (KeyboardInterrupt, StoppedByUser):
                pass
            finally:
                sys.settrace(before)
        return rig.nodes.drive.state, any(enabled)


@pytest.mark.parametrize(("asked", "signals"), [(0, 3), (2, 1), (3, 3)])
def test_whatever_the_line_and_number_of_ctrl_c_the_power_is_off(asked: int, signals: int) -> None:
    """First at a tick, then at a line: at the first time that each line runs while the drive is enabled."""
    lines: set[int] = set()

    def collect(line: int, rig: Rig) -> None:
        if rig.nodes.drive.state in POWERED:
            lines.add(line)

    assert interrupted_run(asked, collect)[1]
    assert len(lines) > 50
    for chosen in sorted(lines):
        left = [signals]

        def strike(line: int, rig: Rig, chosen: int = chosen, left: list[int] = left) -> None:
            if line == chosen and rig.nodes.drive.state in POWERED:
                while left[0]:
                    left[0] -= 1
                    signal.raise_signal(signal.SIGINT)

        state, enabled = interrupted_run(asked, strike)
        assert left == [0]
        assert enabled
        assert state not in POWERED, f"line {chosen}"
