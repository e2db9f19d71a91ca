"""Report of `hil diagnose`: numbers, the bench with the corrected parameters and the findings, and the page."""

from collections.abc import Sequence
from pathlib import Path

from hil.bench.hardware import SimulationSection
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.experiment import NEXT_EXPERIMENT
from hil.files.optional_library import missing_of
from hil.files.output import write_json
from hil.motion.profile import write_profile
from hil.report.diagnosed_bench import write_diagnosed_bench


def write_diagnosis(
    diagnosis: Diagnosis,
    folder: Path,
    assumed: Sequence[str] = (),
    bench_file: Path | None = None,
    machine: SimulationSection | None = None,
) -> None:
    """Write diagnosis.json, bench.diagnosed.yaml and, if one helps, next_experiment.yaml.

    With the libraries of the extra `report` also report.html with its PNGs; `assumed` of recordings and bench is told
    there, so that a reader can correct it. `bench_file` is the owner's, whose comments stay; `machine` the simulated
    axis, if it is not that of the bench.
    """
    write_json(folder / "diagnosis.json", diagnosis.result.as_json())
    write_diagnosed_bench(diagnosis, folder / "bench.diagnosed.yaml", bench_file, machine)
    if diagnosis.experiment and diagnosis.experiment.profile:
        write_profile(folder / NEXT_EXPERIMENT, diagnosis.experiment.profile)
    if not missing_of("report"):
        from hil.report.diagnosis_page import write_page  # loads the libraries of plots, after the numbers are there

        write_page(diagnosis, folder, assumed)
