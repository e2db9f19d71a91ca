"""The command line as a user meets it: exit codes, one message, no trace, nothing written half."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from command_line import hil, process, refused
from compare_runs import bench_with, record
from patient_bench import patient_bench_file
from processes import DEADLINE_S

from hil.report.compare_report import write_bench

SWEEP = Path(__file__).parents[3] / "profiles" / "friction_sweep.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a run as Parquet and CSV, and its bench."""
    path = tmp_path_factory.mktemp("cli")
    bench = bench_with()
    recording = record(path, bench)
    names = ("time_s", *recording.axis.predicted, "position_command_m", "velocity_command_m_s")
    np.savetxt(
        path / "run.csv",
        np.column_stack([recording[name] for name in names]),
        delimiter=",",
        header=",".join(names),
        comments="",
        fmt="%.9f",
    )
    write_bench(bench, path / "bench.yaml")
    return path


def changed(folder: Path, name: str, old: str, new: str) -> Path:
    """A copy of a text file with a change."""
    text = (folder / name).read_text()
    assert old in text
    path = folder / f"changed_{abs(hash((name, old, new)))}{Path(name).suffix}"
    path.write_text(text.replace(old, new, 1))
    return path


def test_help_lists_the_commands_and_imports_nothing_heavy(tmp_path: Path) -> None:
    ran = process(tmp_path, "--help")
    assert ran.returncode == 0
    for command in ("import", "compare", "diagnose", "investigate", "friction", "paper", "validate"):
        assert f" {command} " in ran.stdout
    heavy = "{'numpy', 'scipy', 'numba', 'pyarrow', 'matplotlib', 'bokeh', 'pydantic', 'yaml', 'canopen', 'can'}"
    code = f"import sys, hil.cli; sys.exit(', '.join({heavy} & set(sys.modules)) or 0)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert loaded.returncode == 0, loaded.stderr


