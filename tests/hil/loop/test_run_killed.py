"""`hil run` by the wall clock, its recorder killed and its disk full while the axis moves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from patient_bench import patient_bench_file
from processes import DEADLINE_S, is_over, wait_for

from hil.recording.recording import Recording, read_recording
from hil.recording.ring import FOLDER, Counter, Ring

PROFILE = Path(__file__).parents[3] / "profiles" / "friction_sweep.yaml"
MOVING = 1000  # rows


class MovingRun:
    """A run in a process of its own, some MOVING rows after its begin."""

    def __init__(self, folder: Path) -> None:
        bench = str(patient_bench_file(folder))
        command = ["-m", "hil.cli", "run", str(PROFILE), "--bench", bench, "--force", "--out", str(folder)]
        self.process = subprocess.Popen(
            [sys.executable, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.stream, self.path = folder / "friction_sweep.arrows", folder / "friction_sweep.parquet"
        wait_for(lambda: self.stream.exists() and self.stream.stat().st_size > 0)
        self.ring = Ring(os.open(next(FOLDER.glob(f"hil-ring-{self.process.pid}-*")), os.O_RDWR))
        wait_for(lambda: self.ring[Counter.RECORDED] > MOVING)

    @property
    def keeper(self) -> int:
        return os.getpgid(self.ring[Counter.WRITER_PID])

    def stop(self) -> str:
        """Stop the axis as by ctrl-C; returns what was said on standard error."""
        self.process.send_signal(signal.SIGINT)
        said = self.process.communicate(timeout=DEADLINE_S)[1]
        assert self.process.returncode == 130, said
        return said


@pytest.fixture
def run(tmp_path: Path) -> Iterator[MovingRun]:
    run = MovingRun(tmp_path)
    yield run
    run.process.kill()
    run.process.wait()
    run.ring.remove()
    os.close(run.ring.descriptor)


def assert_every_tick(recording: Recording, run: MovingRun) -> None:
    """Nothing is missing but ticks that the loop itself left out, which the certificate counts."""
    raw = recording.metadata
    assert raw["rows_lost"] == 0
    assert raw["rows"] == run.ring[Counter.RECORDED]
    assert "gaps" not in raw


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_writer_lost_in_motion_is_replaced_in_motion(run: MovingRun, how: signal.Signals) -> None:
    first = run.ring[Counter.WRITER_PID]
    os.kill(first, how)
    wait_for(lambda: run.ring[Counter.WRITER_PID] != first)
    before = run.ring[Counter.ON_DISK]
    wait_for(lambda: run.ring[Counter.ON_DISK] > before)
    assert not run.ring[Counter.END_BYTES]  # the axis still moves
    said = run.stop()
    assert f"its process {first} was" in said
    recording = read_recording(run.path)
    assert recording.metadata["writers_replaced"] == 1
    assert_every_tick(recording, run)


def test_the_whole_recorder_lost_in_motion_is_replaced_at_the_end(run: MovingRun) -> None:
    for pid in (run.keeper, run.ring[Counter.WRITER_PID]):
        os.kill(pid, signal.SIGKILL)
    run.stop()
    assert_every_tick(read_recording(run.path), run)


def test_a_run_killed_in_motion_with_its_recorder_is_recovered_with_its_certificate(run: MovingRun) -> None:
    for pid in (run.keeper, run.ring[Counter.WRITER_PID], run.process.pid):
        os.kill(pid, signal.SIGKILL)
    run.process.communicate(timeout=DEADLINE_S)
    wait_for(lambda: is_over(run.ring[Counter.WRITER_PID]))
    recorded = run.ring[Counter.RECORDED]
    done = subprocess.run(
        [sys.executable, "-m", "hil.cli", "recover", str(run.stream)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    metadata = read_recording(run.path).metadata
    assert metadata["rows"] == recorded
    assert metadata["ended"] == "not closed"
    assert metadata["real_time"]["run"]["ticks"] == recorded
    assert metadata["real_time"]["machine"]
    assert np.isfinite(metadata["real_time"]["bus_load"])
    assert not list(FOLDER.glob(f"hil-ring-{run.process.pid}-*"))
