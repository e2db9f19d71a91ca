"""hil explain: from a file to a page, in a folder whose map and bench are taken up again."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import hil
from diagnosis_runs import SEGMENTS, bench, moves, recorded
from foreign_axis import COULOMB_N_M, INERTIA_KG_M2, axis

from hil.recording.recording import write_parquet

FOLDER = "explained-axis"


def written(folder: Path, unit: str = "[Nm]", factor: float = 1.0) -> Path:
    """A text file of an axis: time, angle and torque, the latter with this unit."""
    columns = axis(2500)
    path = folder / "axis.csv"
    rows = np.column_stack([columns["t"], columns["angle"], factor * columns["torque"]])
    np.savetxt(path, rows, delimiter=",", header=f"time [s],angle [rad],torque {unit}", comments="", fmt="%.9g")
    return path


def printed(out: str, name: str) -> float:
    """Value that the table of the bench gives a parameter."""
    found = re.search(rf"^{name} +(\S+)", out, flags=re.MULTILINE)
    assert found, out
    return float(found.group(1))


@pytest.fixture(scope="module")
def explained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """Folder of a first explanation, and what it printed."""
    folder = tmp_path_factory.mktemp("explain")
    ran = hil(folder, "explain", written(folder).name, "--budget", "10")
    assert ran.returncode == 0, ran.stderr
    return folder, ran.stdout, ran.stderr


def test_one_command_writes_map_bench_and_page(explained: tuple[Path, str, str]) -> None:
    folder, out, err = explained
    names = {path.name for path in (folder / FOLDER).iterdir()}
    assert names == {"axis-map.yaml", "bench.yaml", "report"}
    page = (folder / FOLDER / "report" / "report.html").read_text()
    assert "What was assumed" in page
    assert "axis-map.yaml: which column is what" in page
    assert printed(out, "inertia_kg_m2") == pytest.approx(INERTIA_KG_M2, rel=0.02)
    assert f"Report: {FOLDER}/report/report.html" in out
    assert "bench.yaml: masses, friction, lead, gains, encoders" in err
    assert "Nothing tells the size" not in out
    assert re.search(r"^torque not explained +[\d.]+ % +[\d.]+ %", out, flags=re.MULTILINE)


def test_the_first_answer_comes_before_the_search(explained: tuple[Path, str, str]) -> None:
    _, out, _ = explained
    assert out.index("Plain model: inertia") < out.index("coulomb_torque_n_m") < out.index("noise floor")


@pytest.mark.long
def test_a_corrected_bench_is_taken_up_again(explained: tuple[Path, str, str]) -> None:
    folder, _, _ = explained
    bench = folder / FOLDER / "bench.yaml"
    before = bench.read_text()
    mended = re.sub(r"(coulomb_torque_n_m: )\S+", r"\g<1>0.5", before)
    bench.write_text(mended)
    try:
        ran = hil(folder, "explain", "axis.csv", "--budget", "10")
        assert ran.returncode == 0, ran.stderr
        assert bench.read_text() == mended
        assert "bench.yaml: used as it is" in ran.stderr
        assert "axis-map.yaml: used as it is for axis.csv" in ran.stderr
        found = json.loads((folder / FOLDER / "report" / "diagnosis.json").read_text())
        coulomb = found["parameter_corrections"]["coulomb_torque_n_m"]
        assert coulomb["nominal"] == 0.5
        assert coulomb["value"] == pytest.approx(COULOMB_N_M, rel=0.02)
    finally:
        bench.write_text(before)


def test_an_option_of_another_draft_is_refused_where_a_map_is(explained: tuple[Path, str, str]) -> None:
    folder, _, _ = explained
    ran = hil(folder, "explain", "axis.csv", "--rate", "500")
    assert ran.returncode == 2
    assert "axis-map.yaml: it is there already and was not drafted with --rate 500" in ran.stderr.replace("\n", " ")


@pytest.mark.long
def test_files_of_one_name_and_other_units_have_a_map_each(tmp_path: Path) -> None:
    for name, unit, factor in (("first", "[Nm]", 1.0), ("second", "[mNm]", 1e3)):
        (tmp_path / name).mkdir()
        written(tmp_path / name, unit, factor)
    ran = hil(tmp_path, "explain", "first/axis.csv", "second/axis.csv", "--out", "both", "--budget", "5")
    assert ran.returncode == 0, ran.stderr
    assert {path.name for path in (tmp_path / "both").glob("*-map.yaml")} == {
        "first-axis.csv-map.yaml",
        "second-axis.csv-map.yaml",
    }


@pytest.mark.long
def test_files_whose_sizes_are_found_with_errors_share_a_map(tmp_path: Path) -> None:
    """Counts per revolution are found by a speed beside them: 3977 in both files, within the noise of the speed."""
    columns, names = axis(5000), []
    for part in (slice(0, 2500), slice(2500, 5000)):
        noisy = columns["speed"][part] * 60.0 / (2.0 * np.pi) * (1.0 + 1e-4 * (part.start > 0))
        counts = np.round(columns["angle"][part] / (2.0 * np.pi / 3977.0))
        rows = np.column_stack([columns["t"][part], counts, noisy, columns["torque"][part]])
        names.append(f"part_{part.start}.csv")
        header = "time [s],pos [inc],speed [rpm],torque [Nm]"
        np.savetxt(tmp_path / names[-1], rows, delimiter=",", header=header, comments="", fmt="%.9g")
    hil(tmp_path, "explain", *names, "--budget", "1")
    (found,) = (tmp_path / "explained-part_0").glob("*-map.yaml")
    assert "counts_per_rev: " in found.read_text()


def test_numbers_without_a_unit_count_as_they_are_and_the_page_says_so(tmp_path: Path) -> None:
    """The torque in tenths of something: inertia and friction are ten times the true ones, and it is told."""
    written(tmp_path, "", 10.0)
    ran = hil(tmp_path, "explain", "axis.csv", "--budget", "5")
    assert ran.returncode == 0, ran.stderr
    assert "torque_n_m: its numbers count as N m" in ran.stderr
    assert printed(ran.stdout, "inertia_kg_m2") == pytest.approx(10.0 * INERTIA_KG_M2, rel=0.02)
    told = "Nothing tells the size of torque_n_m: values are multiples"
    assert told in " ".join(ran.stdout.split())
    assert told in " ".join(ran.stderr.split())  # before the search
    page = (tmp_path / FOLDER / "report" / "report.html").read_text()
    assert "its numbers count as N m" in page
    assert '<div class="verdict warning">The size of a channel is not known' in page


@pytest.mark.long
def test_a_doubt_about_a_map_is_told_until_it_is_settled(tmp_path: Path) -> None:
    written(tmp_path, "", 10.0)
    assert hil(tmp_path, "explain", "axis.csv", "--budget", "5").returncode == 0
    path = tmp_path / FOLDER / "axis-map.yaml"
    edited = path.read_text().replace("about:", "about: edited")
    path.write_text(edited.replace('unit: "N m"', 'unit: "N m"\n    offset: 0.0'))
    again = hil(tmp_path, "explain", "axis.csv", "--budget", "5")
    assert "torque_n_m: its numbers count as N m" in again.stderr
    assert "Nothing tells the size of torque_n_m" in " ".join(again.stdout.split())

    path.write_text(path.read_text().replace('unit: "N m"', 'unit: "N m"\n    scale: 0.1'))
    corrected = hil(tmp_path, "explain", "axis.csv", "--budget", "5")
    assert corrected.returncode == 0, corrected.stderr
    assert "Nothing tells the size" not in corrected.stderr + corrected.stdout
    assert printed(corrected.stdout, "inertia_kg_m2") == pytest.approx(INERTIA_KG_M2, rel=0.02)


@pytest.mark.long
def test_the_rate_of_a_first_run_is_read_from_the_map(tmp_path: Path) -> None:
    """The file has neither time stamps nor a unit of its torque; a second run, without the option, tells it too."""
    columns = axis(2500)
    rows = np.column_stack([columns["angle"], columns["torque"]])
    np.savetxt(tmp_path / "axis.csv", rows, delimiter=",", header="angle [rad],torque", comments="", fmt="%.9g")
    for options in (["--rate", "500"], []):
        ran = hil(tmp_path, "explain", "axis.csv", "--budget", "5", *options)
        assert ran.returncode == 0, ran.stderr
        assert "Nothing tells the size of torque_n_m" in " ".join(ran.stdout.split())


def test_a_question_comes_with_what_else_was_assumed(tmp_path: Path) -> None:
    """A clock of unknown unit, and no column that the motion explains as a torque."""
    other = np.random.default_rng(1).normal(0.0, 1.0, (2500, 2))
    rows = np.column_stack([10 * np.arange(2500), axis(2500)["angle"], other])
    np.savetxt(tmp_path / "axis.csv", rows, delimiter=",", header="tick,angle_rad,a1,a2", comments="", fmt="%.9g")
    ran = hil(tmp_path, "explain", "axis.csv")
    assert ran.returncode == 2
    told = " ".join(ran.stderr.split())
    assert "no column is known to be the torque, force, current or voltage" in told
    assert "clock: the unit of 'tick' is not given; ms is taken" in told


def test_a_file_that_cannot_be_read_leaves_no_folder(tmp_path: Path) -> None:
    (tmp_path / "axis.csv").write_text("nothing\nhere\n")
    ran = hil(tmp_path, "explain", "axis.csv")
    assert ran.returncode == 2
    assert "axis.csv" in ran.stderr
    assert not (tmp_path / FOLDER).exists()


def test_a_folder_of_the_user_is_not_replaced(tmp_path: Path) -> None:
    written(tmp_path)
    kept = tmp_path / FOLDER / "report" / "mine.txt"
    kept.parent.mkdir(parents=True)
    kept.write_text("mine")
    ran = hil(tmp_path, "explain", "axis.csv", "--budget", "5")
    assert ran.returncode == 2
    assert "report: exists and is not empty" in ran.stderr
    assert kept.read_text() == "mine"


def test_a_run_of_a_bench_needs_neither_map_nor_draft(tmp_path: Path) -> None:
    owner = bench()
    run = recorded(owner, profile=moves(SEGMENTS[:5], 2))
    write_parquet(replace(run, metadata={"bench": owner.model_dump(mode="json")}), tmp_path / "run.parquet")
    ran = hil(tmp_path, "explain", "run.parquet", "--budget", "5")
    assert ran.returncode == 0, ran.stderr
    assert {path.name for path in (tmp_path / "explained-run").iterdir()} == {"report"}
    assert "the bench with which it was recorded" in ran.stderr


@pytest.mark.parametrize("name", ["axis-map.yaml", "bench.yaml"])
def test_a_map_or_bench_of_another_encoding_is_refused(tmp_path: Path, name: str) -> None:
    table = written(tmp_path).name
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / name).write_bytes("# Prüfstand\n".encode("latin-1"))
    ran = hil(tmp_path, "explain", table)
    assert ran.returncode == 2
    assert f"{name}: byte 4 is not UTF-8; give a YAML text file" in ran.stderr.replace("\n", " ")
    assert "Traceback" not in ran.stderr
