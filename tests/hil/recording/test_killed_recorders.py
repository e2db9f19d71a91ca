"""A recording survives when loop, keeper or writer are killed or stopped."""

from __future__ import annotations

import fcntl
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from command_line import hil
from processes import is_over, wait_for
from recorders import ROWS, Loop, assert_holds, recorder, recover, rings, row

from hil.errors import InputError
from hil.recording.recording import read_recording
from hil.recording.recover import remains, unfinished
from hil.recording.ring import Ring


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


def test_rows_in_memory_of_another_user_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, stream = Loop(tmp_path), tmp_path / "run.arrows"
    loop.kill(loop.keeper, loop.writer)
    (ring,) = rings(loop.process.pid)
    owner = ring.stat().st_uid
    with monkeypatch.context() as as_another:
        as_another.setattr(os, "geteuid", lambda: owner + 1)
        assert stream not in unfinished()
        with (
            pytest.raises(
                InputError, match=rf"{ring} is of the user {owner}, allowed .* \({owner + 1}\); recover it as"
            ),
            remains(stream),
        ):
            pass
    assert stream in unfinished()
    with monkeypatch.context() as as_root:
        as_root.setattr(os, "geteuid", lambda: 0)
        as_root.setattr(Ring, "owner", 1000)
        with remains(stream) as found:
            assert len(found.rows) == ROWS
    assert not rings(loop.process.pid)


def test_a_ring_that_another_user_plants_does_not_hide_the_own_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A user is the owner of a file; the copy counts as of another one by its name."""
    loop, stream = Loop(tmp_path), tmp_path / "run.arrows"
    loop.kill(loop.keeper, loop.writer)
    (ring,) = rings(loop.process.pid)
    planted = ring.with_name(f"{ring.name}-planted")
    planted.write_bytes(ring.read_bytes())
    try:
        monkeypatch.setattr(Ring, "owner", property(lambda one: os.geteuid() + (one.path == planted)))
        monkeypatch.setattr(os, "geteuid", lambda: 1000)
        with remains(stream) as found:
            assert len(found.rows) == ROWS
        assert planted.exists()
        assert not ring.exists()
    finally:
        planted.unlink()


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
