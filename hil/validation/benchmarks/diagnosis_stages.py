"""Seconds that each stage of one fixed diagnosis takes: the motions of `hil demo` on an axis with cogging torque.

The stages are told apart by the steps that the diagnosis itself announces; kernels come from numba's cache.
"""

import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from time import perf_counter

from hil.diagnosis.diagnose import diagnose
from hil.loop.run import run_profile
from hil.loop.simulated_bench import load_simulated
from hil.recording.recording import read_recording
from hil.report.diagnosis_report import write_diagnosis
from hil.twin.mechanisms import cogging_torque
from hil.validation.benchmarks.figure import Figure
from hil.validation.proof.draw.demo import LEARN, PROVE, conceal

SEED = 1
IMPORTS = "import hil.diagnosis.diagnose, hil.report.diagnosis_report"
# First words of an announced step -> its stage.
STAGES = {
    "checking": "preparation",
    "refitting": "nominal fit",
    "screening": "screen",
    "fitting": "fits",
    "searching": "fits",
    "testing on held-out": "held out",
    "locating": "location",
    "comparing": "location",
    "testing which": "observability",
    "designing": "next experiment",
}


class StageWatch:
    """Sums the time of each stage; called with the text of each step as it begins."""

    def __init__(self) -> None:
        self.seconds = defaultdict[str, float](float)
        self._stage, self._since = "", 0.0

    def __call__(self, step: str) -> None:
        """End the running stage and begin that of `step`; a step that `STAGES` does not know is its own stage."""
        self.end()
        self._stage = next((stage for words, stage in STAGES.items() if step.startswith(words)), step)

    def end(self) -> None:
        """End the running stage."""
        now = perf_counter()
        if self._stage:
            self.seconds[self._stage] += now - self._since
        self._stage, self._since = "", now


def figures() -> list[Figure]:
    """Seconds of the stages in their order, and of all of them."""
    effect = cogging_torque.MECHANISM.id
    bench, _ = conceal(load_simulated("reference"), SEED, effect)
    watch = StageWatch()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        train, held_out = (
            run_profile(bench, profile, place, name, virtual=True).recording
            for name, profile in (("train", LEARN), ("held_out", PROVE))
        )
        assert train is not None
        assert held_out is not None
        watch("imports")
        subprocess.run([sys.executable, "-c", IMPORTS], check=True)
        watch("read")
        recordings = [read_recording(train)], [read_recording(held_out)]
        watch("preparation")
        diagnosis = diagnose(*recordings, load_simulated("reference"), watch)
        watch("report")
        (place / "report").mkdir()
        write_diagnosis(diagnosis, place / "report")
        watch.end()
    rows = len(recordings[0][0])
    detail = f"{effect} on the reference bench, {rows} rows at 1 kHz; kernels compiled before"
    stages = {**watch.seconds, "in all": sum(watch.seconds.values())}
    return [
        Figure(f"diagnosis, {stage}", f"diag., {stage}", seconds, "s", at_most=True, detail=detail)
        for stage, seconds in stages.items()
    ]
