"""The scope's view of the recorder's memory: only reading, lapped, after a new start, after a killed loop."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from processes import is_over, wait_for
from recorders import CHANNELS, PERIOD_S, ROWS, Loop, recorder, recover, rings, row

from hil.recording.ring import Counter, Ring
from hil.scope import live
from hil.scope.live import LiveRing
from hil.scope.rows import RingRows


@pytest.fixture(autouse=True)
def looks_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "LOOK_S", 0.0)


def threads() -> list[int]:
    """Numbers of the threads of this process."""
    return [int(thread.name) for thread in Path("/proc/self/task").iterdir()]


@pytest.fixture(autouse=True)
def kept_cores() -> Iterator[set[int]]:
    """Cores of this process, which it has again after the test."""
    cores = os.sched_getaffinity(0)
    yield cores
    for thread in threads():
        os.sched_setaffinity(thread, cores)


def opened(pid: int) -> RingRows:
    (path,) = rings(pid)
    return RingRows(Ring(os.open(path, os.O_RDONLY)), pid)


def test_rows_are_those_of_the_loop(tmp_path: Path) -> None:
    with recorder(tmp_path, 50) as run:
        rows = LiveRing(tmp_path).rows()
        assert rows is not None
        assert (rows.name, rows.channels, rows.period_s) == ("run", CHANNELS, PERIOD_S)
        assert (rows.first, rows.end, rows.ended) == (0, 50, False)
        block = rows.read(10, 1000)
        assert block.first == 10
        assert np.array_equal(np.stack(list(block.columns.values())).T, [row(k) for k in range(10, 50)])
        run.record(row(50))
        assert rows.end == 51
    assert rows.ended
    assert len(rows.read(0, 51)) == 51  # the last ones stay until the next run


def test_the_memory_can_only_be_read(tmp_path: Path) -> None:
    with recorder(tmp_path, 3):
        (path,) = rings(os.getpid())
        ring = Ring(os.open(path, os.O_RDONLY))
        with pytest.raises(TypeError):
            ring[Counter.RECORDED] = 0
        with pytest.raises(TypeError):
            ring.memory[:8] = bytes(8)


def test_a_reader_that_is_lapped_gets_what_is_left(tmp_path: Path) -> None:
    with recorder(tmp_path, 0, ring_rows=64) as run:
        rows = opened(os.getpid())
        for k in range(1000):
            run.record(row(k))
            wait_for(lambda: run.rows_recorded - run.rows_on_disk < 32)
        assert (rows.first, rows.end) == (1000 - 63, 1000)
        block = rows.read(0, 1000)
        assert block.first == 937
        assert np.array_equal(block.columns["position_command_m"], np.arange(937.0, 1000.0))


def test_no_row_is_mixed_while_the_loop_writes_over_them(tmp_path: Path) -> None:
    """Each row has values that belong together; the loop goes round and round while another thread reads all."""
    with recorder(tmp_path, 0, ring_rows=64) as run:
        rows, over = opened(os.getpid()), threading.Event()

        def loop() -> None:
            k = 0
            while not over.is_set():
                if run.rows_recorded - run.rows_on_disk < 60:
                    run.record(row(k))
                    k += 1

        thread = threading.Thread(target=loop)
        thread.start()
        try:
            laps = 0
            while laps < 20:
                first = rows.first
                block = rows.read(0, rows.end)
                numbers = block.first + np.arange(len(block))
                assert np.array_equal(block.columns["position_command_m"], 1.0 * numbers)
                assert np.array_equal(block.columns["torque_n_m"], 3.0 * numbers)
                laps = first // 64
        finally:
            over.set()
            thread.join()


def test_the_ring_of_the_next_run_is_found(tmp_path: Path) -> None:
    found = LiveRing(tmp_path)
    assert found.rows() is None
    with recorder(tmp_path, 5):
        first = found.rows()
        assert first is not None
        assert found.rows() is first
    assert found.rows() is first
    with recorder(tmp_path, 7):
        second = found.rows()
        assert second is not None
        assert second is not first
        assert second.end == 7


def test_a_killed_loop_leaves_its_rows_and_does_not_hold_back_the_recovery(tmp_path: Path) -> None:
    loop = Loop(tmp_path)
    found = LiveRing(tmp_path)
    rows = found.rows()
    assert rows is not None
    assert rows.end == ROWS
    loop.kill(loop.keeper, loop.writer)
    wait_for(lambda: is_over(loop.writer))
    assert rows.ended
    assert "no gap" in recover(tmp_path)
    assert found.rows() is rows
    assert len(rows.read(0, ROWS)) == ROWS


def test_only_runs_of_a_folder_are_found(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    with recorder(tmp_path / "one", 5):
        assert LiveRing(tmp_path / "other").rows() is None
        assert LiveRing(tmp_path).rows() is not None


def test_files_that_are_no_ring_are_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "FOLDER", tmp_path)
    (tmp_path / f"hil-ring-{os.getpid()}-empty").touch()
    (tmp_path / f"hil-ring-{os.getpid()}-zeros").write_bytes(bytes(5000))
    (tmp_path / "hil-ring-x-name").touch()
    (tmp_path / "hil-ring-999999999-dead").touch()
    assert LiveRing().rows() is None


def test_all_threads_of_the_scope_leave_the_core_to_which_a_loop_is_bound(tmp_path: Path, kept_cores: set[int]) -> None:
    if len(kept_cores) < 2:
        pytest.skip("this machine has one core")
    loop = Loop(tmp_path)
    try:
        os.sched_setaffinity(loop.process.pid, {max(kept_cores)})
        thread = threading.Thread(target=LiveRing(tmp_path).rows)  # as the server asks
        thread.start()
        thread.join()
        cores = dict[int, set[int]]()
        for one in threads():
            with suppress(ProcessLookupError):  # a thread of another test may end between the list and the question
                cores[one] = os.sched_getaffinity(one)
        assert os.getpid() in cores
        assert all(one == kept_cores - {max(kept_cores)} for one in cores.values())
    finally:
        loop.kill(loop.keeper, loop.writer)
        for path in rings(loop.process.pid):
            path.unlink()
