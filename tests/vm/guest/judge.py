"""Judge a disturbed run by what the axis did, what systemd says, and what was recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveSection

POWERED = (4, 5, 6)  # operation enabled, quick stop, fault reaction: drivers.cia402.DriveState
ENABLED = 4
WATCHDOG_S = 2.0  # of the unit
LOOK_S = 0.005  # the devices look at their timers as often, when no frame comes
DECELERATION_M_S2 = 1.6  # of the drive's quick stop: 0x6085 of its EDS, 160 rev/s2 on a 10 mm screw
REST_M_S = 1e-3
MOST_LOST_S = 0.1  # of a recording, at any fault
HEARTBEATS = 3  # missed by the drive, until it stops


@dataclass(frozen=True)
class Run:
    """What a run left. truth (n, 4): rows of `devices.COLUMNS`; disturbed_s: monotonic time; state: of the unit."""

    bench: Bench
    truth: npt.NDArray[np.float64]
    disturbed_s: float
    ended_after_s: float
    ready_s: float
    took_place: bool
    done: str
    state: dict[str, str]
    journal: str
    recording: dict[str, Any]
    latched: bool
    started_again: int | None  # exit code of `systemctl start` with the latch, None: not latched


@dataclass
class Claims:
    """Claims of a scenario and whether they hold."""

    found: list[tuple[str, bool, str]] = field(default_factory=list)

    def add(self, text: str, holds: bool | np.bool_, measured: str) -> None:
        """Add one; measured: what the table shows."""
        self.found.append((text, bool(holds), measured))

    def as_data(self) -> list[dict[str, Any]]:
        """Return them for results.json."""
        return [{"text": text, "holds": holds, "measured": measured} for text, holds, measured in self.found]


def judge(run: Run, scenario: Any, claims: Claims) -> None:
    """Add what must hold after any disturbance, and after this one."""
    claims.add("the axis moved and the run ended", run.took_place, "")
    result = run.state["Result"]
    failed = run.state["ActiveState"] == "failed"
    code = f"{result} {run.state['ExecMainStatus']}"
    claims.add(f"ends by {' or '.join(scenario.ends)}", result in scenario.ends, f"unit: {code}")
    claims.add("a failure is latched, nothing else is", run.latched == failed, "latched" if run.latched else "")
    if run.latched:
        claims.add("the latch refuses a start", run.started_again != 0, "")
    if scenario.name == "loop stopped (SIGSTOP)":
        longest_s = WATCHDOG_S + 2.0  # one unfed interval, then a process that writes its traces
        claims.add("the watchdog ends it", run.ended_after_s < longest_s, f"ended after {run.ended_after_s:.1f} s")
    if scenario.drive_lives:
        _judge_axis(run, scenario, claims)
    _judge_recording(run, failed, claims)
    if reason := _reason(run):
        claims.add("the run says why it ended", True, reason)


def _judge_axis(run: Run, scenario: Any, claims: Claims) -> None:
    time_s, state, velocity_m_s, position_m = run.truth.T
    after = time_s >= run.disturbed_s
    enabled = state == ENABLED
    left = after & ~enabled
    if not left.any():
        claims.add("the drive leaves OPERATION ENABLED", False, "")
        return
    first = int(np.argmax(left))
    left_s = time_s[first] - run.disturbed_s
    claims.add("it is not enabled again", not enabled[first:].any(), "")
    claims.add("its power is off at the end", not np.isin(state[-1], POWERED), "off")
    claims.add("the axis rests", abs(velocity_m_s[-1]) < REST_M_S, "")
    if scenario.stops_itself:
        # between two looks the device may have been held up by its computer: counted as its own
        held_s = float(np.diff(time_s[after]).max(initial=0.0))
        section = run.bench.drive or DriveSection()
        silent_s = max(section.command_deadline_s or 0.0, HEARTBEATS * section.heartbeat_s)
        allowed_s = silent_s + run.bench.period_s + LOOK_S + held_s
        claims.add(f"the drive stops by itself within {1e3 * allowed_s:.0f} ms", left_s <= allowed_s,
                   f"left OPERATION ENABLED after {1e3 * left_s:.0f} ms")  # fmt: skip
        moves = np.abs(velocity_m_s) > REST_M_S
        rest = int(np.flatnonzero(moves)[-1])
        way_m = abs(position_m[-1] - position_m[first])
        speed_m_s = float(np.abs(velocity_m_s[max(0, first - 20) : first + 1]).max())
        ramp_m = speed_m_s**2 / (2.0 * DECELERATION_M_S2)
        # half as much again: the axis follows the ramp with the delay of the drive's velocity loop
        claims.add(f"within its ramp of {1e3 * ramp_m:.0f} mm", way_m <= 1.5 * ramp_m,
                   f"at rest {1e3 * way_m:.1f} mm, {1e3 * (time_s[rest] - time_s[first]):.0f} ms later")  # fmt: skip


def _judge_recording(run: Run, failed: bool, claims: Claims) -> None:
    rows, duration_s = run.recording["rows"], run.recording["duration_s"]
    claims.add("the recording can be read", rows > 0, f"{rows} rows")
    certificate = run.recording.get("certificate", {}).get("run", {})
    skipped = certificate.get("skipped", 0)
    if not failed:
        claims.add("it is closed, without a gap but of ticks left out",
                   run.recording["closed"] and abs(rows + skipped - 1 - duration_s / run.bench.period_s) < 1.0,
                   f"{skipped} ticks left out")  # fmt: skip
    elif len(run.truth):
        enabled = run.truth[run.truth[:, 1] == ENABLED, 0]
        if len(enabled):
            end_s = min(run.disturbed_s, float(enabled[-1]))
            lost_s = end_s - float(enabled[0]) - duration_s
            known_s = 2.0 * run.bench.period_s  # the ends of the recording and of what the axis did differ by as much
            measured = f"{1e3 * lost_s:.0f} ms not recorded" if lost_s > known_s else ""
            claims.add("at most 100 ms before the fault are lost", lost_s < MOST_LOST_S + known_s, measured)


def _reason(run: Run) -> str:
    """Return the error that the run wrote, shortened."""
    lines = [line.split("]: ", 1)[-1] for line in run.journal.splitlines() if "rror: " in line]
    return lines[-1].strip()[:160] if lines else ""