@pytest.mark.parametrize("temporary", [True, False])
def test_an_installation_that_cannot_be_written(tmp_path: Path, temporary: bool) -> None:
    for package in ("hil", "drivers"):
        shutil.copytree(
            Path(__file__).parents[3] / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    for folder in {source.parent for source in tmp_path.rglob("*.py")}:
        (folder / "__pycache__").touch()  # a file in its place stops even root
    (tmp_path / "tmp").mkdir()
    environment = {"PATH": os.environ["PATH"], "XDG_CACHE_HOME": os.devnull, "TMPDIR": str(tmp_path / "tmp")}
    code = "from hil.cli import main; main()"
    if not temporary:  # tempfile takes any folder it finds, so that none must be left
        code = "import tempfile; tempfile.tempdir = '/dev/null'; " + code
    ran = subprocess.run(
        [sys.executable, "-c", code, "validate", "hil/benches/reference.yaml"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == (0 if temporary else 1), ran.stderr
    assert "Traceback" not in ran.stderr
    if temporary:
        assert list((tmp_path / "tmp").glob("hil-kernels-*/hil-kernels-*/*/*.nbi"))
    else:
        assert "no folder for compiled kernels is writable" in ran.stderr


def test_compare_writes_a_report_and_says_where(folder: Path) -> None:
    ran = process(folder, "compare", "run.csv", "--bench", "bench.yaml", "--out", "report")
    assert ran.returncode == 0, ran.stderr
    assert "The twin explains this recording" in ran.stdout
    assert "Report: report/compare.html" in ran.stdout
    assert ran.stderr.splitlines() == ["simulating ...", "block by block ...", "writing the report ..."]
    assert json.loads((folder / "report" / "compare.json").read_text())["explained"] is True
    assert "report: exists and is not empty" in refused(
        folder, "compare", "run.csv", "--bench", "bench.yaml", "--out", "report"
    )


def test_a_run_of_the_bench_needs_no_bench_file(folder: Path) -> None:
    ran = hil(folder, "compare", "run.parquet", "--out", "own/results")
    assert ran.returncode == 0, ran.stderr
    assert "bench reference" in (folder / "own" / "results" / "compare.html").read_text()
    assert "no bench is recorded in it" in refused(folder, "compare", "run.csv")


def test_a_bad_bench_is_refused_with_its_line(folder: Path) -> None:
    line = (folder / "bench.yaml").read_text().splitlines().index("  table_mass_kg: 384.0") + 1
    for new, said in (
        (": heavy", "given 'heavy', allowed a valid number"),
        ("_lb: 384.0", "given an unknown key"),
        (": -3", "given -3, allowed greater than 0"),
    ):
        bad = changed(folder, "bench.yaml", "table_mass_kg: 384.0", f"table_mass_kg{new}")
        message = refused(folder, "compare", "run.csv", "--bench", bad.name)
        assert f"{bad.name}:{line}: axis.table_mass_kg" in message
        assert said in message
        assert message == refused(folder, "validate", bad.name)
    broken = changed(folder, "bench.yaml", "axis:", "axis: [")
    assert f"{broken.name}:" in refused(folder, "validate", broken.name)
    assert "broken YAML" in refused(folder, "validate", broken.name)
    assert "no such bench; give a .yaml file or one of" in refused(folder, "compare", "run.csv", "--bench", "nowhere")


def test_a_bad_recording_is_refused(folder: Path) -> None:
    assert "there is no such file" in refused(folder, "compare", "none.parquet", "--bench", "reference")
    cut = folder / "cut.parquet"
    cut.write_bytes((folder / "run.parquet").read_bytes()[:5000])
    assert "cut.parquet: is no readable Parquet file" in refused(folder, "compare", "cut.parquet")
    lines = (folder / "run.csv").read_text().splitlines()
    (folder / "torn.csv").write_text("\n".join([*lines[:700], lines[700][:12]]))
    assert "torn.csv:701" in refused(folder, "compare", "torn.csv", "--bench", "reference")


def test_a_missing_encoder_is_refused(folder: Path) -> None:
    for channel, said in (
        ("table_position_m", "table_position_m is not recorded"),
        ("motor_position_rad", "motor_position_rad missing"),
    ):
        bad = changed(folder, "run.csv", channel, "something_else")
        assert said in refused(folder, "compare", bad.name, "--bench", "bench.yaml")


def test_import_by_a_map(folder: Path) -> None:
    (folder / "map.yaml").write_text(
        "about: a test\ntime: {column: time_s, unit: s}\nchannels:\n"
        + "".join(
            f"  {name}: {{column: {name}, unit: {unit}}}\n"
            for name, unit in (
                ("position_command_m", "m"),
                ("motor_position_rad", "rad"),
                ("table_position_m", "m"),
                ("torque_command_n_m", "N m"),
                ("torque_n_m", "N m"),
            )
        )
    )
    ran = hil(folder, "import", "run.csv", "--map", "map.yaml", "--out", "imported.parquet")
    assert ran.returncode == 0, ran.stderr
    assert "velocity_command_m_s: central differences" in ran.stdout
    again = refused(folder, "import", "run.csv", "--map", "map.yaml", "--out", "imported.parquet")
    assert "is not overwritten" in again
    wrong = changed(folder, "map.yaml", "unit: rad", "unit: kg")
    assert f"{wrong.name}:" in refused(folder, "import", "run.csv", "--map", wrong.name, "--out", "x.parquet")
    nan = changed(folder, "run.csv", "\n0.100000000,0.000000000", "\n0.100000000,nan")
    assert "motor_position_rad: given 'nan'" in refused(folder, "import", nan.name, "--map", "map.yaml")


def test_friction_on_the_bench_gives_the_values_of_the_axis(folder: Path) -> None:
    ran = hil(folder, "friction", "--bench", "bench.yaml", "--profile", str(SWEEP), "--virtual", "--out", "sweep")
    assert ran.returncode == 0, ran.stderr
    found = json.loads((folder / "sweep" / "friction.json").read_text())
    assert found["coulomb"] == pytest.approx(1.1, rel=0.02)
    assert found["viscous"] == pytest.approx(0.0064, rel=0.02)
    assert (folder / "sweep" / "friction.html").is_file()
    assert "stretches of constant feed" in refused(folder, "friction", "run.csv")
    assert "given neither or both" in refused(folder, "friction")


@pytest.mark.parametrize(
    ("section", "values", "said"),
    [
        ("drive", {"mode": "csp"}, "drive.mode: given csp with position_feedback: table"),
        ("drive", {"encoder": {"interface": "none"}}, "drive.encoder.interface: given none with a table encoder"),
        ("encoders", {"motor": {"counts_per_rev": 4096, "direction": -1}}, "encoders.motor.direction: given -1"),
    ],
)
def test_validate_refuses_what_run_refuses(tmp_path: Path, section: str, values: dict[str, Any], said: str) -> None:
    data = bench_with().model_dump(mode="json")
    data["control"]["position_feedback"] = "table"
    data[section] |= values
    (tmp_path / "bad.yaml").write_text(yaml.safe_dump(data))
    message = refused(tmp_path, "validate", "bad.yaml")
    assert "bad.yaml:" in message
    assert said in message
    assert message == refused(tmp_path, "run", str(SWEEP), "--bench", "bad.yaml", "--virtual", "--out", "out")


def test_validate_tells_what_a_file_is(folder: Path) -> None:
    ran = hil(folder, "validate", "bench.yaml", str(SWEEP))
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[0] == "bench.yaml: a bench with a two_mass axis and 0 mechanisms"
    assert "a profile of" in ran.stdout
    profile = folder / "profile.yaml"
    profile.write_text(SWEEP.read_text().replace("limits:", "limit:", 1))
    assert "profile.yaml:" in refused(folder, "validate", "profile.yaml")
    text = (folder / "bench.yaml").read_text()
    assert "simulation:" in text
    (folder / "ghost.yaml").write_text(text.split("simulation:")[0] + "simulation: {effects: [{effect: ghost}]}\n")
    assert "simulation.effects[0]: given ghost" in refused(folder, "validate", "ghost.yaml")


def test_what_a_run_refuses_names_file_and_line(folder: Path) -> None:
    jog = str(SWEEP.with_name("jog.yaml"))
    text = (folder / "bench.yaml").read_text()
    (folder / "bare.yaml").write_text(text.split("drive:")[0])
    assert "bare.yaml:1: drive: given nothing" in refused(folder, "run", jog, "--bench", "bare.yaml", "--virtual")
    (folder / "short.yaml").write_text(text.split("drive:")[0] + "drive: {travel_m: [-0.01, 0.02]}\nsimulation: {}\n")
    assert "jog.yaml:10: segments: given set-points" in refused(
        folder, "run", jog, "--bench", "short.yaml", "--virtual"
    )
    assert "--seed" in refused(folder, "run", jog, "--virtual", "--seed", "-1")


def test_a_bench_name_with_square_brackets_is_printed_as_it_is(folder: Path) -> None:
    data = yaml.safe_load((folder / "bench.yaml").read_text()) | {"name": "[/]"}
    (folder / "brackets.yaml").write_text(yaml.safe_dump(data))
    jog = str(SWEEP.with_name("jog.yaml"))
    ran = hil(folder, "run", jog, "--bench", "brackets.yaml", "--virtual", "--out", "brackets")
    assert ran.returncode == 0, ran.stderr
    assert "jog on [/]:" in ran.stderr


def test_wrong_usage_is_2(folder: Path) -> None:
    assert "No such command" in refused(folder, "measure")
    assert process(folder, "measure").returncode == 2
    assert "No such option" in refused(folder, "compare", "run.csv", "--bensh", "reference")


def test_ctrl_c_ends_with_130_and_leaves_nothing(folder: Path) -> None:
    ran = subprocess.Popen(
        [sys.executable, "-m", "hil.cli", "paper", "--out", "interrupted"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert ran.stderr is not None
    assert ran.stderr.readline() == "computing the paper ...\n"
    ran.send_signal(signal.SIGINT)
    _, errors = ran.communicate(timeout=DEADLINE_S)
    assert ran.returncode == 130
    assert errors == "stopped by ctrl-C\n"
    assert not [path for path in folder.iterdir() if "interrupted" in path.name]


def test_ctrl_c_during_a_run_stops_the_axis_and_keeps_the_recording(folder: Path) -> None:
    bench = str(patient_bench_file(folder))
    ran = subprocess.Popen(
        [sys.executable, "-m", "hil.cli", "run", str(SWEEP), "--bench", bench, "--force", "--out", "stopped"],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    stream = folder / "stopped" / "friction_sweep.arrows"
    while ran.poll() is None and not (stream.exists() and stream.stat().st_size > 20_000):  # in the middle of it
        time.sleep(0.05)
    ran.send_signal(signal.SIGINT)
    _, errors = ran.communicate(timeout=DEADLINE_S)
    assert ran.returncode == 130, errors
    assert "stopped by ctrl-C" in errors
    assert "Traceback" not in errors
    assert [path.name for path in (folder / "stopped").iterdir()] == ["friction_sweep.parquet"]
