"""Wrong input of commands and public functions: one sentence that names the input, never a traceback."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hil
from hil.files.output import new_folder
from hil.files.shipped import shipped_files
from hil.report.console import out, table

BENCH = hil.load_bench("reference")
PROFILE = Path(__file__).parents[3] / "profiles" / "jog.yaml"
COLUMNS = {name: np.zeros(400) for name in ("position_command_m", "velocity_command_m_s", "motor_position_rad")}


@pytest.mark.parametrize("folder", ["", ".", "/"])
def test_results_are_not_written_to_the_working_folder(folder: str) -> None:
    with pytest.raises(hil.InputError, match="allowed a new folder"), new_folder(Path(folder)):
        pass


def test_square_brackets_in_a_name_are_printed_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    out.print("jog on [/]")
    table(("[bold]", "[/]"), [("[/x]", "1")])
    printed = capsys.readouterr().out
    assert "jog on [/]" in printed
    assert "[/x]" in printed


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("lead_m: 0.010", "lead_m: 1e-300"),
        ("velocity_gain_ma_rpm: 20", "velocity_gain_ma_rpm: 1e308"),
        ("counts_per_rev: 1048576", "counts_per_rev: 99999999999999999"),
    ],
)
def test_numbers_that_no_axis_has_are_refused_at_their_line(tmp_path: Path, key: str, wrong: str) -> None:
    text = shipped_files("bench")["reference"].read_text()
    assert key in text
    path = tmp_path / "bench.yaml"
    path.write_text(text.replace(key, wrong))
    with pytest.raises(hil.InputError, match=rf"bench.yaml:\d+: .*{key.split(':')[0]}: given .*, allowed "):
        hil.load_bench(path)


def test_a_recording_is_checked_when_it_is_made() -> None:
    for value in (np.nan, np.inf, 1e200):
        bad = np.zeros(400)
        bad[5] = value
        with pytest.raises(hil.InputError, match=r"mine: row 5: torque_n_m: given .*, allowed a finite number up to"):
            hil.Recording("mine", COLUMNS | {"torque_n_m": bad}, 0.001)
    with pytest.raises(hil.InputError, match="mine: columns: given the lengths"):
        hil.Recording("mine", COLUMNS | {"torque_n_m": np.zeros(3)}, 0.001)
    for period_s in (np.nan, 0.0, -1.0, np.inf):
        with pytest.raises(hil.InputError, match=r"mine: period_s: given .*, allowed a positive number"):
            hil.Recording("mine", COLUMNS, period_s)


@given(start_m=st.floats(min_value=1e3) | st.floats(max_value=-1e3))
def test_a_start_far_outside_every_axis_is_refused(start_m: float) -> None:
    with pytest.raises(hil.FieldError, match=r"start_m: given .*, allowed -100 to 100 m"):
        hil.plan(hil.load_profile(PROFILE), 0.001, start_m)


def test_a_period_with_too_many_set_points_is_refused() -> None:
    with pytest.raises(hil.FieldError, match=r"period_s: given 1e-300 s .* allowed up to 2e"):
        hil.plan(hil.load_profile(PROFILE), 1e-300)


def test_limits_that_ruckig_cannot_solve_are_named_in_one_line(tmp_path: Path) -> None:
    text, count = re.subn(r"jerk_m_s3: [^,}\n]+", "jerk_m_s3: 1e-300", PROFILE.read_text(), count=1)
    assert count == 1
    (tmp_path / "slow.yaml").write_text(text)
    with pytest.raises(hil.InputError, match=r"^[^\n]*slow.yaml:[^\n]* 1e-300 m/s\^3\), allowed [^\n]*\Z"):
        hil.load_profile(tmp_path / "slow.yaml")


@pytest.mark.parametrize("seed", [-1, 1.5, "x"])
def test_a_seed_is_a_whole_number(seed: int) -> None:
    trajectory = hil.plan(hil.load_profile(PROFILE), BENCH.period_s)
    with pytest.raises(hil.FieldError, match=r"simulation.seed: given .*, allowed a whole number"):
        hil.simulate(BENCH, trajectory, seed=seed)


@pytest.mark.parametrize("name", ["", "../outside", "a/b", "a\0b"])
def test_a_run_is_named_without_a_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(hil.InputError, match=r"name: given .*, allowed a file name"):
        hil.run(BENCH, hil.load_profile(PROFILE), tmp_path / "in", name, virtual=True)
    assert not list(tmp_path.rglob("*.arrows"))


def test_nothing_to_fit_to_and_no_round_are_refused(tmp_path: Path) -> None:
    with pytest.raises(hil.InputError, match="recordings: given none"):
        hil.fit_nominal([], BENCH)
    with pytest.raises(hil.InputError, match="rounds: given 0, allowed 1 or more"):
        hil.investigate({"jog": hil.load_profile(PROFILE)}, BENCH, tmp_path / "new", rounds=0, virtual=True)


def test_a_full_disk_behind_stdout_is_one_sentence() -> None:
    command = [sys.executable, "-m", "hil.cli", "--help"]
    with open("/dev/full", "w") as full:
        ran = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (ran.returncode, ran.stderr) == (1, "output: no space left on the device; make room\n")


def test_a_run_without_standard_streams_is_recorded(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hil.cli", "run", str(PROFILE), "--virtual", "--out", str(tmp_path)]
    assert subprocess.run(["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", *command]).returncode == 0
    assert len(hil.read_recording(tmp_path / "jog.parquet")) > 5000
