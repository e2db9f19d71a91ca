"""Of a torn or damaged stream whole blocks are recovered, and no wrong row."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from command_line import refused
from processes import wait_for
from recorders import CHANNELS, PERIOD_S, ROWS, Loop, assert_holds, blocks_of, recorder, recover, row

from hil.errors import HilError, InputError
from hil.recording.blocks import encode, whole_blocks
from hil.recording.recording import read_recording
from hil.recording.recover import remains


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
