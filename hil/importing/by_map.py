"""Import a foreign recording (CSV, MATLAB .mat to version 7, Parquet, JSON) by a map (`hil.importing.map_file`)."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.channels import CHANNELS, AxisChannels
from hil.errors import InputError
from hil.files.input_file import bounded
from hil.files.shipped import given_or_shipped
from hil.files.yaml_model import load_model
from hil.importing.channel_clocks import merge, seconds
from hil.importing.foreign_columns import FEW_MISSING, Foreign, read_foreign
from hil.importing.map_file import RecordingMap
from hil.importing.motor_set_points import SET_POINTS, gear_of_set_points
from hil.importing.rows import complete_rows
from hil.importing.units import base_of
from hil.importing.wraps import unwrapped
from hil.recording.quantum import count_of
from hil.recording.recording import CLOCK_NOTES, NOMINAL, Recording, clock_metadata
from hil.recording.stamps import RegularRows, regular_rows

EPOCH_S = 1e6  # start of a clock that counts from 1970 or year 0: its large numbers have few digits for the steps
STEP = "step"  # key of a channel's metadata: step of its values before they are interpolated
ONE = "constant_of_one"  # key of a channel's metadata: constant of its effort that is 1 in the map, perhaps unknown


@bounded
def import_recording(source: str | Path, map_path: str | Path) -> Recording:
    """Read `source` (.csv, .txt, .mat, .parquet, .json) by the map file `map_path`, or by a shipped map's name (emps).

    Missing channels are derived: velocity_command_m_s by central differences of the position command; torque from
    torque command or vice versa (on a linear axis force). The metadata list them (`derived`) and the source of each
    channel (`channels`).
    Rows without a value are left out if the map says so; gaps of the clock cut the recording into `Recording.parts`.
    The metadata say so (`clock_notes`).
    Raises InputError with file, row and column: wrong format, a missing column, text, infinity, many missing values,
    columns of different length, time that runs back.
    """
    source, map_path = Path(source), given_or_shipped(map_path, "map")
    the_map = load_model(map_path, RecordingMap)
    wanted = [entry.column for entry in the_map.channels.values()]
    times = {entry.column: entry.time for entry in the_map.channels.values() if entry.time is not None}
    clocks = [part for one in (the_map.time, *times.values()) if one for part in (one, one.fraction) if part]
    wanted += [part.column for part in clocks]
    gains = {entry.gain for entry in the_map.channels.values() if isinstance(entry.gain, str)}
    dates = {part.column for part in clocks if part.unit == "date"}
    few = FEW_MISSING if the_map.missing == "leave_out" else 0.0
    on_change = sorted({entry.column for entry in the_map.channels.values() if entry.empty == "hold"})
    sparse = wanted if times else []
    foreign = read_foreign(source, wanted, sorted(gains), the_map.csv, sorted(dates), few, on_change, sparse)
    clock_units = {part.column: part.unit for part in clocks}
    asked = clock_units | {entry.column: entry.unit for entry in the_map.channels.values()}
    given, rows_kept = _in_units(source, foreign, asked), None
    if the_map.time is not None and times:
        given, rows_kept = merge(source, given, the_map.time, times)

    raw = {"time_s": _time_s(the_map, given)}
    origins: dict[str, dict[str, str | float]] = {}
    for name, entry in the_map.channels.items():
        gain = foreign.scalars[entry.gain] if isinstance(entry.gain, str) else 1.0
        factor = entry.factor_to(CHANNELS[name].unit, the_map.travel_per_turn_m, gain)
        assert factor is not None  # the map was validated
        values = given[entry.column]
        if entry.wraps_at is not None:
            values = unwrapped(values, entry.wraps_at)
        raw[name] = factor * values + entry.offset
        origins[name] = {"column": entry.column, "unit": entry.unit, "factor": factor, "offset": entry.offset}
        step = count_of(raw[name][np.isfinite(raw[name])])
        if step is not None:
            origins[name][STEP] = step
        if entry.constant_of_one:
            origins[name][ONE] = entry.constant_of_one
        if entry.gain is not None:
            origins[name]["si_per_volt"] = gain if isinstance(entry.gain, str) else entry.gain
    clock = the_map.time.column if the_map.time is not None else "sample_rate_hz"
    positions = [name for name in (the_map.axis.motor_position, the_map.axis.table_position) if name in raw]
    complete = complete_rows(raw, the_map.rows_per_sample, positions)
    if not complete.rows.size:
        raise InputError(f"{source}: no row has a value of each of {', '.join(wanted)}; leave out the slower channels")

    def place(row: int) -> str:
        at = int(complete.rows[row])
        return f"{foreign.place(at if rows_kept is None else int(rows_kept[at]))}: {clock}"

    rows = regular_rows(complete.columns, place, the_map.resample_hz)
    columns = dict(rows.columns)
    geared = _set_points_of_the_load(columns, the_map.axis, origins)
    derived = _derive(columns, the_map.axis, rows)
    metadata: dict[str, Any] = {
        "source": source.name,
        "source_sha256": _sha256(source),
        "map": map_path.name,
        "about": the_map.about,
        "lead_m": the_map.travel_per_turn_m,
        "channels": origins,
        "derived": derived,
        "clock": _describe_clock(rows),
    }
    metadata |= clock_metadata(rows)
    if nominal := the_map.nominal.model_dump(exclude_none=True):
        metadata[NOMINAL] = nominal
    if notes := [*foreign.notes, *complete.notes, *rows.notes, *geared]:
        metadata[CLOCK_NOTES] = notes
    return Recording(source.stem, columns, rows.period_s, metadata)


def _in_units(source: Path, foreign: Foreign, asked: dict[str, str]) -> dict[str, FloatArray]:
    """Columns (n,) of cells with units in those of the map, `asked`. Raises InputError: one that does not convert."""
    columns = dict(foreign.columns)
    for name, own in ((name, foreign.units[name]) for name in asked if name in foreign.units):
        base, factor = base_of(asked[name])
        if base != own:
            raise InputError(
                f"{source}: {name}: given {asked[name]!r} in the map, its cells hold units of {own}; correct the unit"
            )
        columns[name] = columns[name] / factor
    return columns


def _time_s(the_map: RecordingMap, raw: dict[str, FloatArray]) -> FloatArray:
    if the_map.time is not None:
        first = float(raw[the_map.time.column][0])
        return seconds(raw, the_map.time, first if abs(first) * the_map.time.seconds > EPOCH_S else 0.0)
    assert the_map.sample_rate_hz is not None
    rows = next(iter(raw.values())).size
    return np.asarray(np.arange(rows) / the_map.sample_rate_hz, dtype=np.float64)


def _set_points_of_the_load(
    columns: dict[str, FloatArray], axis: AxisChannels, origins: dict[str, dict[str, str | float]]
) -> list[str]:
    """Divide set-points of the motor's angle by the gear; notes of what was changed."""
    gear = gear_of_set_points(columns, axis)
    if gear == 1.0:
        return []
    for name in (name for name in SET_POINTS if name in columns):
        columns[name] = columns[name] / gear
        origins[name] |= {key: float(origins[name][key]) / gear for key in ("factor", STEP) if key in origins[name]}
    return [f"set-points: they follow the motor's angle, and are divided by the gear ratio {gear:.6g} of the encoders"]


def _derive(columns: dict[str, FloatArray], axis: AxisChannels, rows: RegularRows) -> dict[str, str]:
    """Add the channels that follow from others; return how each was derived."""
    derived = {}
    if axis.velocity_command not in columns and axis.position_command in columns:
        parts = [columns[axis.position_command][piece] for piece in rows.pieces]
        columns[axis.velocity_command] = np.concatenate([np.gradient(part, rows.period_s) for part in parts])
        derived[axis.velocity_command] = f"central differences of {axis.position_command}"
    for name, other in ((axis.torque, axis.torque_command), (axis.torque_command, axis.torque)):
        if name not in columns and other in columns:
            columns[name] = columns[other].copy()
            derived[name] = f"copy of {other}, the only one recorded"
    return derived


def _describe_clock(rows: RegularRows) -> str:
    """Describe the largest deviation of the time stamps from start of the part + tick x period."""
    parts = [rows.columns["time_s"][piece] for piece in rows.pieces]
    deviation_s = max(float(np.abs(part - part[0] - np.arange(part.size) * rows.period_s).max()) for part in parts)
    return f"period {rows.period_s:.9g} s; stamps within {deviation_s:.2g} s of start + tick x period"


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
