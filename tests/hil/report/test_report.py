"""Pages open in a real browser without a network, lines keep their peaks, and results are whole or not there."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compare_runs import bench_with, record
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread
from processes import DEADLINE_S

from hil.bench.bench_file import Bench, load_bench
from hil.errors import InputError
from hil.figures.panels import MEASURED, SIMULATED, Line, Panel, thin
from hil.files.output import new_folder, write_json
from hil.identification.compare import compare
from hil.identification.figures import fastest_move
from hil.identification.measured import bench_of
from hil.quantities import quantity
from hil.report.compare_report import write_bench, write_comparison
from hil.report.page import Page
from hil.report.plots import over_time

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def rendered(page: Path, profile: Path) -> str:
    """The page's document after its scripts ran, in a browser that cannot reach any host."""
    if CHROMIUM is None:
        pytest.skip("no chromium to open the page with: apt-get install chromium")
    ran = subprocess.run(
        [
            CHROMIUM,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            f"--user-data-dir={profile}",
            "--host-resolver-rules=MAP * ~NOTFOUND",
            "--virtual-time-budget=10000",
            "--enable-logging=stderr",
            "--dump-dom",
            page.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=True,
    )
    errors = [line for line in ran.stderr.splitlines() if "CONSOLE" in line and "[bokeh" not in line]
    assert not errors
    return ran.stdout


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a run with a fit."""
    folder = tmp_path_factory.mktemp("report")
    recording = record(folder, bench_with({"axis": {"table_mass_kg": 400.0}}))
    result = compare(recording, bench_of(recording), fit=True)
    with new_folder(folder / "out") as part:
        write_comparison(result, part)
    return folder / "out"


def test_the_report_is_complete(report: Path) -> None:
    assert {path.name for path in report.iterdir()} == {
        "compare.html",
        "compare.json",
        "bench.fitted.yaml",
        "overview.png",
        "move.png",
        "blocks.png",
    }
    assert (report / "compare.html").stat().st_size < 3e6
    for picture in report.glob("*.png"):
        assert np.ptp(imread(picture)) > 0.5  # neither blank nor cut
    numbers = json.loads((report / "compare.json").read_text())
    assert numbers["explained"] is True
    assert numbers["channels"]["torque_n_m"]["unit"] == "N m"
    assert 0.9 < numbers["torque_over_noise"] < 1.3
    fitted = load_bench(report / "bench.fitted.yaml")
    values = {entry["name"]: entry["value"] for entry in numbers["parameters"]}
    axis = fitted.axis.model_dump(exclude={"held"})
    assert axis == pytest.approx(axis | values)
    assert values["table_mass_kg"] == pytest.approx(400.0, rel=0.01)


def test_the_page_works_without_a_network(report: Path, tmp_path: Path) -> None:
    text = (report / "compare.html").read_text()
    assert not re.search(r'<(?:script|link|img)[^>]+(?:src|href)="(?!data:)', text)
    document = rendered(report / "compare.html", tmp_path)
    assert document.count('class="bk-Canvas"') + document.count("bk-GridPlot") >= 2
    body = re.sub(r"<script.*?</script>", "", document, flags=re.DOTALL)
    assert body.index("The twin explains this recording") < body.index("Measured and simulated")
    assert "following error" in body


def test_the_verdict_names_the_block(tmp_path: Path) -> None:
    effect = {"effect": "periodic_lead_error", "parameters": {"amplitude_m": 8e-6, "phase_rad": 0.5}}
    recording = record(tmp_path, bench_with({"effects": [effect]}))
    result = compare(recording, bench_of(recording))
    assert result.statement.startswith("The twin leaves something out: motor torque deviates by ")
    assert "Furthest from its noise: transmission and table" in result.statement
    assert "--fit" in result.statement


def test_the_fastest_move_is_cut_out(tmp_path: Path) -> None:
    recording = record(tmp_path, bench_with())
    result = compare(recording, bench_of(recording))
    rows = fastest_move(result)
    assert np.max(np.abs(recording["velocity_command_m_s"][rows])) == np.max(np.abs(recording["velocity_command_m_s"]))
    assert recording["velocity_command_m_s"][rows.start] == recording["velocity_command_m_s"][rows.stop - 1] == 0.0
    assert rows.stop - rows.start < len(recording) / 2


@pytest.mark.parametrize("name", ["reference", "emps"])
def test_a_written_bench_reads_the_same(name: str, tmp_path: Path) -> None:
    bench: Bench = load_bench(name)
    write_bench(bench, tmp_path / "bench.yaml")
    assert load_bench(tmp_path / "bench.yaml") == bench


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=3000), st.integers(50, 500), st.integers(1, 3))
def test_thinning_keeps_the_extremes(values: list[float], limit: int, count: int) -> None:
    column = np.array(values)
    columns = tuple(np.roll(column, shift) for shift in range(count))
    rows = thin(columns, limit)
    assert np.all(np.diff(rows) > 0)
    assert rows[0] == 0
    assert rows[-1] == column.size - 1
    stretch = -(-column.size * 2 * count // limit)
    assert rows.size <= limit + stretch + 2
    for values_of in columns:
        assert values_of[rows].max() == values_of.max()
        assert values_of[rows].min() == values_of.min()


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.48e-7, "m", "0.148 µm"),
        (0.1, "m", "100 mm"),
        (0.0, "m", "0.00 µm"),
        (0.366667, "m/s", "22.0 m/min"),
        (0.0098, "N m", "9.80 mN m"),
        (1.1, "N m", "1.10 N m"),
        (95.109, "kg", "95.1 kg"),
        (-2.5, "N", "-2.50 N"),
        (3e-9, "N", "3.00e-09 N"),
    ],
)
def test_quantities_are_readable(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text


def test_long_recordings_stay_light(tmp_path: Path) -> None:
    time_s = np.arange(600_000) * 1e-3
    noise = np.random.default_rng(1).normal(size=(2, time_s.size))
    lines = (Line("measured", noise[0], MEASURED, broad=True), Line("simulated", noise[1], SIMULATED))
    page = Page("long", "", "verdict", True)
    page.plot(over_time(time_s, [Panel("position", "m", lines)] * 16))
    page.write(tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size < 3e6


@pytest.mark.parametrize("legend", ["", "Bar: green is good."])
def test_a_legend_stands_below_the_verdict(legend: str, tmp_path: Path) -> None:
    Page("t", "l", "It is so.", True, legend).write(tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    shown = re.findall(r'<div class="verdict good">It is so.</div>\s*<p class="lead">(.*?)</p>', page)
    assert shown == [legend][: len(legend)]


def test_text_is_escaped(tmp_path: Path) -> None:
    page = Page("<b>", "a & b", "<script>alert(1)</script>", False)
    page.table(("<i>",), [("1 < 2",)], left=())
    page.items(["<u>"])
    page.write(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert not re.search(r"<(b|i|u|script)>", text)
    assert "1 &lt; 2" in text


@pytest.mark.parametrize("value", [float("nan"), float("inf"), np.float64("nan"), np.array([1.0, np.inf])])
def test_json_refuses_what_is_no_number(value: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\$\.fit\[0\].*must be a finite number"):
        write_json(tmp_path / "a.json", {"fit": [value]})
    assert not list(tmp_path.iterdir())


def test_a_failed_result_leaves_nothing(tmp_path: Path) -> None:
    def fail(folder: Path) -> None:
        with new_folder(folder) as part:
            (part / "a.txt").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail(tmp_path / "made" / "on the way" / "out")
    assert not list(tmp_path.iterdir())


def test_old_and_new_results_do_not_mix(tmp_path: Path) -> None:
    with new_folder(tmp_path / "out") as part:
        (part / "a.txt").write_text("first")
    with pytest.raises(InputError, match="not empty"), new_folder(tmp_path / "out"):
        pytest.fail("the folder was opened")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out" / "a.txt").read_text() == "first"
    (tmp_path / "empty").mkdir()
    with new_folder(tmp_path / "empty") as part:
        (part / "b.txt").write_text("new")
    assert (tmp_path / "empty" / "b.txt").read_text() == "new"
