"""The process that writes what a loop records; started by `hil.recording.writer`, which describes the whole.

It reads its task and the end of the run as lines of JSON from standard input and answers each with one line.
If the process of the loop ends without a message, it writes the rows that are still in the ring and leaves the stream
without its end marker, by which a reader knows.
"""

from __future__ import annotations

import json
import mmap
import os
import select
import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from hil.errors import HilError
from hil.recording.recording import METADATA_KEY, arrow_schema, write_table
from hil.recording.writer import HEADER_BYTES, ON_DISK, RECORDED

POLL_S = 0.02  # how often the ring is looked at
FLUSH_S = 0.5  # a row waits no longer than this for the file
SYNC_S = 1.0  # and the file no longer than this for the disk
FLUSH_ROWS = 8192  # in virtual time rows come faster: flush when there are as many


class Writer:
    """Appends the rows of the ring to the Arrow stream, and makes the Parquet file of it at the end."""

    def __init__(self, task: dict[str, Any]) -> None:
        self.path = Path(task["path"])
        columns, rows = len(task["channels"]), int(task["ring_rows"])
        memory = mmap.mmap(task["memory_fd"], 0)
        self._counters = memoryview(memory)[:HEADER_BYTES].cast("q")
        self._ring = np.frombuffer(memory, np.float64, rows * columns, HEADER_BYTES).reshape(rows, columns)
        self._metadata = task["metadata"]
        self._schema = arrow_schema(task["channels"], self._metadata)
        self._file = self.path.open("wb")
        self._stream = pa.ipc.new_stream(self._file, self._schema)
        self._file.flush()
        self._flushed_s = self._synced_s = time.monotonic()

    def flush_if_due(self) -> None:
        now = time.monotonic()
        pending = self._counters[RECORDED] - self._counters[ON_DISK]
        if pending >= min(FLUSH_ROWS, len(self._ring) // 2) or now - self._flushed_s >= FLUSH_S:
            self.flush()
            self._flushed_s = now
        if now - self._synced_s >= SYNC_S:
            os.fdatasync(self._file.fileno())
            self._synced_s = time.monotonic()

    def flush(self) -> None:
        """Write all rows of the ring, then free them."""
        while pending := self._counters[RECORDED] - self._counters[ON_DISK]:
            first = self._counters[ON_DISK] % len(self._ring)
            block = np.ascontiguousarray(self._ring[first : first + pending].T)  # at most to the ring's end
            arrays = [pa.array(values) for values in block]
            self._stream.write_batch(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
            self._file.flush()
            self._counters[ON_DISK] += block.shape[1]

    def finish(self, end: dict[str, Any]) -> str | None:
        """Write the rest and make the stream a Parquet file; its path, or None if there were no rows."""
        self.flush()
        self._stream.close()
        self._file.close()
        parquet = None
        if self._counters[ON_DISK]:
            parquet = self.path.with_suffix(".parquet")
            with pa.memory_map(str(self.path)) as source, pa.ipc.open_stream(source) as stream:
                metadata = {METADATA_KEY: json.dumps(self._metadata | end)}
                write_table(stream.read_all().replace_schema_metadata(metadata), parquet)
        self.path.unlink()
        return str(parquet) if parquet else None


def main() -> None:
    """Serve one recording: from the task on standard input to its end."""
    # the loop decides when a run is over; SIGABRT: systemd ends a hung loop by it, and means its whole service
    for name in (signal.SIGINT, signal.SIGTERM, signal.SIGABRT):
        signal.signal(name, signal.SIG_IGN)
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # not with the loop's priority
    os.sched_setaffinity(0, range(os.cpu_count() or 1))  # nor bound to its core
    try:
        writer = Writer(json.loads(sys.stdin.readline()))
        _answer(done=None)
        loop_pid = os.getppid()
        while os.getppid() == loop_pid:
            if select.select([sys.stdin], [], [], POLL_S)[0]:
                line = sys.stdin.readline()
                if line:
                    _answer(done=writer.finish(json.loads(line)))
                    return
                break
            writer.flush_if_due()
        writer.flush()  # the loop died
        os._exit(0)  # without the end marker of the stream
    except (OSError, pa.ArrowException, HilError) as error:
        _answer(error=str(error))
        os._exit(1)  # without closing files that cannot be written


def _answer(**fields: str | None) -> None:
    try:
        print(json.dumps(fields), flush=True)
    except BrokenPipeError:
        os._exit(1)  # the reader of the pipe has ended


if __name__ == "__main__":
    main()
