"""A recording survives a disk that is full, does not answer, or is cut off."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from processes import state_of, wait_for
from recorders import CHANNELS, assert_holds, blocks_of, recorder, recover, rings, row

from hil.errors import HilError
from hil.recording import ring
from hil.recording.blocks import encode
from hil.recording.keeper import HUNG_S
from hil.recording.recording import read_recording


def mounted(folder: Path, *command: str) -> Iterator[Path]:
    done = subprocess.run([*command, str(folder)], capture_output=True, check=False)
    if done.returncode:
        pytest.skip(f"no right to mount: {done.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "small").mkdir()
    yield from mounted(tmp_path / "small", "mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs")


@pytest.fixture
def freezable_disk(tmp_path: Path) -> Iterator[Path]:
    image, folder = tmp_path / "image", tmp_path / "frozen"
    image.write_bytes(bytes(16 << 20))
    folder.mkdir()
    if missing := [name for name in ("mkfs.ext4", "fsfreeze") if shutil.which(name) is None]:
        pytest.skip(f"{', '.join(missing)} not in the path, usually in /usr/sbin")
    subprocess.run(["mkfs.ext4", "-q", str(image)], capture_output=True, check=True)
    yield from mounted(folder, "mount", "-o", "loop", str(image))


def fill(disk: Path) -> Path:
    """Leave no block of a disk free; returns the file to remove."""
    path = disk / "ballast"
    with path.open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while file.write(bytes(4096)):
            pass
    return path


def test_a_full_disk_costs_no_row_once_it_has_room_again(small_disk: Path, capfd: pytest.CaptureFixture[str]) -> None:
    run = recorder(small_disk, 100)
    ballast = fill(small_disk)
    for k in range(100, 5000):
        run.record(row(k))
    wait_for(lambda: "No space left" in run.error)
    assert run.rows_on_disk < 5000
    ballast.unlink()
    wait_for(lambda: run.rows_on_disk == 5000)
    wait_for(lambda: not run.error)
    assert_holds(run.close(), np.arange(5000))
    said = capfd.readouterr().err
    assert "No space left on device" in said
    assert "make room" in said


def test_a_disk_that_is_full_before_the_run_is_refused(small_disk: Path) -> None:
    fill(small_disk)
    with pytest.raises(HilError, match=r"recorder stopped at row 0: .*No space left on device.*choose another folder"):
        recorder(small_disk)
    assert [path.name for path in small_disk.iterdir()] == ["ballast"]
    assert not rings(os.getpid())


def test_lack_of_shared_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring, "FOLDER", tmp_path / "absent")
    with pytest.raises(HilError, match=r"no shared memory .*; mount a tmpfs at"):
        recorder(tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_too_little_shared_memory_is_refused(small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring, "FOLDER", small_disk)  # a tmpfs of 1 MB
    with pytest.raises(HilError, match="no shared memory for 65536 rows of 5 values"):
        recorder(tmp_path / "out")
    assert list(small_disk.iterdir()) == []


def test_a_disk_that_stays_full_keeps_the_rest_in_memory_for_recovery(small_disk: Path) -> None:
    run = recorder(small_disk, 100)
    ballast = fill(small_disk)
    for k in range(100, 5000):
        run.record(row(k))
    with pytest.raises(
        HilError, match=r"No space left on device; .* rows are in memory only .*hil recover .*run\.arrows"
    ):
        run.close("complete: the profile is done")
    on_disk = run.rows_on_disk
    assert len(read_recording(run.stream_path)) == on_disk < 5000
    ballast.unlink()
    assert f"5000 rows, {5000 - on_disk} of them from memory; no gap" in recover(small_disk)
    assert_holds(small_disk / "run.parquet", np.arange(5000))
    assert read_recording(small_disk / "run.parquet").metadata["ended"] == "complete: the profile is done"


def test_a_disk_that_does_not_answer_does_not_hold_the_loop(
    freezable_disk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run = recorder(freezable_disk, 100)
    subprocess.run(["fsfreeze", "--freeze", str(freezable_disk)], check=True)
    try:
        for k in range(100, 5000):
            run.record(row(k))
        wait_for(lambda: state_of(run.writer_pid) == "D")
        told: list[str] = []
        wait_for(lambda: told.append(capfd.readouterr().err) or "the disk does not answer" in "".join(told))
    finally:
        subprocess.run(["fsfreeze", "--unfreeze", str(freezable_disk)], check=True)
    assert_holds(run.close(), np.arange(5000))
    assert "writers_replaced" not in read_recording(run.path).metadata


@pytest.mark.parametrize("torn", [0, 9])
def test_a_block_written_but_not_counted_is_neither_lost_nor_doubled(tmp_path: Path, torn: int) -> None:
    """As of a writer killed between both; with a torn one behind it."""
    run = recorder(tmp_path, 100)
    os.kill(run.keeper_pid, signal.SIGSTOP)
    os.kill(run.writer_pid, signal.SIGKILL)
    wait_for(lambda: state_of(run.writer_pid) == "Z")
    for k in range(100, 300):
        run.record(row(k))
    schema = pa.schema([pa.field(name, pa.float64(), nullable=False) for name in CHANNELS])
    with run.stream_path.open("ab") as file:
        file.write(encode(np.array([row(k) for k in range(100, 150)]), 100, schema))
        file.write(encode(np.array([row(k) for k in range(150, 160)]), 150, schema)[:torn])
    os.kill(run.keeper_pid, signal.SIGCONT)
    assert_holds(run.close(), np.arange(300))


def test_a_file_that_was_cut_while_its_writer_was_replaced_keeps_what_is_left(tmp_path: Path) -> None:
    run = recorder(tmp_path, 100)
    for k in range(100, 200):
        run.record(row(k))
    wait_for(lambda: run.rows_on_disk == 200)
    last = blocks_of(run.stream_path)[-1]
    os.kill(run.keeper_pid, signal.SIGSTOP)
    os.kill(run.writer_pid, signal.SIGKILL)
    wait_for(lambda: state_of(run.writer_pid) == "Z")
    os.truncate(run.stream_path, last.end - 20)
    os.kill(run.keeper_pid, signal.SIGCONT)
    for k in range(200, 300):
        run.record(row(k))
    wait_for(lambda: run.rows_on_disk == 300)
    blocks = blocks_of(run.stream_path)
    kept = np.concatenate([block.rows[:, 1] for block in blocks])
    assert np.array_equal(kept, np.r_[0 : last.first, 200:300])
    with pytest.raises(HilError, match="recorder stopped"):
        run.close()
    recover(tmp_path)
    assert_holds(tmp_path / "run.parquet", np.r_[0:300])  # the ring still has them


@pytest.mark.long
def test_a_writer_that_waits_for_the_disk_is_not_replaced(freezable_disk: Path) -> None:
    run = recorder(freezable_disk, 100)
    subprocess.run(["fsfreeze", "--freeze", str(freezable_disk)], check=True)
    try:
        run.record(row(100))
        wait_for(lambda: state_of(run.writer_pid) == "D")
        time.sleep(HUNG_S + 1.0)  # longer than a writer may be silent
    finally:
        subprocess.run(["fsfreeze", "--unfreeze", str(freezable_disk)], check=True)
    assert_holds(run.close(), np.arange(101))
    assert "writers_replaced" not in read_recording(run.path).metadata


# -- damaged files ----------------------------------------------------------------------------------------------------
