"""Time and memory of a diagnosis over the length of a recording and the number of masses.

    python -m hil.validation.benchmarks.diagnosis [--cases 2x25,2x50,2x100,2x200,7x25,20x25,7x200]

The simulated bench repeats the motion of `hil demo` with concealed cogging. An axis of n masses is `chain_of(n)`.
Each diagnosis is a new process; the first one also compiles the kernels that are not yet in numba's cache.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from hil.bench.hardware import SimulatedEffect, SimulationSection
from hil.loop.run import run_profile
from hil.report.compare_report import write_bench
from hil.report.console import table
from hil.twin.mechanisms import cogging_torque
from hil.validation.benchmarks.axis import chain_of, repeated
from hil.validation.proof.draw.demo import LEARN, PROVE

_HIL = (sys.executable, "-c", "from hil.cli import main; main()")
_CASES = "2x25,2x50,2x100,2x200,7x25,20x25,7x200"
_COGGING = cogging_torque.MECHANISM
_VALUES = (0.1, 12.0, 1.0)  # N m, per revolution, rad
_EFFECT = SimulatedEffect(effect=_COGGING.id, parameters=dict(zip(_COGGING.names, _VALUES, strict=True)))


def measure(
    cases: Annotated[str, typer.Option(help="MASSESxSECONDS of each recording, with commas.")] = _CASES,
) -> None:
    """Print time and memory of a diagnosis, in a new process, for each number of masses and length."""
    wanted = [case.split("x") for case in cases.split(",")]
    rows = [_row(int(masses), float(length_s)) for masses, length_s in wanted]
    table(("masses", "recording at 1 kHz", "diagnosis", "processor", "memory", "named"), rows)


def _row(masses: int, length_s: float) -> tuple[str, ...]:
    believed = chain_of(masses)
    concealed = SimulationSection(axis={"inertia_scale": 1.05}, effects=(_EFFECT,))
    bench = believed.model_copy(update={"simulation": concealed})
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        held_out = run_profile(bench, PROVE, place, "held_out", virtual=True).recording
        profile = repeated(LEARN, length_s, bench.gains.period_s)
        train = run_profile(bench, profile, place, "train", virtual=True).recording
        write_bench(believed, place / "bench.yaml")
        options = ("--validate", str(held_out), "--bench", str(place / "bench.yaml"), "--out", str(place / "out"))
        begin = perf_counter()
        process = subprocess.Popen(
            [*_HIL, "diagnose", str(train), *options], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        assert process.stderr is not None
        said = process.stderr.read()
        _, status, used = os.wait4(process.pid, 0)
        took_s = perf_counter() - begin
        if status:
            raise SystemExit(f"the diagnosis of {masses} masses, {length_s:g} s, failed:\n{said}")
        answer = json.loads((place / "out/diagnosis.json").read_text())
    processor_s = used.ru_utime + used.ru_stime
    memory_gb = used.ru_maxrss * 1024 / 1e9
    return (
        f"{masses}", f"{length_s:.0f} s", f"{took_s:.1f} s", f"{processor_s:.1f} s", f"{memory_gb:.2f} GB",
        ", ".join(found["effect"] for found in answer["missing"]),
    )  # fmt: skip


if __name__ == "__main__":
    typer.run(measure)
