"""In the guest: the loop at 250 Hz and 1 kHz beside a busy process, and cyclictest on the same core at the same time.

cyclictest runs beside the bench itself, a priority below it and half a period away: both meet the same disturbances.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from service import HERE, HIL, RESULTS, Devices, call, say, write

RATES_HZ = (250.0, 1000.0)
PRIORITY = 79  # hil.loop.realtime.PRIORITY less one: cyclictest never delays the loop
CORE = 1
_BUSY = "a = bytearray(1 << 24)\nwhile True: bytes(a)"


def bench_at(rate_hz: float) -> Path:
    """Write the bench of this rate: the gains of the shipped reference axis at 1 kHz."""
    bench = yaml.safe_load((HERE / "axis.yaml").read_text())
    control = bench["control"]
    control["position_period_s"] = control["velocity_period_s"] = 1.0 / rate_hz
    path = HERE / f"axis_{rate_hz:.0f}.yaml"
    path.write_text(yaml.safe_dump(bench))
    return path


def profile_of(seconds: float) -> Path:
    """Write the profile whose strokes last about as long."""
    profile = yaml.safe_load((HERE / "move.yaml").read_text())
    strokes = profile["segments"][1]
    strokes["times"] = max(1, round(seconds / 2.9))  # of one stroke and back
    path = HERE / "long.yaml"
    path.write_text(yaml.safe_dump(profile))
    return path


def measure(rate_hz: float, seconds: float) -> dict[str, Any]:
    """Run the bench at a rate beside cyclictest and busy processes."""
    bench, profile = bench_at(rate_hz), profile_of(seconds)
    devices = Devices(bench, HERE / "truth.bin")
    busy = [subprocess.Popen(["taskset", "-c", str(core), sys.executable, "-c", _BUSY]) for core in range(2)]
    histogram, folder = RESULTS / f"cyclictest_{rate_hz:.0f}.json", HERE / f"run_{rate_hz:.0f}"
    reference = subprocess.Popen(
        ["cyclictest", "--quiet", "--mlockall", f"--priority={PRIORITY}", f"--affinity={CORE}", "--secaligned=500",
         f"--interval={round(1e6 / rate_hz)}", "--histogram=100000", f"--json={histogram}"],
        stdout=subprocess.DEVNULL)  # fmt: skip
    try:
        said = subprocess.run([str(HIL), "run", str(profile), "--bench", str(bench), "--out", str(folder)],
                              capture_output=True, text=True)  # fmt: skip
    finally:
        load = os.getloadavg()
        for process in (*busy, reference):
            process.terminate()
        reference.wait()
        devices.kill()
    (RESULTS / f"run_{rate_hz:.0f}.txt").write_text(said.stdout + said.stderr)
    for path in folder.glob("*"):
        shutil.copy(path, RESULTS / f"{rate_hz:.0f}_{path.name}")
    return {"rate_hz": rate_hz, "exit_code": said.returncode, "load": load, "reference": _reference(histogram, rate_hz),
            "said": said.stderr.strip().splitlines()[-1:], "loop": _loop(folder, rate_hz)}  # fmt: skip


def _loop(folder: Path, rate_hz: float) -> dict[str, Any]:
    """Lateness of the recorded ticks, and the run's part of the certificate."""
    from hil.recording.recording import read_recording

    files = sorted(folder.glob("*.parquet"))
    if not files:
        return {}
    run = read_recording(files[0])
    late_s = run["lateness_s"]
    return {
        "ticks": len(late_s), "p50_us": 1e6 * float(np.quantile(late_s, 0.5)),
        "p999_us": 1e6 * float(np.quantile(late_s, 0.999)), "largest_us": 1e6 * float(late_s.max()),
        "missed": int(np.floor(late_s * rate_hz).sum()),
    } | run.metadata["real_time"].get("run", {})  # fmt: skip


def _reference(histogram: Path, rate_hz: float) -> dict[str, Any]:
    thread = json.loads(histogram.read_text())["thread"]["0"]
    latency_us = np.array([int(us) for us in thread["histogram"]])
    counts = np.array(list(thread["histogram"].values()))
    order = np.argsort(latency_us)
    part = np.cumsum(counts[order]) / counts.sum()
    quantiles = {name: float(latency_us[order][np.searchsorted(part, share)])
                 for name, share in (("p50_us", 0.5), ("p999_us", 0.999))}  # fmt: skip
    missed = int((np.floor(latency_us * 1e-6 * rate_hz) * counts).sum())
    return {"ticks": int(thread["cycles"]), **quantiles, "largest_us": float(thread["max"]), "missed": missed}


def _rows(found: dict[str, Any]) -> list[str]:
    name = f"{found['rate_hz']:.0f} Hz"
    lines = []
    for who in ("loop", "reference"):
        one = found[who]
        if one:
            other = ", ".join(f"{key} {one[key]}" for key in ("skipped", "page_faults", "collections") if key in one)
            lines.append(f"| {name}, {'cyclictest' if who == 'reference' else 'hil run'} | {one['ticks']} | "
                         f"{one['missed']} | {one['p50_us']:.0f} | {one['p999_us']:.0f} | {one['largest_us']:.0f} | "
                         f"{other} |")  # fmt: skip
    if found["exit_code"]:
        lines.append(f"| {name}: exit code {found['exit_code']} | | | | | | {' '.join(found['said'])} |")
    return lines


def main() -> None:
    """Measure each rate; what `hil latency` says beside."""
    options = json.loads((HERE / "options.json").read_text())
    table = ["| | ticks | missed | median us | p99.9 us | largest us | |", "|---|---|---|---|---|---|---|"]
    found = []
    for rate_hz, seconds in zip(RATES_HZ, options["seconds"], strict=True):
        if not seconds:
            continue
        say(f"{seconds:g} s at {rate_hz:g} Hz ...")
        found.append(measure(rate_hz, seconds))
        table += _rows(found[-1])
        write({"rates": found, "table": table})
    latency = call(HIL, "latency", "--load", "--json", "--period", "0.004", "--period", "0.001", "--seconds", "30")
    (RESULTS / "latency.json").write_text(latency.stdout)


if __name__ == "__main__":
    main()
