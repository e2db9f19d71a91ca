"""Recordings: columns of the channel table at one period, read from and written to files.

Parquet (units in the schema) for finished runs, an Arrow stream (`.arrows`) during a run, CSV with the names of the
channel table for exchange. Other files are read by `hil.importing.by_map`.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from hil.arrays import FloatArray
from hil.channels import AXIS_CHANNELS, CHANNELS, AxisChannels, AxisKind
from hil.errors import InputError, listed
from hil.files import csv_columns
from hil.files.input_file import bounded, check_file, is_file
from hil.recording.arrow_files import (
    FORMATS,
    numbers,
    parquet_schema,
    read_parquet,
    read_stream,
    stored_metadata,
    stored_unit,
)
from hil.recording.arrow_files import (
    METADATA_KEY as METADATA_KEY,
)
from hil.recording.row_clock import CLOCK_TOLERANCE
from hil.recording.stamps import RegularRows, check_finite, regular_rows

if TYPE_CHECKING:
    from pandas import DataFrame

    from hil.figures.drawing import Drawing

PARTS = "parts"  # key of the metadata: row and time_s of each part, if there are gaps between them
CLOCK_NOTES = "clock_notes"  # key of the metadata: what was done to the stamps
NOMINAL = "nominal"  # key of the metadata: what the owner tells of the parts of the axis, by keys of the map
RESAMPLED = "resampled"  # key of the metadata: the rows are not those of the control loop


@dataclass(frozen=True, eq=False)
class Recording:
    """A run: columns of equal length (names and units of `hil.channels`), one row per period.

    `metadata` holds what JSON can: bench, profile, versions, seed, and remarks of the reader. `start_s` is the time of
    the first row of a part since the first row of its whole recording. Raises InputError for
    columns of different length, NaN, infinity, and a period that is not positive.
    """

    name: str
    columns: dict[str, FloatArray]
    period_s: float
    metadata: dict[str, Any] = field(default_factory=dict)
    start_s: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.period_s < math.inf:
            raise InputError(f"{self.name}: period_s: given {self.period_s}, allowed a positive number [s]")
        lengths = {name: len(values) for name, values in self.columns.items()}
        if len(set(lengths.values())) != 1:
            raise InputError(f"{self.name}: columns: given the lengths {lengths}, allowed one length for all")
        check_finite(self.columns, lambda row: f"{self.name}: row {row}")

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __repr__(self) -> str:
        channels = ", ".join(name for name in self.columns if name != "time_s")
        return (
            f"Recording {self.name}: {self.kind} axis, {len(self)} rows at {1e3 * self.period_s:g} ms = "
            f"{len(self) * self.period_s:.3f} s\n  {channels}"
        )

    def __getitem__(self, channel: str) -> FloatArray:
        """The column of a channel; raises InputError, with the channels there are, if it was not recorded."""
        if channel not in self.columns:
            raise InputError(f"{self.name}: {channel} is not recorded; the recording has {listed(self.columns)}")
        return self.columns[channel]

    @property
    def kind(self) -> AxisKind:
        """Rotary or linear, as the name of the motor's position or velocity says."""
        return AxisKind.of(self.columns)

    @property
    def axis(self) -> AxisChannels:
        """Names of the channels of this kind of axis."""
        return AXIS_CHANNELS[self.kind]

    def parts(self) -> tuple[Recording, ...]:
        """The parts between gaps in time, named "run (part 2)", with their time; the recording itself without a gap."""
        starts = self.metadata.get(PARTS, [])
        if len(starts) < 2:
            return (self,)
        ends = [*(part["row"] for part in starts[1:]), len(self)]
        metadata = {key: value for key, value in self.metadata.items() if key != PARTS}
        return tuple(
            replace(
                self,
                name=f"{self.name} (part {number})",
                columns={name: values[part["row"] : end] for name, values in self.columns.items()},
                metadata=metadata,
                start_s=self.start_s + part["time_s"],
            )
            for number, (part, end) in enumerate(zip(starts, ends, strict=True), 1)
        )

    def to_pandas(self) -> DataFrame:
        """Return a pandas DataFrame: the index is time_s, a column per channel, named by quantity and SI unit.

        `attrs` has the name, the period [s] and the unit of each column. Raises InputError if pandas is not installed.
        """
        from hil.recording.data_frame import data_frame

        return data_frame(self.name, self.columns, self.period_s)

    def plot(self, *channels: str) -> Drawing:
        """Draw channels over time, a panel each; without names: set-points, positions, torque and its command.

        Raises InputError for a channel that is not recorded.
        """
        from hil.figures.drawing import over_time
        from hil.figures.panels import MEASURED, Line, Panel

        names = self.axis
        usual = (names.position_command, names.velocity_command, *names.predicted)
        panels = [
            Panel(CHANNELS[name].quantity, CHANNELS[name].unit, (Line("recorded", self[name], MEASURED),))
            for name in channels or [name for name in usual if name in self.columns]
        ]
        return over_time(self.name, self["time_s"], panels)

    def _repr_html_(self) -> str:
        from hil.figures.card import card

        first, channels = repr(self).split("\n")
        few = (self.axis.velocity_command, self.axis.table_position, self.axis.motor_position, self.axis.torque)
        picture = self.plot(*[name for name in few if name in self.columns])
        return card(first, f"Channels: {channels.strip()}", picture)


