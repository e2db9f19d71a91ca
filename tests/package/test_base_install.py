"""Without the extra `report` a command prints and writes its numbers, and says what to install for pages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from processes import DEADLINE_S

CLEAN = Path(__file__).parents[1] / "recordings" / "clean.parquet"
BASE = "import sys; sys.modules |= dict.fromkeys(('matplotlib', 'bokeh', 'distributed', 'starlette', 'uvicorn')); "


def base(code: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", BASE + code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)


def test_a_comparison_without_plots_writes_its_numbers(tmp_path: Path) -> None:
    run = "from hil.cli import main; main()"
    ran = base(run, "compare", CLEAN, "--bench", "reference", "--out", tmp_path / "compared")
    assert ran.returncode == 0, ran.stderr
    assert "No page and no pictures: they need matplotlib and bokeh: pip install 'hil-servo[report]'" in ran.stdout
    assert [path.name for path in (tmp_path / "compared").iterdir()] == ["compare.json"]


def test_figures_of_iso_230_without_plots_are_numbers(tmp_path: Path) -> None:
    rows = [f"{target},{error}" for error in (1, 2) for target in (10, 25, 60, 60, 25, 10)]
    (tmp_path / "laser.csv").write_text("\n".join(["target_mm,deviation_um", *rows]) + "\n")
    ran = base("from hil.cli import main; main()", "iso230", tmp_path / "laser.csv", "--out", tmp_path / "judged")
    assert ran.returncode == 0, ran.stderr
    assert [path.name for path in (tmp_path / "judged").iterdir()] == ["iso230.json"]


def test_what_explains_and_diagnoses_needs_no_plots() -> None:
    ran = base("import hil.explanation, hil.investigation, hil.report.summary, hil.report.friction_report")
    assert ran.returncode == 0, ran.stderr


def test_a_command_that_only_draws_says_what_it_needs(tmp_path: Path) -> None:
    ran = base("from hil.cli import main; main()", "paper", "--out", tmp_path / "paper")
    assert ran.returncode == 2
    told = "this command needs matplotlib, which is not installed: pip install 'hil-servo[report]'"
    assert ran.stderr.strip() == told
