"""The recorder loses nothing, overwrites nothing, and leaves a readable file however a run ends."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from processes import DEADLINE_S, is_over, wait_for

from hil.errors import HilError, InputError
from hil.recording.blocks import encode
from hil.recording.recording import read_recording
from hil.recording.writer import Recorder, run_metadata

CHANNELS = ("time_s", "position_command_m", "velocity_command_m_s", "motor_position_rad", "torque_n_m")
PERIOD_S = 0.001


def row(k: int) -> tuple[float, ...]:
    return (k * PERIOD_S, k * 1.0, k * 2.0, k * 3.0, k * 4.0)


def recorder(folder: Path, name: str = "run", **options: object) -> Recorder:
    return Recorder(folder, name, CHANNELS, PERIOD_S, {"seed": 7}, **options)  # type: ignore[arg-type]


def assert_rows(path: Path, rows: int) -> None:
    """The file holds rows 0 .. rows-1, bit by bit."""
    recording = read_recording(path)
    assert len(recording) == rows
    expected = np.array([row(k) for k in range(rows)])
    for index, name in enumerate(CHANNELS):
        assert np.array_equal(recording[name], expected[:, index])


def no_room(run: Recorder) -> None:
    """Let the writer meet the end of its disk (setrlimit(2): File too large); rows then wait in the ring."""
    resource.prlimit(run.writer_pid, resource.RLIMIT_FSIZE, (run.stream_path.stat().st_size, resource.RLIM_INFINITY))


def room(run: Recorder) -> None:
    wait_for(lambda: "File too large" in run.error)
    resource.prlimit(run.writer_pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))


def test_the_loop_s_side_is_light() -> None:
    code = "import hil.recording.writer, sys; sys.exit(bool({'pyarrow', 'scipy', 'pydantic'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", ["", "../run", "a\0"])
def test_a_name_that_is_no_file_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="recorder: name: given"):
        recorder(tmp_path / "in", name)
    assert not list(tmp_path.iterdir())


def test_every_row_arrives_through_a_ring_much_smaller_than_the_run(tmp_path: Path) -> None:
    with recorder(tmp_path, lossless=True, ring_rows=64) as run:
        for k in range(5000):
            run.record(row(k))
    assert_rows(run.path, 5000)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.parquet"]
    recording = read_recording(run.path)
    assert recording.period_s == PERIOD_S
    assert recording.metadata == {"seed": 7, "ended": "complete", "rows": 5000, "rows_lost": 0}


def test_a_second_run_into_the_same_folder_gets_a_new_name(tmp_path: Path) -> None:
    first, second = recorder(tmp_path), recorder(tmp_path)  # at the same time
    for k in range(10):
        first.record(row(k))
        second.record(row(k))
    assert first.close() == tmp_path / "run.parquet"
    before = (tmp_path / "run.parquet").read_bytes()
    assert second.close() == tmp_path / "run_2.parquet"
    third = recorder(tmp_path)
    assert third.stream_path == tmp_path / "run_3.arrows"
    assert third.close() is None  # without a row no file
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["run.parquet", "run_2.parquet"]
    assert (tmp_path / "run.parquet").read_bytes() == before


def test_without_lossless_the_loop_never_waits_and_the_recording_marks_its_gap(tmp_path: Path) -> None:
    run = recorder(tmp_path, ring_rows=128)
    no_room(run)
    for k in range(200):
        run.record(row(k))
    room(run)
    wait_for(lambda: run.rows_on_disk == 128)
    for k in range(200, 300):
        run.record(row(k))
    path = run.close()
    assert path is not None
    assert run.rows_lost == 72
    recording = read_recording(path)
    assert recording.metadata["rows_lost"] == 72
    assert recording.metadata["gaps"] == [{"row": 128, "rows_lost": 72}]
    before, after = recording.parts()
    assert np.array_equal(before["position_command_m"], np.arange(128.0))
    assert np.array_equal(after["position_command_m"], np.arange(200.0, 300.0))


def test_after_a_loss_rows_are_taken_again_when_half_of_the_ring_is_free(tmp_path: Path) -> None:
    """A ring of 64 rows, full: 24 to its end reach the disk, which are not enough; then all."""
    run = recorder(tmp_path, ring_rows=64)
    rows = np.array([row(k) for k in range(200)])
    run.record_block(rows[:40])
    wait_for(lambda: run.rows_on_disk == 40)
    no_room(run)
    run.record_block(rows[40:114])
    assert run.rows_recorded == 104
    assert run.gaps == [(104, 10)]
    schema = pa.schema([pa.field(name, pa.float64(), nullable=False) for name in CHANNELS])
    bytes_of_24 = len(encode(rows[40:64], 40, schema))
    wait_for(lambda: "File too large" in run.error)
    size = run.stream_path.stat().st_size
    resource.prlimit(run.writer_pid, resource.RLIMIT_FSIZE, (size + bytes_of_24, resource.RLIM_INFINITY))
    wait_for(lambda: run.rows_on_disk == 64)
    run.record_block(rows[114:124])
    assert run.gaps == [(104, 20)]
    room(run)
    wait_for(lambda: run.rows_on_disk == 104)
    run.record_block(rows[124:184])
    assert run.rows_recorded == 164
    run.close()
    assert run.gaps == [(104, 20)]


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
@pytest.mark.parametrize("lossless", [True, False])
def test_a_writer_that_is_killed_or_stopped_is_replaced_and_no_row_is_lost(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], lossless: bool, how: signal.Signals
) -> None:
    run = recorder(tmp_path, lossless=lossless, ring_rows=1024)
    for k in range(200):
        run.record(row(k))
    wait_for(lambda: run.rows_on_disk == 200)
    first = run.writer_pid
    os.kill(first, how)
    for k in range(200, 1000):
        run.record(row(k))
    wait_for(lambda: run.rows_on_disk == 1000)  # while the run goes on
    assert run.writer_pid != first
    assert is_over(first)
    path = run.close()
    assert_rows(path, 1000)
    assert read_recording(path).metadata["writers_replaced"] == 1
    assert f"recorder of run.arrows: its process {first} was" in capfd.readouterr().err
    assert run.close() is None


def test_a_full_disk_is_reported_and_what_fitted_is_readable(tmp_path: Path) -> None:
    run = recorder(tmp_path, lossless=True, ring_rows=256)
    resource.prlimit(run.writer_pid, resource.RLIMIT_FSIZE, (100_000, 100_000))

    def fill() -> None:
        for k in range(100_000):
            run.record(row(k))

    with pytest.raises(HilError, match=r"run\.arrows: the recorder stopped at row \d+: .*File too large"):
        fill()
    recording = read_recording(run.stream_path)
    assert len(recording) >= run.rows_on_disk > 1000
    assert "recovered" in recording.metadata


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (("time_s", "speed"), "unknown: speed"),
        (("time_s", "torque_n_m", "torque_n_m"), "each once"),
        (("torque_n_m",), "allowed time_s"),
    ],
)
def test_wrong_channels_are_refused_before_anything_is_written(
    tmp_path: Path, channels: tuple[str, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Recorder(tmp_path / "runs", "run", channels, PERIOD_S, {})
    assert not (tmp_path / "runs").exists()


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file: cannot be written .* choose another folder"):
        recorder(tmp_path / "file")


def test_files_in_the_working_folder_are_no_modules_of_the_recorder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("struct.py", "json.py", "numpy.py"):
        (tmp_path / name).write_text("raise ImportError\n")
    monkeypatch.chdir(tmp_path)
    run = recorder(tmp_path / "out")
    run.record(row(0))
    run.close()
    assert run.path.exists()


def test_metadata_tells_versions_and_everything_needed_to_repeat_a_run() -> None:
    about = run_metadata(
        bench={"name": "b"}, profile={"name": "p"}, seed=3, commands=["hil", "run"], start_time="2024-01-01T00:00:00Z"
    )
    assert about["versions"]["numpy"] == np.__version__
    assert (about["bench"], about["seed"], about["commands"]) == ({"name": "b"}, 3, ["hil", "run"])


LOOP = """
import sys, time
from hil.recording.writer import Recorder
channels = ("time_s", "position_command_m", "velocity_command_m_s", "motor_position_rad", "torque_n_m")
with Recorder(sys.argv[1], "run", channels, 0.001, {"seed": 7}) as run:
    print(run.writer_pid, flush=True)
    k = 0
    while k < int(sys.argv[2]):
        for k in range(k, k + 10):
            run.record((k * 0.001, k * 1.0, k * 2.0, k * 3.0, k * 4.0))
        k += 1
        time.sleep(0.001)
        print(run.rows_recorded, run.rows_on_disk, flush=True)
    time.sleep(600)
