"""Import a foreign recording (CSV, MATLAB .mat to version 7, Parquet, JSON) by a map (`hil.recording.import_map`)."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.channels import CHANNELS, AxisChannels
from hil.errors import InputError
from hil.files.yaml_model import load_model
from hil.quantities import si_factor
from hil.recording.foreign_files import read_foreign
from hil.recording.import_map import RecordingMap
from hil.recording.recording import Recording, check_columns

GAP_STEPS = 10.0  # of the clock: above, rows are missing and are not interpolated
MAPS = Path(__file__).parents[1] / "maps"


def import_recording(source: str | Path, map_path: str | Path) -> Recording:
    """Read `source` (.csv, .txt, .mat, .parquet, .json) by the map file `map_path`, or by a shipped map's name (emps).

    Missing channels are derived: velocity_command_m_s by central differences of the position command; torque from
    torque command or vice versa (on a linear axis force). The metadata list them (`derived`) and the source of each
    channel (`channels`).
    Raises InputError with file, row and column: wrong format, a missing column, text, NaN or infinity, columns of
    different length, an irregular clock.
    """
    source, map_path = Path(source), _find_map(map_path)
    the_map = load_model(map_path, RecordingMap)
    wanted = [entry.column for entry in the_map.channels.values()]
    if the_map.time is not None:
        wanted.append(the_map.time.column)
    gains = {entry.gain for entry in the_map.channels.values() if isinstance(entry.gain, str)}
    foreign = read_foreign(source, wanted, sorted(gains), the_map.csv.format())

    columns = {"time_s": _time_s(the_map, foreign.columns)}
    origins: dict[str, dict[str, str | float]] = {}
    for name, entry in the_map.channels.items():
        gain = foreign.scalars[entry.gain] if isinstance(entry.gain, str) else 1.0
        factor = entry.factor_to(CHANNELS[name].unit, the_map.lead_m, gain)
        assert factor is not None  # the map was validated
        columns[name] = factor * foreign.columns[entry.column] + entry.offset
        origins[name] = {"column": entry.column, "unit": entry.unit, "factor": factor, "offset": entry.offset}
        if entry.gain is not None:
            origins[name]["si_per_volt"] = gain if isinstance(entry.gain, str) else entry.gain
    clock = the_map.time.column if the_map.time is not None else "sample_rate_hz"
    if the_map.resample_hz is not None:
        columns = _resampled(columns, the_map.resample_hz, lambda row: f"{foreign.place(row)}: {clock}")
    period_s = check_columns(columns, lambda row: f"{foreign.place(row)}: {clock}")
    derived = _derive(columns, the_map.axis, period_s)
    metadata: dict[str, Any] = {
        "source": source.name,
        "source_sha256": _sha256(source),
        "map": map_path.name,
        "about": the_map.about,
        "lead_m": the_map.lead_m,
        "channels": origins,
        "derived": derived,
        "clock": _describe_clock(columns["time_s"], period_s),
    }
    return Recording(source.stem, columns, period_s, metadata)


def _find_map(map_path: str | Path) -> Path:
    shipped = MAPS / f"{map_path}.yaml"
    return shipped if not Path(map_path).exists() and shipped.is_file() else Path(map_path)


def _time_s(the_map: RecordingMap, raw: dict[str, FloatArray]) -> FloatArray:
    if the_map.time is not None:
        factor = si_factor(the_map.time.unit, "s")
        assert factor is not None
        return np.asarray(factor * raw[the_map.time.column], dtype=np.float64)
    assert the_map.sample_rate_hz is not None
    rows = next(iter(raw.values())).size
    return np.asarray(np.arange(rows) / the_map.sample_rate_hz, dtype=np.float64)


def _resampled(columns: dict[str, FloatArray], rate_hz: float, place: Callable[[int], str]) -> dict[str, FloatArray]:
    """Columns interpolated linearly to a regular clock. Raises InputError for time that runs back, or a gap."""
    time_s = columns["time_s"]
    steps = np.diff(time_s)
    bad = np.flatnonzero((steps <= 0.0) | (steps > GAP_STEPS * np.median(steps)))
    if bad.size:
        row = int(bad[0]) + 1
        raise InputError(
            f"{place(row)}: a step of {steps[row - 1]:.6g} s, allowed above 0 and below {GAP_STEPS:g} x "
            f"{np.median(steps):.6g} s to be interpolated; cut the recording there"
        )
    even_s = time_s[0] + np.arange(int((time_s[-1] - time_s[0]) * rate_hz) + 1) / rate_hz
    return {"time_s": even_s} | {
        name: np.interp(even_s, time_s, values) for name, values in columns.items() if name != "time_s"
    }


def _derive(columns: dict[str, FloatArray], axis: AxisChannels, period_s: float) -> dict[str, str]:
    """Add the channels that follow from others; return how each was derived."""
    derived = {}
    if axis.velocity_command not in columns and axis.position_command in columns:
        columns[axis.velocity_command] = np.gradient(columns[axis.position_command], period_s)
        derived[axis.velocity_command] = f"central differences of {axis.position_command}"
    for name, other in ((axis.torque, axis.torque_command), (axis.torque_command, axis.torque)):
        if name not in columns and other in columns:
            columns[name] = columns[other].copy()
            derived[name] = f"copy of {other}, the only one recorded"
    return derived


def _describe_clock(time_s: FloatArray, period_s: float) -> str:
    """Describe the largest deviation of the time stamps from start + tick x period."""
    deviation_s = np.abs(time_s - time_s[0] - np.arange(time_s.size) * period_s).max()
    return f"period {period_s:.9g} s; stamps within {deviation_s:.2g} s of start + tick x period"


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
