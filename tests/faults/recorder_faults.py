"""Faults of the recorder's processes and disk in runs of the fault matrix: `python tests/faults/recorder_faults.py`.

The loop runs in virtual time, keeper and writer are the real processes, which have the wall clock's time. The loop must
not notice: the run is complete, at rest where the move ends, power off; every row is in the file or counted as lost, or
an error tells where the rest is.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parent))

from observed_run import END_M, PERIOD_S, Handles, Stage, bench_with, observe

from drivers.cia402 import DriveState
from hil.errors import HilError
from hil.recording.recording import read_recording
from hil.recording.writer import Recorder

NO_LIMIT = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
SMALL_RING = 64  # rows: full within the run


def _signal(process: str, number: int) -> Callable[[Handles], None]:
    return lambda h: os.kill(getattr(h.rows, process), number)


def _both(h: Handles) -> None:
    os.kill(h.rows.keeper_pid, signal.SIGKILL)
    os.kill(h.rows.writer_pid, signal.SIGKILL)


def _full(h: Handles) -> None:
    """The writer meets the end of its disk, setrlimit(2): File too large."""
    size = h.rows.stream_path.stat().st_size
    resource.prlimit(h.rows.writer_pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


class RecorderKind(NamedTuple):
    """A fault of the recorder. room: the disk has room again at the end; ring_rows: 0 for the usual memory."""

    name: str
    act: Callable[[Handles], None]
    room: bool = True
    ring_rows: int = 0


RECORDER_KINDS = (
    RecorderKind("writer killed", _signal("writer_pid", signal.SIGKILL)),
    RecorderKind("writer stopped (SIGSTOP)", _signal("writer_pid", signal.SIGSTOP)),
    RecorderKind("keeper killed", _signal("keeper_pid", signal.SIGKILL)),
    RecorderKind("keeper and writer killed", _both),
    RecorderKind("disk full for a time", _full),
    RecorderKind("disk full until the end", _full, room=False),
    RecorderKind("writer stopped, memory full", _signal("writer_pid", signal.SIGSTOP), ring_rows=SMALL_RING),
)


class RecorderRun(NamedTuple):
    """What came of a run: rows of the loop, in the file, counted as lost; what is wrong with it."""

    rows: int
    in_file: int
    lost: int
    wrong: list[str]


def recorder_run(kind: RecorderKind, seed: int) -> RecorderRun:
    """Run the move with this fault at a random tick."""
    rng = random.Random(seed)
    made: list[Recorder] = []
    with tempfile.TemporaryDirectory() as folder:

        def make(channels: tuple[str, ...]) -> Recorder:
            more = {"ring_rows": kind.ring_rows} if kind.ring_rows else {}
            made.append(Recorder(folder, "run", channels, PERIOD_S, {}, **more))
            return made[0]

        seen = observe(
            bench_with(simulation={"seed": seed}), Stage(DriveState.OPERATION_ENABLED, rng.randrange(12, 290), 0),
            kind.act, rng, make)  # fmt: skip
        wrong = [] if seen.ended == "complete" else [f"ended by {seen.ended}: {seen.error}"]
        if seen.powered_at_end or abs(seen.end_m - END_M) > 1e-4:
            wrong.append("not at rest with power off at the end of the move")
        rows, in_file, recorder = seen.outcome.rows if seen.outcome else 0, 0, made[0]
        if kind.act is _full and kind.room:
            resource.prlimit(recorder.writer_pid, resource.RLIMIT_FSIZE, NO_LIMIT)
        try:
            path = recorder.close()
            in_file = len(read_recording(path)) if path else 0
            if in_file + recorder.rows_lost != rows:
                wrong.append(f"{rows} rows, {in_file} in the file, {recorder.rows_lost} counted as lost")
            if not kind.room:
                wrong.append("no error says that the disk is full")
        except HilError as error:
            if kind.room or "hil recover" not in str(error):
                wrong.append(f"HilError: {error}")
            ring = str(error).split(" rows are in memory only (")[-1].split(")")[0]
            Path(ring).unlink(missing_ok=True)  # /dev/shm/hil-ring-*: of this run alone
    return RecorderRun(rows, in_file, recorder.rows_lost, wrong)


def main() -> int:
    """Print a table of counts; exit code 1 with violations."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="of each fault")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print("| fault | runs | rows | in the file | counted as lost | violations |\n|---|---|---|---|---|---|", flush=True)
    bad: Counter[str] = Counter()
    for kind in RECORDER_KINDS:
        runs = [recorder_run(kind, given.seed + k) for k in range(given.runs)]
        for run in runs:
            for text in run.wrong:
                bad[kind.name] += 1
                print(f"{kind.name}: {text}", file=sys.stderr)
        totals = [sum(column) for column in ([r.rows for r in runs], [r.in_file for r in runs], [r.lost for r in runs])]
        print(f"| {kind.name} | {len(runs)} | {' | '.join(map(str, totals))} | {bad[kind.name]} |", flush=True)
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