@bounded
def read_recording(path: str | Path) -> Recording:
    """Read a Parquet, Arrow stream or canonical CSV file; the ending decides.

    An Arrow stream that was cut off is read to its last complete batch; `metadata["recovered"]` then says
    so. Columns that the channel table does not know are left out and listed in `metadata["unknown_columns"]`.
    Raises InputError with file, row and column: no such file, not this format, a required channel missing (time,
    position or velocity of the motor, torque, its command or the table's position), NaN or infinity, text, a clock that
    repeats or runs back, two rates. A clock with gaps gives `parts`, one with uneven steps is made regular
    (`hil.recording.stamps`); `metadata["clock_notes"]` says so.
    """
    path = Path(path)
    readers = {".parquet": _read_parquet, ".arrows": _read_stream, ".csv": _read_csv}
    if path.suffix.lower() not in readers:
        raise InputError(
            f"{path}: the ending {path.suffix!r} is no recording, allowed .parquet, .arrows or .csv; "
            "import a foreign file with: hil import FILE --map MAP.yaml"
        )
    check_file(path, FORMATS)
    recording = readers[path.suffix.lower()](path)
    pa.default_memory_pool().release_unused()  # else it keeps what the table took: twice the recording
    return recording


def clock_metadata(rows: RegularRows) -> dict[str, Any]:
    """Metadata of a clock: its parts if there are several, and what was done to the stamps."""
    parts = {PARTS: [asdict(part) for part in rows.parts]} if len(rows.parts) > 1 else {}
    resampled = {RESAMPLED: True} if rows.rate_hz else {}
    return parts | resampled | ({CLOCK_NOTES: list(rows.notes)} if rows.notes else {})


def write_parquet(recording: Recording, path: str | Path) -> None:
    """Write a Parquet file, whole or not at all. Raises InputError if `path` exists or cannot be written."""
    path = Path(path)
    if is_file(path):
        raise InputError(f"{path}: the file exists and is not overwritten; give another name or remove it")
    schema = arrow_schema(recording.columns, recording.metadata | {"period_s": recording.period_s})
    table = pa.Table.from_arrays([pa.array(values) for values in recording.columns.values()], schema=schema)
    write_table(table, path)


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table in the stored form through a temporary file beside `path`. Raises InputError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        # bytes of equal significance side by side compress better than whole floats
        pq.write_table(
            table,
            part,
            compression="zstd",
            use_dictionary=False,
            column_encoding=dict.fromkeys(table.column_names, "BYTE_STREAM_SPLIT"),
        )
        part.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error}); choose a folder with rights and space") from None
    finally:
        part.unlink(missing_ok=True)


