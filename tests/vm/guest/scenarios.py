"""In the guest: run the bench as a service, disturb it while the axis moves, and state what must hold.

Each scenario starts the devices and the service anew; `results.json` has its claims, a folder of its name recordings,
journal and what the axis did.
"""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from disturb import bad_answers, drops, interface_down, kill_writer, no_disturbance, remove_interface, reorders
from judge import Claims, Run, judge
from service import CAN, HERE, LATCH, RESULTS, UNIT, Devices, Service, call, recorded, say, wait_for, write

from hil.bench.bench_file import load_bench
from hil.loop.run import rehearse
from hil.motion.profile import load_profile
from hil.motion.trajectory import plan

BENCH = Path("/etc/hil/axis1/bench.yaml")
_CLOCK = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")
MOVING_M_S = 0.05  # a quarter of the feed of the profile
ENABLED = 4  # drivers.cia402.DriveState.OPERATION_ENABLED
LONGEST_RUN_S = 120.0


@dataclass(frozen=True)
class Scenario:
    """What is done to the moving bench, and what must follow.

    disturb: does it and returns what it did. ends: what the run may end with, words of the unit's Result. stops_itself:
    the loop cannot stop the drive. drive_lives: the drive's process does.
    """

    name: str
    disturb: Callable[[Service, Devices], str]
    ends: tuple[str, ...]
    stops_itself: bool = False
    drive_lives: bool = True


def _signal(number: signal.Signals) -> Callable[[Service, Devices], str]:
    def send(service: Service, devices: Devices) -> str:
        os.kill(service.pid, number)
        return ""

    return send


def _stop(service: Service, devices: Devices) -> str:
    call("systemctl", "stop", "--no-block", UNIT)
    return ""


def _kill_drive(service: Service, devices: Devices) -> str:
    devices.kill()
    return ""


SCENARIOS = (
    Scenario("nothing", no_disturbance, ("success",)),
    Scenario("loop killed (SIGKILL)", _signal(signal.SIGKILL), ("signal",), stops_itself=True),
    Scenario("loop stopped (SIGSTOP)", _signal(signal.SIGSTOP), ("watchdog", "core-dump", "signal"), stops_itself=True),
    Scenario("writer killed (SIGKILL)", kill_writer, ("success",)),
    Scenario("all frames lost for 1 s", drops("100%", 1.0), ("exit-code",), stops_itself=True),
    Scenario("drive and encoder killed (SIGKILL)", _kill_drive, ("exit-code",), drive_lives=False),
    Scenario("systemctl stop", _stop, ("success",)),
    Scenario("interface down for 1 s", interface_down, ("exit-code",), stops_itself=True),
    Scenario("1 % of the frames lost", drops("1%", 0.0), ("success", "exit-code")),
    Scenario("10 % of the frames lost", drops("10%", 0.0), ("success", "exit-code")),
    Scenario("frames delayed by 0 to 6 ms, reordered", reorders, ("success", "exit-code")),
    Scenario("another node sends wrong TPDOs of the drive", bad_answers, ("exit-code",)),
    Scenario("interface removed", remove_interface, ("exit-code",), stops_itself=True),
)


