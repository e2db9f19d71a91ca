"""The fault matrix: `make fault-matrix`, or `python tests/faults/matrix.py --runs 10000 --seed 1 --jobs 2`.

Each run draws a fault, the mode of the drive, the encoder that is fed back, the CiA 402 state and the tick at which the
fault strikes, all from its seed, and checks the invariants of `verdict`. Prints a table with counts; a violation prints
its seed, and `--one SEED` repeats it alone. Exit code 1 with violations.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import sys
import time
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parent))

from fault_kinds import COMPLETE, DRIVE, KINDS, Kind
from observed_run import END_M, Observed, Stage, bench_with, observe
from reach import stopping_m
from set_up_faults import SET_UP, run_set_up
from wrong_signs import STATES as SIGN_STATES
from wrong_signs import drawn_bench, sign_violations

from drivers.cia402 import DriveState
from hil.errors import HilError
from hil.loop.session import LoopPhase

ENABLED = DriveState.OPERATION_ENABLED
STATES = (
    DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON, ENABLED, ENABLED, ENABLED,
    DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT,
)  # fmt: skip
ARMING = (DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON)
MODES = (("cst", "motor"), ("cst", "table"), ("csv", "motor"), ("csv", "table"), ("csp", "motor"))
REST_M_S = 1e-3


class Run(NamedTuple):
    """A run: seed, fault, state at which it struck, ending, cycles to detection (-1: none), violations, description,
    and the way from detection, without one from the fault."""

    seed: int
    fault: str
    state: str
    ended: str
    cycles: int
    wrong: list[str]
    about: str
    travel_m: float = 0.0


def one_run(seed: int) -> Run:
    """Draw and do a run."""
    rng = random.Random(seed)
    mode, feedback = rng.choice(MODES)
    bench = bench_with(
        drive={"mode": mode}, control={"position_feedback": feedback}, simulation={"seed": rng.randrange(1000)}
    )
    names = [kind.name for kind in KINDS] + list(SET_UP)
    name = names[seed % len(names)]
    about = f"{mode}, {feedback} fed back"
    if name in SET_UP:
        try:
            wrong = run_set_up(name, bench, rng)
        except Exception as error:
            wrong = [f"{type(error).__name__}: {error}"]
        return Run(seed, name, "set-up", "refused", 0, wrong, about)
    kind = next(kind for kind in KINDS if kind.name == name)
    if kind.sign:
        bench, about = drawn_bench(rng, cst=kind.cst)
    state = rng.choice(SIGN_STATES if kind.sign else STATES)
    at, later = rng.randrange(12, 290), rng.randrange(1, 40)
    seen = observe(bench, Stage(state, at, later), kind.act, rng)
    cycles = -1
    if seen.injected is not None and seen.detected is not None:
        cycles = seen.detected - seen.injected
    where = seen.ticks[seen.injected].state.name if seen.injected is not None else "not reached"
    return Run(
        seed,
        name,
        where,
        seen.ended,
        cycles,
        verdict(kind, state, seen),
        f"{about}, tick {at}, {state.name}",
        seen.travel_m,
    )


def verdict(kind: Kind, state: DriveState, seen: Observed) -> list[str]:
    """The invariants that a run violates."""
    wrong: list[str] = []
    third = isinstance(seen.error, KeyboardInterrupt) and state is DriveState.QUICK_STOP_ACTIVE
    if seen.error is not None and not isinstance(seen.error, HilError) and not third:
        wrong.append(f"trace: {type(seen.error).__name__}: {seen.error}")
    if seen.speed_at_end_m_s > REST_M_S and not seen.still_powered:
        wrong.append(f"moves at the end: {seen.speed_at_end_m_s:.4f} m/s")
    if seen.powered_at_end and not seen.still_powered:
        wrong.append("power is on and no error says so")
    wrong += _commands(seen)
    if kind.sign:
        return wrong + sign_violations(kind.sign, state, seen)
    struck = seen.ticks[seen.injected] if seen.injected is not None else None
    if struck is None or state is not ENABLED or struck.phase is not LoopPhase.RUN:
        if state in ARMING and seen.outcome is not None and seen.ended not in kind.endings | {COMPLETE, DRIVE}:
            wrong.append(f"ended by {seen.ended}")
        return wrong
    detected = seen.detected
    if seen.ended not in kind.endings:
        wrong.append(f"ended by {seen.ended}, allowed {', '.join(sorted(kind.endings))}")
    if kind.cycles is not None and seen.ended != COMPLETE:
        took = len(seen.ticks) - seen.injected if detected is None else detected - seen.injected
        if took > kind.cycles + 1:  # the tick that was due is looked at before its samples are
            wrong.append(f"detected after {took} cycles, allowed {kind.cycles + 1}")
    assert seen.rig is not None
    if seen.ended != COMPLETE:
        allowed_m = stopping_m(kind, seen.rig, seen)
        travel_m = seen.travel_from_fault_m if kind.stalls else seen.travel_m
        if travel_m > allowed_m:
            wrong.append(f"travelled {1e3 * travel_m:.1f} mm, allowed {1e3 * allowed_m:.1f} mm")
    elif abs(seen.end_m - END_M) > seen.rig.section.following_error_m:
        wrong.append(f"complete, but at rest {1e3 * abs(seen.end_m - END_M):.1f} mm from the end of the move")
    return wrong


def _commands(seen: Observed) -> list[str]:
    """No command "enable operation" from the second tick after a trip on: the first sends the stop."""
    tripped = next((k for k, tick in enumerate(seen.ticks) if tick.goal.name == "QUICK_STOP" and k), None)
    wrong: list[str] = []
    if tripped is None:
        return wrong
    late = [k for k in range(tripped + 1, len(seen.ticks)) if seen.ticks[k].motion_commands]
    if late:
        wrong.append(f"motion command {late[-1] - tripped} cycles after the trip")
    if any(tick.state is ENABLED and seen.ticks[k - 1].state is not ENABLED
           for k, tick in enumerate(seen.ticks) if k > tripped + 1):  # fmt: skip
        wrong.append("enabled again after the trip")
    return wrong


def table(runs: list[Run]) -> str:
    """Counts for each fault as a Markdown table."""
    by: dict[str, list[Run]] = defaultdict(list)
    for run in runs:
        by[run.fault].append(run)
    lines = [
        "| fault | runs | endings | cycles to detection: median, most | longest way, mm | violations |",
        "|---|---|---|---|---|---|",
    ]
    for name, group in by.items():
        cycles = sorted(run.cycles for run in group if run.cycles >= 0 and run.state == ENABLED.name)
        spread = f"{cycles[len(cycles) // 2]}, {cycles[-1]}" if cycles else ""
        far_mm = 1e3 * max((run.travel_m for run in group if run.cycles >= 0), default=0.0)
        endings = ", ".join(f"{ending} {count}" for ending, count in Counter(run.ended for run in group).most_common())
        lines.append(
            f"| {name} | {len(group)} | {endings} | {spread} | {far_mm:.1f} | {sum(bool(run.wrong) for run in group)} |"
        )
    states = ", ".join(f"{state} {count}" for state, count in Counter(run.state for run in runs).most_common())
    lines.append(f"| all | {len(runs)} | | | | {sum(bool(run.wrong) for run in runs)} |")
    return "\n".join([*lines, "", f"State of the drive when the fault struck: {states}."])


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1, help="of the first run; each has the next one")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--one", type=int, help="seed of a run to repeat")
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further runs after this time")
    given: Any = parser.parse_args()
    if given.one is not None:
        print(json.dumps(one_run(given.one)._asdict(), indent=1))
        return 0
    runs: list[Run] = []
    end_s = time.monotonic() + 60.0 * given.minutes
    with ProcessPoolExecutor(given.jobs) as pool:
        for begin in range(given.seed, given.seed + given.runs, 200):
            if time.monotonic() > end_s:
                break
            for run in pool.map(one_run, range(begin, min(begin + 200, given.seed + given.runs)), chunksize=10):
                runs.append(run)
                if run.wrong:
                    print(
                        f"seed {run.seed}: {run.fault} in {run.state} ({run.about}): {'; '.join(run.wrong)}", flush=True
                    )
    print(table(runs))
    return int(any(run.wrong for run in runs))


if __name__ == "__main__":
    sys.exit(main())