def arrow_schema(names: Mapping[str, object] | tuple[str, ...], metadata: Mapping[str, Any]) -> pa.Schema:
    """Arrow schema of columns of the channel table: unit, meaning and sign of each with its field."""
    fields = []
    for name in names:
        channel = CHANNELS[name]
        about = {"unit": channel.unit, "meaning": channel.meaning, "sign": channel.sign}
        fields.append(pa.field(name, pa.float64(), nullable=False, metadata=about))
    return pa.schema(fields, metadata={METADATA_KEY: json.dumps(dict(metadata))})


def _read_csv(path: Path) -> Recording:
    names = csv_columns.read_header(path)
    known = _known(path, names)
    columns = csv_columns.read_columns(path, known)
    rows = regular_rows(columns, lambda row: f"{path}:{csv_columns.line_of_row(path, row)}")
    metadata = {"source": path.name} | _unknown(names) | clock_metadata(rows)
    return Recording(path.stem, rows.columns, rows.period_s, metadata)


def _read_parquet(path: Path) -> Recording:
    schema = parquet_schema(path)
    return _from_table(path, schema, read_parquet(path, _known(path, tuple(schema.names))), {})


def _read_stream(path: Path) -> Recording:
    table, batches, problem, closed = read_stream(path)
    notes = {}
    if problem or not closed:
        notes["recovered"] = f"the run was not closed: {table.num_rows} rows in {batches} complete batches" + (
            ", the batch after them is cut and left out" if problem else ""
        )
    return _from_table(path, table.schema, table, notes)


def _from_table(path: Path, schema: pa.Schema, table: pa.Table, notes: dict[str, Any]) -> Recording:
    known = _known(path, tuple(schema.names))
    units = {name: unit for name in known if (unit := stored_unit(schema, name)) is not None}
    # an empty value becomes NaN, which the check refuses with its row
    columns = {name: numbers(path, table, name) for name in known}
    notes = _unknown(tuple(schema.names)) | notes
    return recording_of(path, columns, units, stored_metadata(path, schema) | notes)


def recording_of(
    path: Path, columns: dict[str, FloatArray], units: Mapping[str, str], metadata: dict[str, Any]
) -> Recording:
    """The recording whose columns (n,), their units and metadata (with its period) a file of this program holds.

    Raises InputError: a required channel missing, another unit, no clock, a period that is not that of the rows.
    """
    for name in _known(path, tuple(columns)):
        if (unit := units.get(name)) not in (None, own := CHANNELS[name].unit):
            raise InputError(f"{path}: {name}: given in {unit}, allowed {own}; import it with a map")
    metadata = {key: value for key, value in metadata.items() if key != PARTS}  # the rows tell
    stored_s = metadata.pop("period_s", None)
    rows = regular_rows(columns, lambda row: f"{path}: row {row + 1}", period_s=stored_s)
    stored_s = rows.period_s if stored_s is None else stored_s
    period_s = rows.period_s if rows.rate_hz else stored_s
    if abs(period_s - rows.period_s) > CLOCK_TOLERANCE * rows.period_s:
        raise InputError(f"{path}: period_s: given {period_s} s, the rows have {rows.period_s:g} s; it is damaged")
    return Recording(path.stem, rows.columns, period_s, clock_metadata(rows) | metadata)


def _known(path: Path, names: tuple[str, ...]) -> list[str]:
    """The channels among the columns of a file, with those that every recording needs."""
    kind = AxisKind.of(names)
    axis = AXIS_CHANNELS[kind]
    missing = ["time_s"] if "time_s" not in names else []
    # one of each: position or velocity of the motor; what moves it, or else the table that it moves
    alternatives = (axis.motor_position, axis.motor_velocity), (axis.torque, axis.torque_command, axis.table_position)
    missing += [group[0] for group in alternatives if not set(group) & set(names)]
    if missing:
        linear = " (a linear axis has motor_position_m and force_n)" if kind is AxisKind.ROTARY else ""
        raise InputError(
            f"{path}: {', '.join(missing)} missing, given the columns {listed(names)}; "
            f"add them{linear}, or import the file with: hil import FILE --map MAP.yaml"
        )
    return [name for name in names if name in CHANNELS]


def _unknown(names: tuple[str, ...]) -> dict[str, Any]:
    unknown = [name for name in names if name not in CHANNELS]
    return {"unknown_columns": unknown} if unknown else {}
