"""Loggers of one run: joined by their stamps at the rows of the slowest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from foreign_axis import axis, csv_text

from hil.errors import InputError
from hil.explanation import explain
from hil.importing.foreign_table import read_table
from hil.importing.joined_logs import STAMP, join_logs
from hil.importing.readme import FileHints
from hil.importing.several_files import set_points_alone

AXIS = axis(6000)
T, EVERY = AXIS["t"], 4  # the controller writes every fourth row
BEGIN = pd.Timestamp("2025-03-11T14:07:31.200")


def controller(path: Path, begin: pd.Timestamp = BEGIN) -> Path:
    """Positions with dates of the local clock, from the first row on."""
    stamps = [(begin + pd.Timedelta(seconds=float(one))).isoformat(timespec="microseconds") for one in T[::EVERY]]
    rows = zip(stamps, AXIS["x_set"][::EVERY], AXIS["x_act"][::EVERY], strict=True)
    path.write_text("stamp;cmd [mm];act [mm]\n" + "".join(f"{a};{b:.4f};{c:.4f}\n" for a, b, c in rows))
    return path


def drive(path: Path, hours: float = 0.0) -> Path:
    """Speed and torque by a clock that is ahead by hours, from 0.5 s after the controller on."""
    late = T >= 0.5
    stamps = BEGIN + pd.to_timedelta(T[late], "s") + pd.Timedelta(hours=hours)
    columns = {"rpm": AXIS["speed"][late] * 30 / np.pi, "torque_Nm": AXIS["torque"][late]}
    pd.DataFrame({"timestamp": stamps, **columns}).to_parquet(path)
    return path


@pytest.mark.parametrize("hours", [0.0, -1.0])
def test_rows_are_those_of_the_slowest_in_the_time_that_all_have(tmp_path: Path, hours: float) -> None:
    joined = tmp_path / "joined.csv"
    told = join_logs([controller(tmp_path / "a.csv"), drive(tmp_path / "b.parquet", hours)], joined)
    assert ("b.parquet by -1 h" in told) is (hours == -1.0)
    table = read_table(joined).columns
    there = (T >= 0.5) & (np.arange(T.size) % EVERY == 0)
    assert table[STAMP] == pytest.approx(T[there] - T[there][0], abs=2e-6)
    assert table["act [mm]"] == pytest.approx(AXIS["x_act"][there], abs=1e-4)
    of_row = np.convolve(AXIS["torque"], [0.125, 0.25, 0.25, 0.25, 0.125], "same")  # its mean over the row
    assert table["torque_Nm"][2:-2] == pytest.approx(of_row[there][2:-2], abs=1e-3)


@pytest.mark.parametrize("first", ["controller", "drive"])
def test_explain_joins_what_is_no_axis_alone(tmp_path: Path, first: str) -> None:
    paths = [controller(tmp_path / "controller.csv"), drive(tmp_path / "drive.parquet")]
    seen = list[str]()

    def look(lines: list[str]) -> None:
        seen.extend(lines)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        explain(paths if first == "controller" else paths[::-1], tmp_path / "out", look=look)
    assert "inertia at the motor 0.00200 kg m^2" in " ".join(seen)
    assert (tmp_path / "out" / f"{first}-joined.csv").is_file()


def test_a_gap_is_left_open_a_wrap_is_counted_on_and_constants_are_kept(tmp_path: Path) -> None:
    counts = np.floor(AXIS["angle"] / (2.0 * np.pi) * 4096) % 4096
    lost = (T > 2.0) & (T < 3.0)
    first, second = tmp_path / "fast.csv", tmp_path / "slow.csv"
    content = csv_text({"t_s": T[~lost], "torque [%]": 40.0 * AXIS["torque"][~lost]})
    first.write_text("# rated torque: 2.5 Nm\n" + content)
    second.write_text(csv_text({"t_s": T[::EVERY], "encoder [counts]": counts[::EVERY]}))
    join_logs([first, second], tmp_path / "joined.csv")
    table = read_table(tmp_path / "joined.csv")
    assert {one.value for one in table.constants.values()} == {2.5}
    here = np.isfinite(table.columns["torque [%]"])
    assert table.columns[STAMP][~here][[0, -1]] == pytest.approx([2.0, 3.0], abs=0.02)
    assert np.max(np.abs(np.diff(table.columns["encoder [counts]"]))) < 2000.0


def test_a_slow_thermometer_does_not_give_the_rows(tmp_path: Path) -> None:
    thermometer = tmp_path / "warm.csv"
    seconds = BEGIN + pd.to_timedelta(np.arange(1, 6), "s")
    thermometer.write_text("stamp,temperature [degC]\n" + "".join(f"{one.isoformat()},20.5\n" for one in seconds))
    paths = [controller(tmp_path / "a.csv"), drive(tmp_path / "b.parquet"), thermometer]
    join_logs(paths, tmp_path / "joined.csv")
    assert read_table(tmp_path / "joined.csv").columns[STAMP].size > 900


@pytest.mark.parametrize("dated", [True, False])
def test_beside_a_whole_recording_only_dates_tell_loggers_of_one_run(tmp_path: Path, dated: bool) -> None:
    whole, other = tmp_path / "whole.csv", drive(tmp_path / "drive.parquet")
    whole.write_text(csv_text({"t_s": T, "x_mm": AXIS["x_act"], "torque_Nm": AXIS["torque"]}))
    paths = [controller(tmp_path / "a.csv"), other] if dated else [whole, other]
    if dated:
        join_logs(paths, tmp_path / "joined.csv", one_is_whole=True)
        return
    with pytest.raises(InputError, match=r"one lacks the position or the torque, another has both"):
        join_logs(paths, tmp_path / "joined.csv", one_is_whole=True)


def test_one_map_serves_files_whose_drafts_say_the_same(tmp_path: Path) -> None:
    columns = {"t_s": T, "x [mm]": AXIS["x_act"], "torque [Nm]": AXIS["torque"]}
    files = {"one.csv": columns, "two.csv": columns, "rad.csv": {**columns, "torque [mNm]": 1e3 * AXIS["torque"]}}
    del files["rad.csv"]["torque [Nm]"]
    for name, one in files.items():
        (tmp_path / name).write_text(csv_text(one))
    out = tmp_path / "out"

    class Read(Exception):
        pass

    def stop(lines: list[str]) -> None:
        raise Read

    with pytest.raises(Read):
        explain([tmp_path / name for name in files], out, look=stop)
    assert not (out / "two-map.yaml").exists()
    assert (out / "rad-map.yaml").exists()


def test_loggers_of_two_runs_and_files_without_stamps_are_refused(tmp_path: Path) -> None:
    other = controller(tmp_path / "other.csv", BEGIN + pd.Timedelta(minutes=10))
    with pytest.raises(InputError, match=r"other\.csv, drive\.parquet: their stamps have 0\.00 s in common"):
        join_logs([other, drive(tmp_path / "drive.parquet")], tmp_path / "joined.csv")
    bare = tmp_path / "bare.csv"
    bare.write_text("# rate: 1000 Hz\n" + csv_text({"torque_Nm": AXIS["torque"], "speed_rpm": AXIS["speed"]}))
    with pytest.raises(InputError, match=r"bare\.csv: has no stamps"):
        join_logs([other, bare], tmp_path / "joined.csv")
    assert not (tmp_path / "joined.csv").exists()


@pytest.mark.parametrize("rows", [T.size, T.size - 7])
def test_files_without_stamps_have_the_same_rows_if_these_are_as_many(tmp_path: Path, rows: int) -> None:
    number = np.arange(T.size)
    moved = {"No": number, "pos [mm]": AXIS["x_act"]}
    (tmp_path / "moved.csv").write_text(csv_text(moved))
    driven = {"No": number[:rows], "M_act [Nm]": AXIS["torque"][:rows]}
    (tmp_path / "driven.csv").write_text(csv_text(driven))
    (tmp_path / "README.md").write_text("Two files of the scope with the same samples, 1 kHz, 6 s:\n")
    paths, joined = [tmp_path / "moved.csv", tmp_path / "driven.csv"], tmp_path / "joined.csv"
    hints = FileHints(readme=tmp_path / "README.md")
    if rows < T.size:
        with pytest.raises(InputError, match=r"moved\.csv: has no stamps"):
            join_logs(paths, joined, hints=hints)
        return
    assert "joined by their rows" in join_logs(paths, joined, hints=hints)
    table = read_table(joined).columns
    assert set(table) == {STAMP, "pos [mm]", "M_act [Nm]"}
    assert table[STAMP] == pytest.approx(number * 1e-3, abs=1e-9)
    assert table["M_act [Nm]"] == pytest.approx(AXIS["torque"], abs=1e-4)


def test_a_file_of_set_points_beside_a_recording_is_left_out(tmp_path: Path) -> None:
    whole = {"t [s]": T, "x_act [mm]": AXIS["x_act"], "torque_Nm": AXIS["torque"]}
    (tmp_path / "run.csv").write_text(csv_text(whole))
    sent = {"t": T, "q_ref": AXIS["x_set"], "dq_ref": np.gradient(AXIS["x_set"], T)}
    (tmp_path / "sent.csv").write_text(csv_text(sent))
    paths = [tmp_path / "run.csv", tmp_path / "sent.csv"]
    assert set_points_alone(paths) == [paths[1]]
    assert set_points_alone(paths[1:]) == []
    assert set_points_alone([paths[1], paths[1]]) == []
    assert set_points_alone([controller(tmp_path / "a.csv"), drive(tmp_path / "b.parquet")]) == []
