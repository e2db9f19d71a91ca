"""Recorders with rows of known numbers, and a process that records and is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
from command_line import hil
from processes import DEADLINE_S, wait_for

from hil.recording import ring
from hil.recording.blocks import StreamBlock, read_head, whole_blocks
from hil.recording.recording import read_recording
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


def blocks_of(path: Path) -> list[StreamBlock]:
    data = path.read_bytes()
    head = read_head(data)
    return list(whole_blocks(data, head.end, len(head.channels)))
