"""From the log of a CAN bus to a recording: the process data of a CiA 402 drive and its encoder, SYNC by SYNC.

What the log has of the set-up tells how to read it: PDO mappings, identifiers, encoder resolution and rated torque are
objects that the master wrote or read by SDO. Else the bench tells, and the mapping is the one that `hil run` writes.
A row is a SYNC, as in a recording of `hil run`: positions are those of its answers, the torque is that of the next
answer (the mean until then), the command is the one sent after it.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from drivers.canopen_encoder import PROCESS_DATA
from drivers.cia402 import STATE_BY_STATUS, OperationMode
from drivers.cia402_setup import FEEDBACK, TARGET, commands
from drivers.object_index import ObjectIndex as Index
from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveSection
from hil.channels import AXIS_CHANNELS, AxisKind
from hil.errors import InputError, listed
from hil.exchange.can_frames import BusFrames, Node, read_frames
from hil.files.input_file import bounded
from hil.loop.eds_files import MODES
from hil.recording.recording import Recording, clock_metadata
from hil.recording.stamps import regular_rows

_STATES = np.array([int(state) for state in STATE_BY_STATUS], dtype=np.float64)
_LEAST = 3  # SYNCs of a recording


@bounded
def import_bus_log(path: Path, bench: Bench) -> Recording:
    """Decode a log (.blf, .asc, .log) of the bus of `bench`.

    Raises InputError: no readable log, no SYNC, no answers of the drive, units that neither log nor bench tell.
    """
    frames = read_frames(path)
    rows = sync_rows(frames, bench)
    regular = regular_rows(rows, lambda row: f"{path}: row {row + 1} (a SYNC each)", period_s=bench.period_s)
    metadata = {"source": path.name, "bench": bench.model_dump(mode="json")} | clock_metadata(regular)
    return Recording(path.stem, regular.columns, regular.period_s, metadata)


def sync_rows(frames: BusFrames, bench: Bench) -> dict[str, FloatArray]:
    """Channels (n,) at each SYNC from the first at which all are known. Raises InputError as `import_bus_log`."""
    path, section, mode = frames.path, bench.drive or DriveSection(), MODES[(bench.drive or DriveSection()).mode]
    if frames.syncs.size < _LEAST:
        raise InputError(
            f"{path}: given {frames.syncs.size} SYNC messages (identifier 0x080), allowed {_LEAST} or more; log a run"
        )
    drive = Node(frames, section.node_id, {0: FEEDBACK}, {0: commands(mode)})
    statusword, counts = drive.sampled(Index.STATUSWORD), drive.sampled(Index.POSITION_ACTUAL)
    if statusword is None or counts is None:
        raise InputError(
            f"{path}: the drive (drive.node_id {section.node_id}) sends no statusword and position in its PDOs, "
            f"given frames of the identifiers {frames.identifiers}; correct the bench"
        )
    names = AXIS_CHANNELS[AxisKind.LINEAR if bench.axis.linear else AxisKind.ROTARY]
    si_per_count, si_per_mille = _units(path, drive, bench, section)
    columns = {"time_s": frames.tick_times(bench.period_s), names.motor_position: counts * si_per_count}
    if bench.has_table_encoder and section.encoder.interface == "canopen":
        encoder = Node(frames, section.encoder.node_id, {0: PROCESS_DATA}, {})
        table = encoder.sampled(Index.ENCODER_POSITION)
        if table is not None and bench.encoders.table is not None:
            step_nm = encoder.object(Index.ENCODER_STEP_SETTINGS, 1)
            columns[names.table_position] = table * (step_nm / 1e9 if step_nm else bench.encoders.table.resolution_m)
    columns |= _command(drive, mode, bench, names, si_per_count, si_per_mille)
    torque = drive.sampled(Index.TORQUE_ACTUAL)
    if torque is not None:
        columns[names.torque] = np.r_[torque[1:], np.nan] * si_per_mille
    columns["drive_state"] = _STATES[np.nan_to_num(statusword).astype(np.int64) & 0x7F]
    columns["drive_error_code"] = drive.error_codes()
    known = np.flatnonzero(np.logical_and.reduce([np.isfinite(values) for values in columns.values()]))
    if not known.size:
        raise InputError(f"{path}: at no SYNC are all of {listed(columns)} known; log a longer part of the run")
    rows = slice(int(known[0]), int(known[-1]) + 1)
    start_s = columns["time_s"][rows.start]
    return {name: values[rows] - (start_s if name == "time_s" else 0.0) for name, values in columns.items()}


def _units(path: Path, drive: Node, bench: Bench, section: DriveSection) -> tuple[float, float]:
    """SI value of a count of the motor's position and of 1/1000 of the rated torque (objects 0x608F, 0x6076)."""
    counts, turns = (drive.object(Index.POSITION_ENCODER_RESOLUTION, sub) for sub in (1, 2))
    si_per_count = 2.0 * math.pi / (counts / max(turns or 1, 1)) if counts else bench.motor_count
    rated = drive.object(Index.RATED_TORQUE, 0)
    rated_torque = rated / 1000 if rated else section.rated_torque_n_m
    if not si_per_count or rated_torque is None:
        raise InputError(
            f"{path}: neither the log nor the bench tells the rated torque (object 0x6076); give "
            f"drive.rated_torque_n_m in the bench file, or log from before the set-up: hil run --bus-log"
        )
    return si_per_count, rated_torque / 1000


def _command(
    drive: Node, mode: OperationMode, bench: Bench, names: Any, si_per_count: float, si_per_mille: float
) -> dict[str, FloatArray]:
    """The set-point that the drive got after each SYNC, as the channel that it commands."""
    target = drive.commanded(TARGET[mode].index)
    if target is None:
        return {}
    ratio = bench.gains.ratio_m_rad
    match mode:
        case OperationMode.CYCLIC_SYNC_TORQUE:
            return {names.torque_command: target * si_per_mille}
        case OperationMode.CYCLIC_SYNC_VELOCITY:
            return {"velocity_reference_m_s": target * si_per_count * ratio}
        case _:
            return {names.position_command: target * si_per_count * ratio}
