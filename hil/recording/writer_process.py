"""The process that writes the rows of a ring to the disk; started and replaced by `hil.recording.keeper`.

All that it needs is in the ring and in the file, so that any number of writers can follow each other: each waits until
the one before is gone, and goes on behind the last whole block. Without room on the disk the rows wait in the ring. If
the loop ends without a word, the rows of the ring are written and the stream stays without its end marker, by which a
reader knows.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import select
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa

from hil.errors import HilError
from hil.recording.blocks import STREAM_END, block_at, encode, encode_head
from hil.recording.recording import METADATA_KEY, arrow_schema, write_table
from hil.recording.ring import ROWS_AT, Counter, Ring

POLL_S = 0.02  # how often the ring is looked at
FLUSH_S = 0.03  # a row waits no longer than this and two polls for the file, and then for the disk: less than 100 ms
FLUSH_ROWS = 8192  # in virtual time rows come faster: flush when there are as many
RETRY_S = 0.2  # after an error of the disk
GIVE_UP_S = 3.0  # how long a disk without room is tried after the run


class Writer:
    """Appends the rows of a ring to its Arrow stream, and makes the Parquet file of it at the end."""

    def __init__(self, ring: Ring) -> None:
        self._ring, task = ring, ring.task
        self.path, self._metadata = Path(task["path"]), task["metadata"]
        self._rows = np.frombuffer(ring.memory, np.float64, ring.rows * ring.columns, ROWS_AT)
        self._rows = self._rows.reshape(ring.rows, ring.columns)
        self._schema = arrow_schema(tuple(task["channels"]), self._metadata)
        self._bare = self._schema.remove_metadata()
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        size = os.fstat(self._file).st_size
        ring[Counter.FILE_BYTES] = min(ring[Counter.FILE_BYTES], size)  # somebody may have cut it
        if not ring[Counter.FILE_BYTES]:
            os.ftruncate(self._file, 0)
            self._append(encode_head(self._schema))
        else:
            self._take_up(os.pread(self._file, size - ring[Counter.FILE_BYTES], ring[Counter.FILE_BYTES]))
        self._flushed_s = time.monotonic()

    def flush_if_due(self) -> None:
        """Write the rows of the ring if there are many, or if they wait long."""
        pending = self._ring[Counter.RECORDED] - self._ring[Counter.ON_DISK]
        if pending >= min(FLUSH_ROWS, len(self._rows) // 2) or time.monotonic() - self._flushed_s >= FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Write all rows of the ring and free them. Raises OSError; then the file ends with its last whole block."""
        self._flushed_s = time.monotonic()
        wrote = False
        while pending := self._ring[Counter.RECORDED] - (done := self._ring[Counter.ON_DISK]):
            place = done % len(self._rows)
            rows = self._rows[place : place + min(pending, FLUSH_ROWS)]  # at most to the ring's end
            self._append(encode(rows, done, self._bare), len(rows))
            wrote = True
        if wrote:
            os.fdatasync(self._file)

    def finish(self) -> None:
        """Write the rest and make the stream a Parquet file; without rows there is none."""
        end = self._ring.end
        assert end is not None
        if not self._ring[Counter.FINISHED]:
            self.flush()
            if self._ring[Counter.ON_DISK]:
                os.pwrite(self._file, STREAM_END, self._ring[Counter.FILE_BYTES])
                with pa.memory_map(str(self.path)) as source, pa.ipc.open_stream(source) as stream:
                    replaced = self._ring[Counter.WRITERS] - 1
                    end |= {"writers_replaced": replaced} if replaced else {}
                    about = {METADATA_KEY: json.dumps(self._metadata | end)}
                    table = stream.read_all().combine_chunks().replace_schema_metadata(about)
                write_table(table, self.path.with_suffix(".parquet"))
            self._ring[Counter.FINISHED] = 1 if self._ring[Counter.ON_DISK] else 2
        self.path.unlink(missing_ok=True)

    def _take_up(self, tail: bytes) -> None:
        """Count a whole block that the writer before had written but not counted, and cut what follows."""
        start = self._ring[Counter.FILE_BYTES]
        block = block_at(tail, 0, len(self._bare))
        if block is not None:
            self._ring[Counter.ON_DISK] = block.first + len(block.rows)
            self._ring[Counter.FILE_BYTES] = start = start + block.end
        os.ftruncate(self._file, start)

    def _append(self, data: bytes, rows: int = 0) -> None:
        """Append a whole block, or raise OSError with the file as it was."""
        start, done = self._ring[Counter.FILE_BYTES], 0
        try:
            while done < len(data):
                done += os.pwrite(self._file, data[done:], start + done)
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, start)
            raise
        self._ring[Counter.ON_DISK] += rows
        self._ring[Counter.FILE_BYTES] = start + len(data)


def serve(ring: Ring) -> None:
    """Serve one recording to its end. Raises OSError, HilError or ArrowException if it cannot be written."""
    fcntl.lockf(ring.descriptor, fcntl.LOCK_EX)  # of this process: the writer before has ended, even out of the disk
    writer: Writer | None = None
    lossless = ring.task["lossless"]
    loop_lives, over_s = True, 0.0
    while True:
        ring[Counter.BEAT] += 1
        if select.select([0] if loop_lives else [], [], [], POLL_S)[0]:
            loop_lives = bool(os.read(0, 1))  # else the pipe's end: the loop is gone
        over = bool(ring[Counter.END_BYTES]) or not loop_lives
        over_s = over_s or (time.monotonic() if over else 0.0)
        try:
            writer = writer or Writer(ring)
            ring[Counter.READY] = 1
            if ring[Counter.END_BYTES]:
                writer.finish()
            elif over:
                writer.flush()
            else:
                writer.flush_if_due()
            if ring[Counter.ERROR_BYTES]:
                ring.error = ""
        except (OSError, pa.ArrowException, HilError) as error:
            ring.error = str(error)
            first = not ring[Counter.READY]
            late = over and time.monotonic() - over_s >= GIVE_UP_S
            if lossless or first or late or ring[Counter.ABANDONED]:
                raise
            time.sleep(RETRY_S)
            continue
        if over:
            return


def main() -> None:
    """Serve the ring whose descriptor is the argument; exit code 1 with the ring's error text if that failed."""
    # the loop decides when a run is over; SIGABRT: systemd ends a hung loop by it, and means its whole service
    for name in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGABRT):
        signal.signal(name, signal.SIG_IGN)
    ring = Ring(int(sys.argv[1]))
    try:
        serve(ring)
    except (OSError, pa.ArrowException, HilError):
        os._exit(1)  # without closing files that cannot be written
    os._exit(0)


if __name__ == "__main__":
    main()
