"""A recording survives its processes and its disk: real processes, signals, files, and disks full or frozen."""

from __future__ import annotations

import contextlib
import fcntl
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from command_line import hil, refused
from processes import DEADLINE_S, is_over, state_of, wait_for

from hil.errors import HilError, InputError
from hil.recording import ring
from hil.recording.blocks import StreamBlock, encode, read_head, whole_blocks
from hil.recording.keeper import HUNG_S
from hil.recording.recording import read_recording
from hil.recording.recover import remains, unfinished
from hil.recording.writer import Recorder

CHANNELS = ("time_s", "position_command_m", "motor_position_rad", "torque_n_m", "lateness_s")
PERIOD_S = 0.001
ROWS = 500


def row(k: int) -> tuple[float, ...]:
    return (k * PERIOD_S, k * 1.0, k * 2.0, k * 3.0, k * 1e-7)


def recorder(folder: Path, rows: int = 0, **options: int) -> Recorder:
    """A recorder as of a run, with some rows already on the disk."""
    metadata = {"seed": 7, "real_time": {"clock": "wall"}}
    run = Recorder(folder, "run", CHANNELS, PERIOD_S, metadata, **options)
    for k in range(rows):
        run.record(row(k))
    wait_for(lambda: run.rows_on_disk == rows)
    return run


def assert_holds(path: Path, numbers: np.ndarray) -> None:
    """The file holds the rows of these numbers, bit by bit."""
    recording = read_recording(path)
    expected = np.array([row(int(k)) for k in numbers])
    for index, name in enumerate(CHANNELS):
        assert np.array_equal(recording[name], expected[:, index]), name


def rings(pid: int) -> list[Path]:
    """Files of the rings that a process has made."""
    return list(ring.FOLDER.glob(f"{ring.PATTERN[:-1]}{pid}-*"))


LOOP = f"""
import sys
from pathlib import Path
from hil.recording.writer import Recorder
channels = {CHANNELS!r}
run = Recorder(Path(sys.argv[1]), "run", channels, {PERIOD_S}, {{"seed": 7, "real_time": {{"clock": "wall"}}}})
for k in range({ROWS}):
    run.record((k * {PERIOD_S}, k * 1.0, k * 2.0, k * 3.0, k * 1e-7))
print(run.keeper_pid, run.writer_pid, flush=True)
sys.stdin.read()
"""


class Loop:
    """A loop in a process of its own that has recorded ROWS rows and now stands still."""

    def __init__(self, folder: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", LOOP, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.keeper, self.writer = map(int, self.process.stdout.readline().split())

    def kill(self, *pids: int) -> None:
        """Kill processes of the recorder, then the loop; the test removes what they leave."""
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
        self.process.kill()
        self.process.communicate(timeout=DEADLINE_S)


def recover(folder: Path) -> str:
    ran = hil(folder, "recover", "run.arrows")
    assert ran.returncode == 0, ran.stderr
    return " ".join(ran.stdout.split())


# -- processes --------------------------------------------------------------------------------------------------------


def test_a_keeper_that_is_killed_is_replaced_at_the_end(tmp_path: Path) -> None:
    run = recorder(tmp_path, 100)
    os.kill(run.keeper_pid, signal.SIGKILL)
    for k in range(100, 300):
        run.record(row(k))
    wait_for(lambda: run.rows_on_disk == 300)  # its writer goes on
    assert_holds(run.close(), np.arange(300))


def test_a_keeper_that_is_stopped_is_replaced_at_the_end(tmp_path: Path) -> None:
    run = recorder(tmp_path, 100)
    os.kill(run.keeper_pid, signal.SIGSTOP)
    os.kill(run.writer_pid, signal.SIGKILL)
    for k in range(100, 300):
        run.record(row(k))
    assert_holds(run.close(), np.arange(300))


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_keeper_killed_and_writer_killed_or_stopped(tmp_path: Path, how: signal.Signals) -> None:
    run = recorder(tmp_path, 100)
    os.kill(run.keeper_pid, signal.SIGKILL)
    os.kill(run.writer_pid, how)
    for k in range(100, 300):
        run.record(row(k))
    assert_holds(run.close(), np.arange(300))


def test_a_writer_killed_while_the_dead_loop_s_rows_are_saved(tmp_path: Path) -> None:
    loop = Loop(tmp_path)
    os.kill(loop.writer, signal.SIGSTOP)
    loop.kill()
    wait_for(lambda: is_over(loop.keeper))
    assert_holds(tmp_path / "run.arrows", np.arange(ROWS))
    assert not rings(loop.process.pid)


def test_all_processes_killed_at_once_lose_nothing_that_is_in_memory(tmp_path: Path) -> None:
    loop = Loop(tmp_path)
    assert tmp_path / "run.arrows" not in unfinished()
    loop.kill(loop.keeper, loop.writer)
    assert tmp_path / "run.arrows" in unfinished()
    assert str(tmp_path / "run.arrows") in hil(tmp_path, "recover").stdout.replace("\n", "")
    assert f"{ROWS} rows, " in recover(tmp_path)
    assert_holds(tmp_path / "run.parquet", np.arange(ROWS))
    metadata = read_recording(tmp_path / "run.parquet").metadata
    assert (metadata["seed"], metadata["ended"], metadata["gaps"]) == (7, "not closed", [])
    run = metadata["real_time"]["run"]
    assert (run["ticks"], run["missed"], run["skipped"]) == (ROWS, 0, 0)
    assert run["max_s"] == (ROWS - 1) * 1e-7
    assert not rings(loop.process.pid)
    assert (tmp_path / "run.arrows").exists()


def test_a_stopped_loop_s_rows_reach_the_disk(tmp_path: Path) -> None:
    loop = Loop(tmp_path)
    loop.process.send_signal(signal.SIGSTOP)
    wait_for(lambda: len(read_or_none(tmp_path / "run.arrows")) == ROWS)
    loop.kill()
    wait_for(lambda: is_over(loop.keeper))


def read_or_none(path: Path) -> np.ndarray:
    try:
        return read_recording(path)["time_s"]
    except InputError:  # no block yet
        return np.empty(0)


def test_recover_waits_for_a_recorder_at_work(tmp_path: Path) -> None:
    run = recorder(tmp_path, 100)
    with pytest.raises(InputError, match="its recorder still works"), remains(run.stream_path):
        pass
    assert_holds(run.close(), np.arange(100))


def test_signals_of_a_terminal_or_a_service_do_not_reach_the_recorder(tmp_path: Path) -> None:
    run = recorder(tmp_path, 100)
    for name in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGABRT):
        os.kill(run.keeper_pid, name)
        os.kill(run.writer_pid, name)
    assert_holds(run.close(), np.arange(100))
    assert "writers_replaced" not in read_recording(run.path).metadata


