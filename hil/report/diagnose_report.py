"""The report of `hil diagnose`: page, pictures, numbers, and the bench that now explains the recordings."""

from __future__ import annotations

from pathlib import Path

from hil.diagnosis.diagnose import Diagnosis
from hil.report.compare_report import write_bench
from hil.report.output import write_json


def write_diagnosis(diagnosis: Diagnosis, folder: Path) -> None:
    """Write diagnosis.json, report.html with its PNGs, and bench.diagnosed.yaml."""
    write_json(folder / "diagnosis.json", diagnosis.result.as_json())
    write_bench(diagnosis.bench, folder / "bench.diagnosed.yaml")
