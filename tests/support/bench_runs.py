"""Runs of a simulated bench in virtual time, with things happening at chosen ticks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.inprocess import InProcessBus
from hil.bench.bench_file import Bench
from hil.loop.bounds import make_cycle
from hil.loop.clock import VirtualClock
from hil.loop.devices import Rig
from hil.loop.outcome import Outcome
from hil.loop.run import _interruptible
from hil.loop.session import Session
from hil.loop.simulated_bench import load_simulated
from hil.loop.virtual import compiled_ticks
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.recording.recording import Recording, read_recording
from hil.recording.writer import Recorder

MOVE = Profile.model_validate(
    {
        "schema_version": 1,
        "limits": {"velocity_m_s": 0.6, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
        "segments": [
            {"kind": "dwell", "duration_s": 0.1},
            {"kind": "sine_squared", "to_m": 0.05, "feed_m_s": 0.1},
            {"kind": "dwell", "duration_s": 0.1},
        ],
    }
)
MOVING = 400  # a tick in the middle of the move


class ScriptedClock(VirtualClock):
    """A virtual clock that does something when a tick is due; what that returns is the lateness of the tick."""

    def __init__(self, script: Mapping[int, Callable[[], Any]]) -> None:
        self.script = script

    def wait(self, tick: int) -> float:
        action = self.script.get(tick)
        return float((action and action()) or 0.0)


@dataclass
class Ran:
    """Result of a run."""

    outcome: Outcome
    recording: Recording
    rig: Rig


def bench_with(**changes: dict[str, Any]) -> Bench:
    """The reference bench with the default deadline of the drive and other values in its sections."""
    data = load_simulated("reference").model_dump()
    data["drive"]["command_deadline_s"] = None
    for section, values in changes.items():
        data[section] |= values
    return Bench.model_validate(data)


def run(
    folder: Path,
    bench: Bench | None = None,
    script: Callable[[Rig, Session], Mapping[int, Callable[[], Any]]] | None = None,
    profile: Profile = MOVE,
    bus: InProcessBus | None = None,
    *,
    compiled: bool = False,
) -> Ran:
    """Run a profile; `script` says what happens at which tick of the clock (some five before the first row)."""
    bench = bench or bench_with()
    rig = Rig(bench, bus=bus)
    try:
        rig.set_up()
        cycle = make_cycle(rig, rig.drive.read(0.0).motor_position_rad, profile.motion_limits)
        trajectory = plan(profile, bench.gains.period_s, 0.0)
        clock = ScriptedClock({})
        with Recorder(folder, "run", cycle.channels, bench.gains.period_s, {}, lossless=True) as recorder:
            ticks = compiled_ticks(rig, recorder) if compiled else None
            session = Session(rig, cycle, trajectory, profile.motion_limits, clock, recorder, ticks)
            clock.script = script(rig, session) if script else {}
            with _interruptible(session):
                outcome = session.run()
    finally:
        rig.close()
    return Ran(outcome, read_recording(recorder.path), rig)
