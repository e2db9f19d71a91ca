"""Measure `hil fleet` on a fleet of tests/support/ageing_fleet.py:

python tests/net/fleet_bars.py run FLEET        # two workers, one killed, the client killed, gone on with; memory
python tests/net/fleet_bars.py score FLEET TRUTH.json   # after hil fleet trend: change points against the truth
python tests/net/fleet_bars.py alarms YEARS     # false changes a year on axes that do not age
python tests/net/fleet_bars.py power SERIES     # share of steps and slopes that are found
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from processes import wait_for

from hil.fleet.changes import FEWEST, history
from hil.fleet.quantities import QUANTITIES
from hil.fleet.store import Store
from hil.fleet.trend import date_of

ROOT = Path(__file__).parents[2]
BEGIN_DAY = 20089.25  # of ageing_fleet.BEGIN, since 1970
COUNTED = {"friction": ("coulomb_forward", "coulomb_back")}  # quantity of the truth -> those that show it
CHECKED_EVERY = 10  # recordings between two looks of the simulation


def client(fleet: Path, out: Path, workers: int, what: str = "compare") -> subprocess.Popen[str]:
    """`hil fleet` in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "hil.cli", "fleet", what, str(fleet), "--out", str(out), "--workers", str(workers)],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip


def worker_pids(pid: int) -> list[int]:
    """Processes of the workers of a client."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        children = (task / "children").read_text().split()
        found += [int(one) for one in children if b"spawn_main" in Path(f"/proc/{one}/cmdline").read_bytes()]
    return found


def memory_mb(pid: int) -> float:
    """Resident memory of a process."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except (FileNotFoundError, ProcessLookupError):
        return 0.0


