"""hil diagnose as a user meets it when something is wrong: code 2, the reason, nothing written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from diagnosis_runs import bench, changed, recorded

from hil.commands.diagnose import diagnose
from hil.errors import InputError
from hil.recording.recording import Recording, write_parquet
from hil.report.compare_report import write_bench


@pytest.fixture
def bench_file(tmp_path: Path) -> str:
    write_bench(bench(), tmp_path / "bench.yaml")
    return str(tmp_path / "bench.yaml")


def refused(folder: Path, bench_file: str, recording: Recording) -> str:
    """Message of the command for a recording that it must refuse."""
    run = folder / "run.parquet"
    write_parquet(recording, run)
    with pytest.raises(InputError) as error:
        diagnose([run], None, bench_file, folder / "out")
    assert error.value.exit_code == 2
    assert sorted(path.name for path in folder.iterdir()) == ["bench.yaml", "run.parquet"]
    return str(error.value)


def test_a_torque_of_wrong_sign_is_refused(tmp_path: Path, bench_file: str) -> None:
    run = changed(recorded(bench(), times=3), torque_n_m=-1.0, torque_command_n_m=-1.0)
    assert "torque_n_m has the wrong sign" in refused(tmp_path, bench_file, run)


def test_a_table_in_millimetres_is_refused(tmp_path: Path, bench_file: str) -> None:
    run = changed(recorded(bench(), times=3), table_position_m=1e3)
    message = refused(tmp_path, bench_file, run)
    assert "table_position_m: is 100" in message
    assert "× the value expected from the set-points, which suggests mm" in message


def test_a_recording_that_holds_out_too_little_is_refused(tmp_path: Path, bench_file: str) -> None:
    run = recorded(bench())
    run = replace(run, columns={name: values[:1400] for name, values in run.columns.items()})
    assert "part): too short: given 0.467 s" in refused(tmp_path, bench_file, run)


def test_a_training_recording_proves_nothing(tmp_path: Path, bench_file: str) -> None:
    run = tmp_path / "run.parquet"
    write_parquet(recorded(bench(), times=3), run)
    with pytest.raises(InputError, match="--validate: given run, which is a training recording too"):
        diagnose([run], [run], bench_file, tmp_path / "out")