def run(scenario: Scenario, folder: Path) -> Run:
    """Start, disturb once the axis moves fast, wait for the end, collect."""
    folder.mkdir(parents=True)
    service = Service()
    service.clear()
    devices = Devices(BENCH, HERE / "truth.bin")
    say(f"{scenario.name}: devices run")
    try:
        began_s = time.monotonic()
        started = service.start()
        ready_s = time.monotonic() - began_s
        say(f"{scenario.name}: {'the loop runs' if not started.returncode else 'not started'} after {ready_s:.0f} s")
        state = service.state()
        for line in service.journal(state["InvocationID"]).splitlines()[-8:] if started.returncode else ():
            say(line[-300:])
        moving = wait_for(lambda: _moves(devices), 20.0)
        disturbed_s = time.monotonic()
        done = scenario.disturb(service, devices) if moving else ""
        ended = wait_for(service.ended, LONGEST_RUN_S, 0.05)
        ended_s = time.monotonic()
        wait_for(LATCH.exists, 3.0, 0.05)
        again = service.start() if LATCH.exists() else None
        time.sleep(1.0)  # the drive is watched after the end
        call("tc", "qdisc", "del", "dev", CAN, "root")
        rows, last = devices.truth(), service.state()
        np.save(folder / "truth.npy", rows)
        journal = service.journal(state["InvocationID"])
        (folder / "journal.txt").write_text(f"{journal}\nsystemctl start: {started.stderr}\n{json.dumps(last)}\n")
        exit_code = None if again is None else again.returncode
        return Run(
            load_bench(BENCH), rows, disturbed_s, ended_s - disturbed_s, ready_s, moving and ended, done,
            state | last, journal, recorded(folder), LATCH.exists(), exit_code)  # fmt: skip
    finally:
        devices.kill()


def _moves(devices: Devices) -> bool:
    rows = devices.truth()
    return len(rows) > 0 and rows[-1, 1] == ENABLED and abs(rows[-1, 2]) > MOVING_M_S


def refuses_to_arm_with_a_latched_drive(claims: Claims) -> None:
    """After a kill the drive is in FAULT: with the latch removed the service still does not arm it."""
    service = Service()
    service.clear()
    devices = Devices(BENCH, HERE / "truth.bin")
    try:
        service.start()
        wait_for(lambda: _moves(devices), 20.0)
        os.kill(service.pid, signal.SIGKILL)
        wait_for(service.ended, LONGEST_RUN_S, 0.05)
        wait_for(LATCH.exists, 3.0, 0.05)
        before = len(devices.truth())
        LATCH.unlink(missing_ok=True)
        service.start()
        wait_for(service.ended, LONGEST_RUN_S, 0.05)
        after = devices.truth()[before:]
        claims.add("the drive in FAULT is not armed", not np.any(after[:, 1] == ENABLED), "not armed")
        claims.add("the service fails again", service.state()["ActiveState"] == "failed", "")
    finally:
        devices.kill()


def main() -> None:
    """Run the scenarios and write results.json after each."""
    options = json.loads((HERE / "options.json").read_text())
    found: list[dict[str, Any]] = []
    # loads all kernels of the devices before they are forked: in a drive that answers it would be a silence
    bench, profile = load_bench(BENCH), load_profile(BENCH.with_name("profile.yaml"))
    rehearse(bench, plan(profile, bench.period_s, 0.0), profile)
    say(f"{os.uname().release}, clock {_CLOCK.read_text().strip()}")
    for scenario in SCENARIOS:
        if options["only"] not in scenario.name or time.monotonic() > 60.0 * options["minutes"]:
            continue
        folder = RESULTS / scenario.name.split(" (")[0].replace(" ", "_").replace("%", "percent")
        claims = Claims()
        try:
            judge(run(scenario, folder), scenario, claims)
        except Exception as error:
            claims.add(f"the scenario could be run ({type(error).__name__}: {error})", False, "")
        found.append({"name": scenario.name, "claims": claims.as_data()})
        failed = [claim["text"] for claim in claims.as_data() if not claim["holds"]]
        say(f"{scenario.name}: {'; '.join(failed) or 'holds'}")
        write({"scenarios": found})
    if options["only"] in "a latched drive" and time.monotonic() < 60.0 * options["minutes"]:
        refuses_to_arm_with_a_latched_drive(claims := Claims())
        found.append({"name": "a latched drive, latch of the service removed", "claims": claims.as_data()})
    exposure = call("systemd-analyze", "security", "--no-pager", UNIT).stdout.strip().splitlines()
    write({"exposure": exposure[-1:], "scenarios": found})


if __name__ == "__main__":
    main()