@pytest.mark.long
def test_a_writer_that_hangs_is_replaced(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A new writer waits for a lock of the one before, which is held here: it sleeps, and gives no sign of life."""
    run = recorder(tmp_path, 100)
    first, lock = run.writer_pid, os.open(rings(os.getpid())[-1], os.O_RDWR)
    os.kill(first, signal.SIGKILL)
    fcntl.lockf(lock, fcntl.LOCK_EX)
    wait_for(lambda: run.writer_pid != first)
    second = run.writer_pid
    wait_for(lambda: run.writer_pid != second)
    fcntl.lockf(lock, fcntl.LOCK_UN)
    for k in range(100, 300):
        run.record(row(k))
    assert_holds(run.close(), np.arange(300))
    assert f"its process {second} hung; another one goes on at row 100" in capfd.readouterr().err


# -- disks ------------------------------------------------------------------------------------------------------------


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
    made = subprocess.run(["mkfs.ext4", "-q", str(image)], capture_output=True, check=False)
    if made.returncode:
        pytest.skip("mkfs.ext4 is missing")
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


@pytest.fixture
def torn(tmp_path: Path) -> Path:
    """Stream of a run after a power failure: five blocks of 100 rows, nothing in memory."""
    run = recorder(tmp_path)
    for block in range(5):
        for k in range(100 * block, 100 * (block + 1)):
            run.record(row(k))
        wait_for(lambda wanted=100 * (block + 1): run.rows_on_disk == wanted)
    data = run.stream_path.read_bytes()
    run.close()
    path = tmp_path / "torn" / "run.arrows"
    path.parent.mkdir()
    path.write_bytes(data)
    return path


def blocks_of(path: Path) -> list[StreamBlock]:
    data = path.read_bytes()
    head = read_head(data)
    return list(whole_blocks(data, head.end, len(head.channels)))


def test_blocks_know_their_first_row(torn: Path) -> None:
    blocks = blocks_of(torn)
    assert [block.first for block in blocks] == np.cumsum([0, *(len(block.rows) for block in blocks[:-1])]).tolist()
    assert blocks[-1].end == torn.stat().st_size


@pytest.mark.parametrize("cut", [1, 8, 100])
def test_a_torn_last_block_is_left_out(torn: Path, cut: int) -> None:
    last = blocks_of(torn)[-1]
    torn.write_bytes(torn.read_bytes()[:-cut])
    assert f"{last.end - last.start - cut} bytes of the file are damaged" in recover(torn.parent)
    assert_holds(torn.with_suffix(".parquet"), np.arange(ROWS - len(last.rows)))


def test_a_last_block_of_zeros_as_after_a_power_failure_is_left_out(torn: Path) -> None:
    last = blocks_of(torn)[-1]
    torn.write_bytes(torn.read_bytes()[:-1000] + bytes(1000))
    recover(torn.parent)
    assert_holds(torn.with_suffix(".parquet"), np.arange(ROWS - len(last.rows)))


@pytest.mark.parametrize("place", [0, 4, -9])
def test_a_damaged_block_leaves_a_marked_gap(torn: Path, place: int) -> None:
    blocks = blocks_of(torn)
    bad = next(block for block in blocks if block.first == 200)
    data = bytearray(torn.read_bytes())
    data[bad.end + place if place < 0 else bad.start + place] ^= 0x10
    torn.write_bytes(data)
    recover(torn.parent)
    recording = read_recording(torn.with_suffix(".parquet"))
    assert recording.metadata["gaps"] == [{"row": 200, "rows_lost": len(bad.rows)}]
    assert_holds(torn.with_suffix(".parquet"), np.r_[0:200, 200 + len(bad.rows) : ROWS])
    assert len(recording.parts()) == 2


def test_a_block_is_read_without_its_arrow_message(torn: Path) -> None:
    """Decoding a damaged message may end the process; number, length and checksum of the rows stand beside it."""
    block = blocks_of(torn)[0]
    data = bytearray(torn.read_bytes())
    data[block.start + 8 : block.start + 40] = bytes(32)
    torn.write_bytes(data)
    assert "no gap" in recover(torn.parent)
    assert_holds(torn.with_suffix(".parquet"), np.arange(ROWS))


def test_damaged_metadata_are_left_out_and_said(torn: Path) -> None:
    torn.write_bytes(torn.read_bytes().replace(b'"seed": 7', b'"seed": 8'))
    assert "the metadata are damaged and left out" in recover(torn.parent)
    assert_holds(torn.with_suffix(".parquet"), np.arange(ROWS))
    recording = read_recording(torn.with_suffix(".parquet"))
    assert recording.period_s == PERIOD_S
    assert "seed" not in recording.metadata


@pytest.mark.parametrize("count", [1, 2, 7, 8192])
def test_a_block_is_an_arrow_message_and_columns(count: int) -> None:
    schema = pa.schema([pa.field(name, pa.float64(), nullable=False) for name in CHANNELS])
    rows = np.array([row(k) for k in range(count)])
    data = encode(rows, 123, schema)
    assert data.endswith(rows.T.tobytes())
    (block,) = whole_blocks(data, 0, len(CHANNELS))
    assert np.array_equal(block.rows, rows)
    assert (block.first, block.end) == (123, len(data))
    with pa.ipc.open_stream(schema.serialize().to_pybytes() + data) as stream:
        assert stream.read_all().column("lateness_s").to_pylist() == rows[:, 4].tolist()


def test_whatever_happened_to_a_file_no_wrong_row_comes_of_it(torn: Path) -> None:
    good, draw, recovered = torn.read_bytes(), random.Random(19), 0
    for _ in range(300):
        data = bytearray(good)
        for _ in range(draw.choice([1, 1, 5, 40])):
            place, size = draw.randrange(len(data)), draw.randrange(1, 400)
            damage = draw.choice(
                [bytes([data[place] ^ 1 << draw.randrange(8)]), bytes(size), draw.randbytes(size), b""]
            )
            data[place : place + draw.choice([len(damage), size])] = damage
        torn.write_bytes(data)
        with contextlib.suppress(HilError), remains(torn) as found:
            numbers = found.rows[:, 1]
            assert np.array_equal(found.rows, [row(int(k)) for k in numbers])
            assert (np.diff(numbers) > 0).all()
            recovered += 1
    assert recovered > 100


def test_without_head_and_memory_nothing_can_be_told(torn: Path) -> None:
    torn.write_bytes(bytes(100) + torn.read_bytes()[100:])
    with pytest.raises(InputError, match="its head is damaged or missing"), remains(torn):
        pass


def test_a_damaged_head_is_replaced_from_memory(tmp_path: Path) -> None:
    loop = Loop(tmp_path)
    loop.kill(loop.keeper, loop.writer)
    (tmp_path / "run.arrows").write_bytes(b"")
    assert f"{ROWS} rows, {ROWS} of them from memory; no gap" in recover(tmp_path)
    assert_holds(tmp_path / "run.parquet", np.arange(ROWS))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run.parquet"], "given no .arrows file"),
        (["absent.arrows"], "given no .arrows file"),
        (["run.arrows", "--out", "run.csv"], "allowed .parquet"),
        (["run.arrows", "--out", "taken.parquet"], "exists and is not overwritten"),
    ],
)
def test_wrong_files_are_refused(torn: Path, arguments: list[str], message: str) -> None:
    (torn.parent / "taken.parquet").write_bytes(b"")
    assert message in " ".join(refused(torn.parent, "recover", *arguments).split())
