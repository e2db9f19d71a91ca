"""Recordings read back what was written, and a damaged one is refused with file, row and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.channels import CHANNELS, AxisKind
from hil.errors import InputError
from hil.recording.recording import Recording, arrow_schema, read_recording, write_parquet

HEADER = "time_s,position_command_m,velocity_command_m_s,motor_position_rad,torque_n_m"
ROWS = ["0.000,0,0,0,0.1", "0.001,0,0,0,0.2", "0.002,0,0,0,0.3", "0.003,0,0,0,0.4", "0.004,0,0,0,0.5"]


def small(rows: int = 50, period_s: float = 0.001) -> Recording:
    rng = np.random.default_rng(1)
    columns = {name: rng.normal(size=rows) for name in HEADER.split(",")}
    columns["time_s"] = np.asarray(np.arange(rows) * period_s, dtype=np.float64)
    return Recording("small", columns, period_s, {"seed": 1, "bench": {"name": "axis"}})


def csv(tmp_path: Path, *lines: str, header: str = HEADER) -> Path:
    path = tmp_path / "run.csv"
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def test_parquet_returns_every_bit_with_units_and_metadata(tmp_path: Path) -> None:
    recording = small()
    write_parquet(recording, tmp_path / "run.parquet")
    back = read_recording(tmp_path / "run.parquet")
    assert back.period_s == recording.period_s
    assert back.metadata == recording.metadata
    assert list(back.columns) == list(recording.columns)
    for name, values in recording.columns.items():
        assert np.array_equal(back[name], values)
    file = pq.ParquetFile(tmp_path / "run.parquet")
    for name in recording.columns:
        assert file.schema_arrow.field(name).metadata[b"unit"].decode() == CHANNELS[name].unit
    chunk = file.metadata.row_group(0).column(0)
    assert chunk.compression == "ZSTD"
    assert "BYTE_STREAM_SPLIT" in chunk.encodings


def test_a_parquet_file_is_never_overwritten_and_never_left_half(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    write_parquet(small(), path)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"run\.parquet: the file exists"):
        write_parquet(small(60), path)
    assert path.read_bytes() == before
    with pytest.raises(InputError, match="cannot be written"):
        write_parquet(small(), tmp_path / "absent" / "run.parquet")
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.parquet"]


def test_csv_with_canonical_names_is_read_and_unknown_columns_are_listed(tmp_path: Path) -> None:
    path = csv(tmp_path, *[f"{row},hello" for row in ROWS], header=HEADER + ",remark")
    recording = read_recording(path)
    assert recording.name == "run"
    assert recording.kind is AxisKind.ROTARY
    assert recording.period_s == 0.001
    assert recording.metadata["unknown_columns"] == ["remark"]
    assert list(recording.columns) == HEADER.split(",")
    assert recording["torque_n_m"].tolist() == [0.1, 0.2, 0.3, 0.4, 0.5]
    with pytest.raises(InputError, match="table_position_m is not recorded; the recording has time_s"):
        recording["table_position_m"]


def test_a_byte_order_mark_and_blank_lines_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\n".join([HEADER, "", *ROWS, ""]), encoding="utf-8-sig")
    assert len(read_recording(path)) == len(ROWS)


def test_a_linear_axis_is_known_by_its_channels(tmp_path: Path) -> None:
    header = "time_s,position_command_m,velocity_command_m_s,motor_position_m,force_n"
    assert read_recording(csv(tmp_path, *ROWS, header=header)).kind is AxisKind.LINEAR


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([*ROWS[:2], "0.002,0,0,abc,0.3"], r"run\.csv:4: motor_position_rad: given 'abc', allowed a finite"),
        ([*ROWS[:2], "0.002,0,nan,0,0.3"], r"run\.csv:4: velocity_command_m_s: given 'nan'"),
        ([*ROWS[:2], "0.002,0,0,inf,0.3"], r"run\.csv:4: motor_position_rad: given 'inf'"),
        ([*ROWS[:2], "0.002,0,0,,0.3"], r"run\.csv:4: motor_position_rad: given an empty field"),
        ([*ROWS[:2], "0.002,0,0,1_0,0.3"], r"run\.csv:4: motor_position_rad: given '1_0'"),
        ([*ROWS[:2], "", "0.002,0,0"], r"run\.csv:5: given 3 fields, the header has 5; the row is cut"),
        ([*ROWS[:2], ROWS[1], *ROWS[2:]], r"run\.csv:4: time_s: repeats \(a duplicate.* 0\.001 s after 0\.001"),
        ([*ROWS[:3], ROWS[1]], r"run\.csv:5: time_s: runs back: given 0\.001 s after 0\.002 s"),
        ([*ROWS[:2], *ROWS[3:]], r"run\.csv:4: time_s: a step of 0\.002 s, allowed the period 0\.001 s \+-1 %"),
        (ROWS[:2], r"run\.csv:2: time_s: given 2 rows, allowed 3 or more"),
        ([], r"run\.csv: there is no row 1 of numbers below the header"),
    ],
)
def test_a_damaged_csv_is_refused_with_file_line_and_column(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_recording(csv(tmp_path, *lines))


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (
            "time_s,position_command_m,velocity_command_m_s,motor_position_rad,torque",
            r"run\.csv: torque_n_m missing, given the columns .*torque; .*hil import",
        ),
        ("time_s,time_s,velocity_command_m_s,motor_position_rad,torque_n_m", r"run\.csv:1: time_s: stands twice"),
    ],
)
def test_a_wrong_header_is_refused(tmp_path: Path, header: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_recording(csv(tmp_path, *ROWS, header=header))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("run.csv", b"", "the file is empty"),
        ("run.csv", b"\x89PNG\r\n\x1a\n\x00\xff", "is not text of a CSV file"),
        ("run.parquet", b"", "is no readable Parquet file"),
        ("run.arrows", b"", "is no readable Arrow stream"),
        ("run.xlsx", b"", r"the ending '\.xlsx' is no recording, allowed \.parquet"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_recording(tmp_path / name)


def test_a_missing_file_and_a_cut_parquet_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent\.csv: there is no such file"):
        read_recording(tmp_path / "absent.csv")
    write_parquet(small(), tmp_path / "run.parquet")
    whole = (tmp_path / "run.parquet").read_bytes()
    (tmp_path / "cut.parquet").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"cut\.parquet: is no readable Parquet file .* cut or damaged"):
        read_recording(tmp_path / "cut.parquet")


def test_parquet_of_others_is_checked_like_csv(tmp_path: Path) -> None:
    columns = dict(small().columns)
    columns["torque_n_m"] = columns["torque_n_m"].copy()
    columns["torque_n_m"][7] = np.nan
    pq.write_table(pa.table(columns), tmp_path / "nan.parquet")
    with pytest.raises(InputError, match=r"nan\.parquet: row 8: torque_n_m: given nan"):
        read_recording(tmp_path / "nan.parquet")
    fields = [
        pa.field(n, pa.float64(), metadata={"unit": "kN m" if n == "torque_n_m" else CHANNELS[n].unit}) for n in columns
    ]
    pq.write_table(pa.table(small().columns, schema=pa.schema(fields)), tmp_path / "unit.parquet")
    with pytest.raises(InputError, match=r"unit\.parquet: torque_n_m: given in kN m, allowed N m"):
        read_recording(tmp_path / "unit.parquet")
    texts: dict[str, object] = {**columns, "torque_n_m": ["a"] * 50}
    pq.write_table(pa.table(texts), tmp_path / "text.parquet")
    with pytest.raises(InputError, match=r"text\.parquet: torque_n_m: given string values"):
        read_recording(tmp_path / "text.parquet")


def stream(path: Path, recording: Recording, rows_per_batch: int) -> list[int]:
    """Write an Arrow stream; return the size of the file after the schema and after each batch."""
    schema = arrow_schema(recording.columns, recording.metadata | {"period_s": recording.period_s})
    table = pa.table(recording.columns, schema=schema)
    with path.open("wb") as file, pa.ipc.new_stream(file, schema) as writer:
        sizes = [file.tell()]
        for batch in table.to_batches(max_chunksize=rows_per_batch):
            writer.write_batch(batch)
            sizes.append(file.tell())
    return sizes


@given(cut=st.integers(0, 30_000))
def test_a_cut_stream_is_read_to_its_last_complete_batch(tmp_path_factory: pytest.TempPathFactory, cut: int) -> None:
    tmp_path = tmp_path_factory.mktemp("cut")
    recording = small(400)
    sizes = stream(tmp_path / "run.arrows", recording, 20)
    whole = (tmp_path / "run.arrows").read_bytes()
    cut = min(cut, len(whole) - 1)
    (tmp_path / "cut.arrows").write_bytes(whole[:cut])
    complete = sum(size <= cut for size in sizes) - 1
    if complete < 1:
        with pytest.raises(InputError, match=r"cut\.arrows"):
            read_recording(tmp_path / "cut.arrows")
        return
    back = read_recording(tmp_path / "cut.arrows")
    assert len(back) == complete * 20
    assert np.array_equal(back["torque_n_m"], recording["torque_n_m"][: complete * 20])
    rows = f"{complete * 20} rows in {complete} complete batches"
    assert back.metadata["recovered"].startswith(f"the run was not closed: {rows}")
    assert back.metadata["seed"] == 1


def test_a_closed_stream_is_not_called_recovered(tmp_path: Path) -> None:
    stream(tmp_path / "run.arrows", small(), 20)
    assert read_recording(tmp_path / "run.arrows").metadata == small().metadata