def processor_s(pid: int) -> float:
    """Processor time of a process."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (FileNotFoundError, ProcessLookupError):
        return 0.0


def _rate(seen: list[tuple[float, int]]) -> float:
    """Results for each second from the first tenth to the last."""
    most = seen[-1][1]
    inner = [one for one in seen if 0.1 * most < one[1] < 0.95 * most]
    return (inner[-1][1] - inner[0][1]) / (inner[-1][0] - inner[0][0])


def written(out: Path) -> int:
    """Conditions that workers have written."""
    return len(list((out / "parts" / "condition").glob("*.json")))


def rows(out: Path) -> dict[str, Any]:
    """Conditions by file; raises AssertionError for a recording that is there twice."""
    found = Store(str(out)).rows("condition")
    by_file = {row["file"]: row for row in found}
    assert len(by_file) == len(found)
    return by_file


def run(fleet: Path) -> None:
    """Two workers undisturbed, with their memory; one worker; two with both killed."""
    for workers in (2, 1):
        out = fleet / f"_undisturbed_{workers}"
        begin, seen, process = time.monotonic(), dict[int, list[tuple[int, float]]](), client(fleet, out, workers)
        times, work = list[tuple[float, int]](), list[tuple[float, int]]()
        while process.poll() is None:
            if done := written(out):
                pids = worker_pids(process.pid)
                for pid in pids:
                    seen.setdefault(pid, []).append((done, memory_mb(pid)))
                times.append((time.monotonic(), done))
                work.append((sum(map(processor_s, pids)), done))
            time.sleep(0.5)
        assert process.returncode == 0
        total = len(rows(out))
        print(f"{workers} workers: {time.monotonic() - begin:.0f} s, {total} conditions; {_rate(times):.1f} a second, "
              f"{1e3 * _rate(work):.0f} for 1000 s of the workers' processor time", flush=True)  # fmt: skip
        for pid, values in seen.items():
            by_third = [
                [mb for done, mb in values if part * total < 3 * done <= (part + 1) * total] for part in range(3)
            ]
            told = ", ".join(f"{np.median(one):.0f}" for one in by_third if one)
            print(f"  worker {pid}: MB by thirds of the conditions: {told}; largest {max(mb for _, mb in values):.0f}")
    out = fleet / "_disturbed"
    process = client(fleet, out, 2)
    total = len(rows(fleet / "_undisturbed_2"))
    wait_for(lambda: written(out) > 0.2 * total, step_s=0.05)
    os.kill(worker_pids(process.pid)[0], signal.SIGKILL)
    print("worker killed at", written(out))
    wait_for(lambda: written(out) > 0.5 * total, step_s=0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    print("client killed at", before := written(out))
    process = client(fleet, out, 2)
    said, _ = process.communicate()
    assert process.returncode == 0, said
    print(
        f"gone on: {total - before} to do;",
        "same rows" if rows(out) == rows(fleet / "_undisturbed_2") else "OTHER ROWS",
    )


def score(fleet: Path, truth: Path) -> None:
    """Compare the change points of trends with the truth."""
    errors, missed, inside, false = list[float](), list[str](), list[bool](), list[str]()
    for axis in json.loads(truth.read_text(encoding="utf-8")):
        told = json.loads((fleet / "_fleet" / "axes" / f"{axis['axis']}.json").read_text(encoding="utf-8"))
        by_name = {one["quantity"]: one for one in told["quantities"]}
        if axis["kind"] == "still":
            false += [f"{axis['axis']} {one['quantity']}" for one in told["quantities"]
                      if one.get("changes") or one.get("slope_per_day")]  # fmt: skip
        for change in axis["changes"]:
            for name in COUNTED.get(change["quantity"], (change["quantity"],)):
                found = by_name[name].get("changes", [])
                day = BEGIN_DAY + change["day"]
                if change["kind"] == "slope" and change["day"] == 0.0:  # from the first day on: a slope without a begin
                    if not (found or by_name[name]["slope_per_day"]):
                        missed.append(f"{axis['axis']} {name}")
                    continue
                near = [one for one in found if one["kind"] == change["kind"]]
                if not near:
                    missed.append(f"{axis['axis']} {name}")
                    continue
                best = min(near, key=lambda one: abs(one["day"] - day))
                errors.append(best["day"] - day)
                inside.append(best["earliest"] <= date_of(day) <= best["latest"])
                when = f"{best['earliest']} to {best['latest']}, true {date_of(day)}"
                print(f"{axis['axis']} {name} {change['kind']}: {errors[-1]:+.1f} days, {when}")
    print(f"{len(errors)} found, {len(missed)} missed {missed}; in the interval {sum(inside)} of {len(inside)}; "
          f"changes on axes that do not age: {len(false)} {false}")  # fmt: skip


def alarms(years: int) -> None:
    """Count false changes of a quantity on series of a year, looked at from the first recordings to the last."""
    for name, draw in NOISES.items():
        found, rng = 0, np.random.default_rng(39)
        for _ in range(years):
            values, seen = draw(rng, 365), False
            for last in range(FEWEST, 366, CHECKED_EVERY):
                now = changed(values[:last])
                found += now and not seen
                seen = now
        of_axis = len(QUANTITIES) * found / years
        print(f"{name}: {found} in {years} years of one quantity, {of_axis:.2f} a year of an axis", flush=True)


def power(series: int) -> None:
    """Share of series in which a step is found, by its size in standard deviations and the recordings about it."""
    for name in ("white", "correlated 0.5"):
        for before, after in ((10, 10), (20, 20), (50, 4), (50, 8), (50, 50), (150, 6), (150, 15)):
            shares = []
            for size in (2.0, 3.0, 4.0, 6.0):
                rng = np.random.default_rng(39)
                drawn = (NOISES[name](rng, before + after) for _ in range(series))
                found = [changed(one + size * (np.arange(one.size) >= before)) for one in drawn]
                shares.append(f"{size:g}: {np.mean(found):.2f}")
            print(f"{name}, {before} before, {after} after:", ", ".join(shares), flush=True)
        for count in (30, 60, 120):
            slopes = []
            for size in (3.0, 5.0, 8.0):
                rng = np.random.default_rng(40)
                drawn = (NOISES[name](rng, count) for _ in range(series))
                found = [changed(one + size * np.arange(one.size) / one.size) for one in drawn]
                slopes.append(f"{size:g}: {np.mean(found):.2f}")
            print(f"{name}, a slope over {count}:", ", ".join(slopes), flush=True)


def changed(values: np.ndarray) -> bool:
    """True if a quantity with these values at one recording a day changes."""
    found = history(np.arange(values.size) * 1.0, values, np.full(values.size, 0.3), len(QUANTITIES))
    return bool(found and (found.changes or found.now.slope))


def correlated(rng: np.random.Generator, count: int, by: float) -> np.ndarray:
    """Noise of unit variance (n,), correlated from one to the next."""
    values = rng.standard_normal(count)
    for at in range(1, count):
        values[at] = by * values[at - 1] + np.sqrt(1.0 - by**2) * values[at]
    return values


def outliers(rng: np.random.Generator, count: int) -> np.ndarray:
    """Beside 0 in 97 % of the recordings, normal values of standard deviation 8 in the others (n,)."""
    return 8.0 * rng.standard_normal(count) * (rng.uniform(size=count) < 0.03)


NOISES: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "white": lambda rng, n: rng.standard_normal(n),
    "heavy tails (t, 4)": lambda rng, n: rng.standard_t(4, n) / np.sqrt(2.0),
    "outliers of 8 in 3 %": lambda rng, n: rng.standard_normal(n) + outliers(rng, n),
    "correlated 0.5": lambda rng, n: correlated(rng, n, 0.5),
    "correlated 0.8": lambda rng, n: correlated(rng, n, 0.8),
    "half white, half correlated 0.8": lambda rng, n: (rng.standard_normal(n) + correlated(rng, n, 0.8)) / np.sqrt(2.0),
    "correlated 0.8, outliers of 8 in 3 %": lambda rng, n: correlated(rng, n, 0.8) + outliers(rng, n),
}

if __name__ == "__main__":
    commands: dict[str, Callable[[Sequence[str]], None]] = {
        "run": lambda given: run(Path(given[0])),
        "score": lambda given: score(Path(given[0]), Path(given[1])),
        "alarms": lambda given: alarms(int(given[0])),
        "power": lambda given: power(int(given[0])),
    }
    commands[sys.argv[1]](sys.argv[2:])
