"""Formats of `hil export` and of the log of a bus: what is kept, size, time, and which library opened the file.

    python -m hil.validation.benchmarks.exchange

60 s at 1 kHz with 16 channels of a simulated run, whose values have noise in every digit. A format whose library is not
installed is left out. It is no part of `hil bench`, whose figures are those of the loop.
"""

import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import can
import numpy as np

from hil.bench.bench_file import load_bench
from hil.channels import CHANNELS
from hil.errors import InputError
from hil.exchange.bus_log import import_bus_log
from hil.exchange.csv_file import metadata_path
from hil.exchange.export import export_recording
from hil.exchange.own_file import read_exported
from hil.recording.recording import Recording
from hil.report.console import table

ROWS, PERIOD_S = 60_000, 1e-3
HEADERS = ("format", "channels", "units", "metadata", "bits", "size [MB]", "write [s]", "read [s]", "opened by")
_NAMES = (
    "time_s", "position_command_m", "velocity_command_m_s", "acceleration_command_m_s2", "motor_position_rad",
    "table_position_m", "torque_command_n_m", "torque_n_m", "velocity_reference_m_s", "twin_motor_position_rad",
    "twin_table_position_m", "twin_torque_n_m", "drive_state", "drive_error_code", "segment", "lateness_s",
)  # fmt: skip


class Opened(NamedTuple):
    """What the library of a format finds in a file."""

    library: str
    channels: int
    units: int


def recording() -> Recording:
    """A run of ROWS rows with 16 channels; the states are constant as in a real one."""
    rng = np.random.default_rng(1)
    columns = {name: np.sin(np.arange(ROWS) * 1e-3) + 1e-6 * rng.normal(size=ROWS) for name in _NAMES}
    columns["time_s"] = np.arange(ROWS) * PERIOD_S
    columns |= {name: np.full(ROWS, 4.0) for name in ("drive_state", "drive_error_code", "segment")}
    metadata = {
        "seed": 1,
        "start_time": "2026-01-02T03:04:05+0000",
        "bench": load_bench("reference").model_dump(mode="json"),
    }
    return Recording("run", columns, PERIOD_S, metadata)


def _mf4(path: Path) -> Opened:
    from asammdf import MDF

    with MDF(path) as file:
        signals = file.select([(name, None, None) for name in CHANNELS if name in file.channels_db])
        return Opened("asammdf", 1 + len(signals), 1 + sum(one.unit == CHANNELS[one.name].unit for one in signals))


def _mcap(path: Path) -> Opened:
    import json

    from mcap.reader import make_reader

    with path.open("rb") as file:
        schema, _, message = list(make_reader(file).iter_messages())[-1]
    titles = json.loads(schema.data)["properties"]
    units = sum(one["title"] == f"{name} [{CHANNELS[name].unit}]" for name, one in titles.items())
    return Opened("mcap", len(json.loads(message.data)), units)


def _csv(path: Path) -> Opened:
    import pyarrow.csv

    names = pyarrow.csv.read_csv(path).column_names
    return Opened("pyarrow", len(names), len(names))  # the names hold the units


def _mat(path: Path) -> Opened:
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True)
    units = sum(content["units"][name] == CHANNELS[name].unit for name in CHANNELS if name in content)
    return Opened("scipy", sum(name in CHANNELS for name in content), units)


def _h5(path: Path) -> Opened:
    import h5py

    with h5py.File(path) as file:
        names = [name for name in file if name in CHANNELS]
        return Opened("h5py", len(names), sum(file[name].attrs["units"] == CHANNELS[name].unit for name in names))


OPENERS: dict[str, Callable[[Path], Opened]] = {
    ".mf4": _mf4, ".mcap": _mcap, ".csv": _csv, ".mat": _mat, ".h5": _h5,
}  # fmt: skip


def measure(run: Recording, ending: str, folder: Path) -> list[str]:
    """A row of the table. Raises InputError where the library of the format is not installed."""
    path = folder / f"run{ending}"
    start_s = time.perf_counter()
    export_recording(run, path)
    written_s = time.perf_counter()
    back = read_exported(path)
    read_s = time.perf_counter()
    assert back is not None
    opened = OPENERS[ending](path)
    same = all(back[name].tobytes() == values.tobytes() for name, values in run.columns.items())
    size = path.stat().st_size + (metadata_path(path).stat().st_size if ending == ".csv" else 0)
    count = len(run.columns)
    return [
        ending, f"{opened.channels}/{count}", f"{opened.units}/{count}",
        _yes(back.metadata == run.metadata), _yes(same),
        f"{size / 1e6:.2f}", f"{written_s - start_s:.2f}", f"{read_s - written_s:.2f}", opened.library,
    ]  # fmt: skip


def measure_log(ticks: int, ending: str, folder: Path) -> list[str]:
    """A row of the table for the log of a bus: SYNC, command, answers of drive and encoder in each tick."""
    path, bench = folder / f"bus{ending}", load_bench("reference")
    assert bench.drive is not None
    bench = bench.model_copy(update={"drive": bench.drive.model_copy(update={"rated_torque_n_m": 14.0})})
    counts = np.round(1e6 * np.sin(np.arange(ticks) * 1e-3)).astype(int)
    start_s = time.perf_counter()
    with can.Logger(path) as log:
        for tick, count in enumerate(counts.tolist()):
            position = count.to_bytes(4, "little", signed=True)
            answer = b"\x37\x02" + position + b"\x10\x00"
            sent = {0x080: b"", 0x185: answer, 0x186: position, 0x205: bytes(4)}
            for can_id, data in sent.items():
                stamp = 1e9 + tick * PERIOD_S
                log.on_message_received(can.Message(stamp, can_id, is_extended_id=False, data=data))
    written_s = time.perf_counter()
    decoded = import_bus_log(path, bench)
    read_s = time.perf_counter()
    same = bool(np.array_equal(decoded["motor_position_rad"], counts[: len(decoded)] * bench.motor_count))
    return [
        ending, str(len(decoded.columns)), "-", "-", _yes(same), f"{path.stat().st_size / 1e6:.2f}",
        f"{written_s - start_s:.2f}", f"{read_s - written_s:.2f}", "python-can",
    ]  # fmt: skip


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def main() -> None:
    """Print the table."""
    run, rows = recording(), list[list[str]]()
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of libraries about themselves
        for ending in OPENERS:
            try:
                rows.append(measure(run, ending, Path(name)))
            except InputError as error:
                rows.append([ending, *["-"] * (len(HEADERS) - 2), str(error).rpartition("; ")[2]])
        rows += [measure_log(ROWS, ending, Path(name)) for ending in (".blf", ".asc", ".log")]
    table(HEADERS, rows)


if __name__ == "__main__":
    main()
