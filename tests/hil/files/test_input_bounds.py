"""Files that expand, repeat or nest without end are refused in one sentence, within bounded time and memory."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import threading
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import hil

from hil.errors import InputError
from hil.files import input_file
from hil.files.input_file import MOST_IN_LINE, bounded, check_file
from hil.importing import mdf_file

MOST_MB = 1500.0
LONGEST_S = 20.0
PROFILE = "schema_version: 1\nlimits: {velocity_m_s: 1, acceleration_m_s2: 10, jerk_m_s3: 1000}\nsegments:\n- "


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def _mat(kind: int, count: int, tag: bytes, repeated: bytes) -> bytes:
    """A compressed variable `x` of a class, with data that repeat."""
    about = _element(6, struct.pack("<II", kind, 0)) + _element(5, struct.pack("<ii", count, 1)) + _element(1, b"x")
    squeeze = zlib.compressobj(9)
    size = len(about) + len(tag) + count * len(repeated)
    parts = [squeeze.compress(struct.pack("<II", 14, size) + about + tag)]
    parts += [squeeze.compress(repeated * 100_000) for _ in range(count // 100_000)]
    data = b"".join([*parts, squeeze.flush()])
    head = b"MATLAB 5.0 MAT-file".ljust(116) + b"\0" * 8 + struct.pack("<H", 0x100) + b"IM"
    return head + struct.pack("<II", 15, len(data)) + data


def _numbers(path: Path) -> None:
    count = 60_000_000
    path.write_bytes(_mat(6, count, struct.pack("<II", 1, count), b"\0"))  # bytes become numbers of 8


def _cells(path: Path) -> None:
    path.write_bytes(_mat(1, 5_000_000, b"", struct.pack("<II", 14, 0)))


def _sparse_text(path: Path, *pieces: str | int) -> None:
    """A text whose long runs take no room on the disk: numbers are lengths of null bytes."""
    with path.open("wb") as file:
        for piece in pieces:
            if isinstance(piece, int):
                file.truncate(file.tell() + piece)
                file.seek(0, os.SEEK_END)
            else:
                file.write(piece.encode())


def _npz(path: Path) -> None:
    shape = repr({"descr": "<f8", "fortran_order": False, "shape": (10**12,)}).encode().ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("t.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(shape)) + shape)


def _npz_with_text(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("about.txt", b"\0" * 1_000_000)


def _parquet(path: Path) -> None:
    pq.write_table(pa.table({"t": np.zeros(30_000_000), "x": np.zeros(30_000_000)}), path)


def _texts(path: Path) -> None:
    codes = pa.array(np.zeros(100_000, dtype=np.int32))
    pq.write_table(pa.table({"t": pa.DictionaryArray.from_arrays(codes, pa.array(["x" * 100_000]))}), path)


def _compressed_stream(path: Path) -> None:
    schema = pa.schema([("time_s", pa.float64())])
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_stream(file, schema, options=options) as stream:
        stream.write_batch(pa.record_batch([pa.array(np.zeros(1_000_000))], schema=schema))


def _repeats(path: Path) -> None:
    text = "{kind: dwell, duration_s: 0.004}"
    for times in [1000, 1000, *[2] * 40]:
        text = f"{{kind: repeat, times: {times}, segments: [{text}]}}"
    path.write_text(PROFILE + text)


REFUSED: dict[str, tuple[str, str, Callable[[Path], object], str]] = {
    "zeros in a .mat": ("import", "a.mat", _numbers, "values in arrays, cells and structures, allowed 50000000"),
    "cells in a .mat": ("import", "a.mat", _cells, "values in arrays, cells and structures, allowed 50000000"),
    "a head of .npz": ("import", "a.npz", _npz, "given an array of 1000000000000, allowed 50000000"),
    "a text in .npz": ("import", "a.npz", _npz_with_text, "holds no vector of numbers (there are no variables)"),
    "rows of Parquet": ("import", "a.parquet", _parquet, "30000000 rows of 2 columns, allowed 50000000"),
    "texts of Parquet": ("import", "a.parquet", _texts, "columns of numbers"),
    "a stream": ("compare", "a.arrows", _compressed_stream, "holds compressed blocks, allowed plain ones"),
    "one line": ("import", "a.csv", lambda path: path.write_text("1," * 5_000_000), ":1: given a line of 200000"),
    "one row": ("compare", "a.csv", lambda path: path.write_text("1," * 5_000_000), ":1: given a line of 200000"),
    "blank lines": (
        "import",
        "a.csv",
        lambda path: path.write_text("t,x\n" + "\n" * 1_000_000),
        "has no rows of numbers",
    ),
    "null bytes": ("import", "a.csv", lambda path: _sparse_text(path, "t,x\n", 10**9), "bytes, allowed 400000000"),
    "long JSON": ("import", "a.json", lambda path: _sparse_text(path, "[", 10**8), "bytes, allowed 40000000"),
    "keys of JSON": (
        "import",
        "a.json",
        lambda path: path.write_text("[" + ",".join(f'{{"k{k}": 1}}' for k in range(20_000)) + "]"),
        "20000 records with 20000 keys, allowed 50000000",
    ),
    "deep JSON": ("import", "a.json", lambda path: path.write_text("[" * 100_000), "is no readable JSON file"),
    "long numbers": (
        "import",
        "a.json",
        lambda path: path.write_text(f'{{"t": [1, 2, 3], "x": [1, 2, {"9" * 4000}]}}'),
        "int too large to convert to float",
    ),
    "a profile": ("validate", "a.yaml", _repeats, "a profile that is longer than 3600 s or 100000 moves"),
    "its run": ("run", "a.yaml", _repeats, "a profile that is longer than 3600 s or 100000 moves"),
    "a long list": (
        "validate",
        "a.yaml",
        lambda path: path.write_text("a: [" + "1," * 150_000),
        "bytes, allowed 200000",
    ),
    "a tag": ("validate", "a.yaml", lambda path: path.write_text('a: !!bool "x"\n'), ":1: given 'x', which is no bool"),
}


def _peak_mb() -> float:
    """Peak of the resident memory of this process, in which other tests ran before."""
    status = Path("/proc/self/status").read_text()
    return float(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024.0


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_without_bounds_is_refused(tmp_path: Path, case: str) -> None:
    command, name, make, says = REFUSED[case]
    make(tmp_path / name)
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins again at what is resident
    start_s, before_mb = time.process_time(), _peak_mb()
    ran = hil(tmp_path, command, name, *(["--bench", "reference"] if command == "compare" else []))
    assert ran.returncode == 2
    assert says in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
    assert time.process_time() - start_s < LONGEST_S
    assert _peak_mb() - before_mb < MOST_MB


@pytest.mark.parametrize(
    "arguments", [["import", "{}.csv"], ["validate", "{}.yaml"], ["import", "a.csv", "--map", "{}"]]
)
def test_a_name_of_300_characters_is_refused(tmp_path: Path, arguments: list[str]) -> None:
    (tmp_path / "a.csv").write_text("t,x,f\n" + "\n".join(f"{k},{k},{k}" for k in range(9)))
    ran = hil(tmp_path, *(one.format("x" * 300) for one in arguments))
    assert ran.returncode == 2
    assert "File name too long" in ran.stderr


def test_a_result_with_a_name_of_300_characters_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,x,f\n" + "\n".join(f"{k},{k},{k}" for k in range(9)))
    ran = hil(tmp_path, "import", "a.csv", "--out", "x" * 300 + ".parquet")
    assert ran.returncode == 2
    assert "Traceback" not in ran.stderr


@pytest.mark.parametrize(
    ("limit", "value", "says"),
    [("LONGEST_S", 0.2, "takes more than 0.2 s of processor time"), ("MOST_GROWTH", 20_000_000, "0.02 GB of memory")],
)
def test_time_and_memory_of_a_reader_are_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, value: float, says: str
) -> None:
    monkeypatch.setattr(input_file, limit, value)
    kept: list[bytes] = []

    @bounded
    def read(path: Path) -> None:
        while True:
            try:
                kept.append(bytes(range(256)) * 4_000 if limit == "MOST_GROWTH" else b"")
                sum(range(1000))
            except Exception:  # as libraries do
                continue

    with pytest.raises(InputError, match=says):
        read(tmp_path)
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)


def test_errors_and_results_of_a_bounded_reader_pass(tmp_path: Path) -> None:
    @bounded
    def read(path: Path, answer: int) -> int:
        if answer < 0:
            raise KeyboardInterrupt
        return answer

    assert read(tmp_path, 3) == 3
    with pytest.raises(KeyboardInterrupt):
        read(tmp_path, -1)
    found: list[int] = []
    thread = threading.Thread(target=lambda: found.append(read(tmp_path, 4)))  # without a timer
    thread.start()
    thread.join()
    assert found == [4]


def test_a_line_has_a_longest_length(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("a\n" + "b" * (MOST_IN_LINE - 2) + "\n")
    with path.open() as file:
        assert len(list(input_file.lines_of(path, file))) == 2
    path.write_text("a\n" + "b" * MOST_IN_LINE)
    with path.open() as file, pytest.raises(InputError, match=":2: given a line of"):
        list(input_file.lines_of(path, file))


def test_a_file_above_its_bound_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"12345")
    check_file(path, "a file", 5)
    with pytest.raises(InputError, match="given 5 bytes, allowed 4; give a file"):
        check_file(path, "a file", 4)


def test_ctrl_c_while_a_file_is_read_ends_without_a_trace(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,x,f\n" + "".join(f"{k},{k % 7},{k % 5} N\n" for k in range(600_000)))
    command = [sys.executable, "-m", "hil.cli", "import", str(path)]
    ran = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while ran.poll() is None and not _opened(ran.pid, path):
        time.sleep(0.01)
    ran.send_signal(signal.SIGINT)
    _, told = ran.communicate(timeout=60)
    assert ran.returncode == 130
    assert told.splitlines()[-1] == "stopped by ctrl-C"
    assert "Traceback" not in told


def _opened(pid: int, path: Path) -> bool:
    try:
        return any(os.readlink(f"/proc/{pid}/fd/{one}") == str(path) for one in os.listdir(f"/proc/{pid}/fd"))
    except OSError:
        return False


def test_compressed_blocks_of_mdf_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mdf_file, "MOST_BYTES", 8000)
    monkeypatch.setattr(input_file, "MOST_VALUES", 1000)
    path = tmp_path / "a.mf4"

    def block(size: int) -> bytes:
        data = zlib.compress(bytes(size))
        return b"##DZ" + bytes(36) + struct.pack("<Q", len(data)) + data

    path.write_bytes(block(4000) + b"##DZ" + block(4000))
    mdf_file.check_mdf_size(path)
    path.write_bytes(block(4000) + block(4001))
    with pytest.raises(InputError, match="expand to more than 8000, allowed 1000 values"):
        mdf_file.check_mdf_size(path)


def test_a_message_cuts_long_names(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f"{'x' * 5000},y\n1,2\n")
    assert f"columns {'x' * 60}..., y;" in hil(tmp_path, "compare", "a.csv", "--bench", "reference").stderr


def test_a_message_lists_few_of_many_names(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(",".join(f"c{k}" for k in range(500)) + "\n")
    ran = hil(tmp_path, "compare", "a.csv", "--bench", "reference")
    assert ran.returncode == 2
    assert "c18, c19 and 480 more" in ran.stderr
