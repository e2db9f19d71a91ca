"""Duration of a diagnosis over the length of a recording: python -m hil.benchmarks.diagnosis [--effect ID]

The simulated bench repeats the motion of `hil demo` with a concealed effect. Each length is diagnosed in a new process;
the first one also compiles the kernels that are not yet in numba's cache.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from hil.loop.run import run_profile
from hil.loop.simulated_bench import load_simulated
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.proof.draw.demo import LEARN, PROVE, conceal
from hil.report.console import table
from hil.twin.mechanisms import cogging_torque

LENGTHS_S = (25.0, 50.0, 100.0, 200.0)
_HIL = (sys.executable, "-c", "from hil.cli import main; main()")


def measure(
    effect: Annotated[str, typer.Option(help="Concealed effect.")] = cogging_torque.MECHANISM.id,
) -> None:
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
            paths = {"--validate": held_out, "--bench": "reference", "--out": place / f"out_{length_s:.0f}"}
            options = [str(text) for option in paths.items() for text in option]
            subprocess.run([*_HIL, "diagnose", str(recorded), *options], check=True, capture_output=True)
            took_s = perf_counter() - begin
            rows.append((f"{length_s:.0f} s", f"{took_s:.1f} s", f"{took_s / length_s:.2f}"))
    table(("recording at 1 kHz", "diagnosis", "per second of recording"), rows)


def _repeated(profile: Profile, length_s: float, period_s: float) -> Profile:
    """A profile repeated to a length of about `length_s`."""
    data = profile.model_dump(mode="json")
    times = max(round(length_s / plan(profile, period_s).duration_s), 1)
    return Profile.model_validate(
        data | {"segments": [{"kind": "repeat", "times": times, "segments": data["segments"]}]}
    )


if __name__ == "__main__":
    typer.run(measure)
