"""Measure what three open pages of the scope cost a loop at 1 kHz: python tests/hil/scope/measure_scope.py

One run in wall-clock time; the pages are open in every second phase, so that both halves see the same machine. Prints
the lateness of the ticks with and without pages, and processor time and memory of the server.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import yaml

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]

from patient_bench import patient_bench_file  # noqa: E402  # after the path
from scope_process import ScopeClient, page_of  # noqa: E402

from hil.recording.recording import read_recording  # noqa: E402

TRACES = [
    "position_command_m", "table_position_m", "motor_position_rad", "twin_table_position_m", "following_error_m",
    "residual_table_m", "torque_command_n_m", "torque_n_m", "twin_torque_n_m", "residual_torque", "lateness_s",
    "cycle_s",
]  # fmt: skip
SETTLE_S = 2.0  # left out at both ends of a phase


def processor_s(pid: int) -> float:
    """Processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_mb(pid: int) -> float:
    """Resident memory of a process without what it shares, such as the ring [MB]."""
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines() if ":" in line)
    return int(status["RssAnon"].split()[0]) / 1024


def watch(page: ScopeClient, over: threading.Event, counts: list[int]) -> None:
    """Take what comes for a page."""
    page.send("see", traces=TRACES, window_s=10.0, points=1200)
    while not over.is_set():
        _, values = page.next("view", "append")
        counts[0] += 1
        counts[1] += values.nbytes


def phase(address: str, pages: int, duration_s: float) -> list[int]:
    """Keep pages open for a time; returns frames and bytes that came."""
    counts, over = [0, 0], threading.Event()
    with ExitStack() as stack:
        opened = [stack.enter_context(page_of(address)) for _ in range(pages)]
        threads = [threading.Thread(target=watch, args=(page, over, counts)) for page in opened]
        for thread in threads:
            thread.start()
        time.sleep(duration_s)
        over.set()
        for thread in threads:
            thread.join()
    return counts


def now_of_the_run(address: str) -> float:
    """Time of the newest row [s]; waits for the run."""
    with page_of(address) as page:
        page.send("see", traces=["lateness_s"], window_s=1.0, points=10)
        return float(page.next("append")[1][0, -1])


def main() -> None:
    """Run, watch, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--phases", type=int, default=24)
    parser.add_argument("--phase-s", type=float, default=10.0)
    parser.add_argument("--beside-the-loop", action="store_true", help="let the pages run on the loop's core, too")
    parser.add_argument("--pages", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place, ExitStack() as stack:
        folder = Path(place)
        lap = [{"kind": "sine_squared", "to_m": to_m, "feed_m_s": 0.1} for to_m in (0.1, 0.0)]
        laps = int((given.phases * given.phase_s + 10.0) / 2.0) + 1
        profile = {
            "schema_version": 1,
            "limits": {"velocity_m_s": 0.3, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
            "segments": [{"kind": "repeat", "times": laps, "segments": lap}],
        }
        (folder / "laps.yaml").write_text(yaml.safe_dump(profile))
        python = [sys.executable, "-m", "hil.cli"]
        scope = subprocess.Popen([*python, "scope", "--port", "0", "--within", "."], cwd=folder, stdout=subprocess.PIPE)
        stack.callback(scope.wait)
        stack.callback(scope.terminate)
        assert scope.stdout is not None
        address = scope.stdout.readline().decode().removeprefix("scope: ").strip()
        command = ["run", "laps.yaml", "--bench", str(patient_bench_file(folder)), "--force", "--out", "out"]
        run = subprocess.Popen([*python, *command], cwd=folder)
        stack.callback(run.wait)
        stack.callback(run.kill)
        os.nice(10)
        spans, memory, cores = [], [], os.sched_getaffinity(0)
        for number in range(given.phases):
            pages = given.pages if number % 2 else 0
            begin_s = now_of_the_run(address)
            if not given.beside_the_loop:  # as pages on another computer, or a core that only the loop uses
                os.sched_setaffinity(0, cores - os.sched_getaffinity(run.pid) or cores)
            before_s = processor_s(scope.pid)
            if pages:
                timer = threading.Timer(SETTLE_S, lambda: memory.append(memory_mb(scope.pid)))
                timer.start()
            frames, size = phase(address, pages, given.phase_s)
            share = (processor_s(scope.pid) - before_s) / given.phase_s
            memory.append(memory_mb(scope.pid))
            spans.append((pages, begin_s + SETTLE_S, begin_s + given.phase_s - SETTLE_S))
            print(f"{pages} pages: server {100 * share:.1f} % of a core, {memory[-1]:.1f} MB, {frames} frames, "
                  f"{size / 1e6:.2f} MB", flush=True)  # fmt: skip
        run.terminate()
        run.wait()
        recording = read_recording(folder / "out" / "laps.parquet")
    time_s, late_us = recording["time_s"], 1e6 * recording["lateness_s"]
    told = {}
    for pages in (0, given.pages):
        rows = np.zeros(len(time_s), bool)
        for number, first_s, last_s in spans:
            rows |= (number == pages) & (time_s >= first_s) & (time_s < last_s)
        late = late_us[rows]
        told[pages] = *np.quantile(late, (0.5, 0.99, 0.999)), late.max(), late.mean()
        print(f"{pages} pages, {rows.sum()} ticks: lateness p50 {told[pages][0]:.1f}, p99 {told[pages][1]:.1f}, p99.9 "
              f"{told[pages][2]:.1f}, largest {told[pages][3]:.0f}, mean {told[pages][4]:.2f} us; missed "
              f"{(late >= 1e6 * recording.period_s).sum()}")  # fmt: skip
    names = ("p50", "p99", "p99.9", "largest", "mean")
    ratios = zip(names, told[given.pages], told[0], strict=True)
    print("with / without: " + ", ".join(f"{name} {a / b:.2f}" if b else f"{name} -" for name, a, b in ratios))
    print(f"memory of the server at the begin {memory[1]:.1f} MB, at the end {memory[-1]:.1f} MB")


if __name__ == "__main__":
    main()