"""


class Loop:
    """A recording loop in a process of its own, which the tests end by force."""

    def __init__(self, folder: Path, rows: int) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", LOOP, str(folder), str(rows)],
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert self.process.stdout is not None
        self.output = self.process.stdout
        self.writer_pid = int(self.output.readline())
        self.stream = folder / "run.arrows"

    def wait_for_rows(self, recorded: int = 0, on_disk: int = 0) -> tuple[int, int]:
        for line in self.output:
            progress = int(line.split()[0]), int(line.split()[1])
            if progress[0] >= recorded and progress[1] >= on_disk:
                return progress
        raise AssertionError("the loop ended")

    def end(self, how: signal.Signals) -> None:
        self.process.send_signal(how)
        self.process.wait(DEADLINE_S)
        self.output.close()


def test_a_loop_killed_mid_run_loses_no_row(tmp_path: Path) -> None:
    loop = Loop(tmp_path, rows=1000)
    loop.wait_for_rows(recorded=1000)
    loop.end(signal.SIGKILL)
    wait_for(lambda: is_over(loop.writer_pid))  # it saves what is in the ring
    assert_rows(loop.stream, 1000)
    assert read_recording(loop.stream).metadata["recovered"].startswith("the run was not closed: 1000 rows")


def test_loop_and_writer_killed_mid_run_leave_the_rows_on_disk(tmp_path: Path) -> None:
    loop = Loop(tmp_path, rows=10_000_000)
    _, on_disk = loop.wait_for_rows(on_disk=500)
    os.kill(loop.writer_pid, signal.SIGKILL)
    loop.end(signal.SIGKILL)
    recording = read_recording(loop.stream)
    assert len(recording) >= on_disk
    assert_rows(loop.stream, len(recording))
    assert recording.metadata["seed"] == 7
    assert "recovered" in recording.metadata


def test_rows_reach_the_disk_without_further_rows_pushing_them(tmp_path: Path) -> None:
    run = recorder(tmp_path)
    for k in range(5):
        run.record(row(k))
    wait_for(lambda: run.rows_on_disk == 5)
    assert_rows(run.stream_path, 5)  # while the run is going on
    run.close()


def test_ctrl_c_leaves_a_closed_recording(tmp_path: Path) -> None:
    loop = Loop(tmp_path, rows=300)
    loop.wait_for_rows(recorded=300)
    loop.end(signal.SIGINT)
    assert_rows(tmp_path / "run.parquet", 300)
    assert read_recording(tmp_path / "run.parquet").metadata["ended"] == "KeyboardInterrupt"
    assert not loop.stream.exists()
