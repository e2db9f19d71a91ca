"""How long a diagnosis takes over the length of a recording: python -m hil.benchmarks.diagnosis [--effect ID]

The simulated bench moves as in `hil demo`, over and over, with an effect concealed. Each length is diagnosed in a
process of its own, so that it starts cold; the first one also compiles what is not yet in numba's cache.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from hil.demo import LEARN, PROVE, conceal
from hil.loop.run import run_profile
from hil.loop.simulated_bench import load_simulated
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.report.console import table
from hil.twin.mechanisms import cogging_torque

LENGTHS_S = (25.0, 50.0, 100.0, 200.0)
_HIL = (sys.executable, "-c", "from hil.cli import main; main()")


def measure(effect: Annotated[str, typer.Option(help="What is concealed")] = cogging_torque.MECHANISM.id) -> None:
    """Print the time of a diagnosis, cold, for each length."""
    bench, _ = conceal(load_simulated("reference"), 1, effect)
    rows: list[tuple[str, ...]] = []
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        held_out = run_profile(bench, PROVE, place, "held_out", virtual=True).recording
        for length_s in LENGTHS_S:
            profile = _repeated(LEARN, length_s, bench.gains.period_s)
            recorded = run_profile(bench, profile, place, f"train_{length_s:.0f}", virtual=True).recording
            begin = perf_counter()
            subprocess.run(
                [
                    *_HIL,
                    "diagnose",
                    str(recorded),
                    "--validate",
                    str(held_out),
                    "--bench",
                    "reference",
                    "--out",
                    str(place / f"out_{length_s:.0f}"),
                ],
                check=True,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            took_s = perf_counter() - begin
            rows.append((f"{length_s:.0f} s", f"{took_s:.1f} s", f"{took_s / length_s:.2f}"))
    table(("recording at 1 kHz", "diagnosis", "per second of recording"), rows)


def _repeated(profile: Profile, length_s: float, period_s: float) -> Profile:
    """A profile over and over, for as long as `length_s`."""
    data = profile.model_dump(mode="json")
    times = max(round(length_s / plan(profile, period_s).duration_s), 1)
    return Profile.model_validate(
        data | {"segments": [{"kind": "repeat", "times": times, "segments": data["segments"]}]}
    )


if __name__ == "__main__":
    typer.run(measure)
