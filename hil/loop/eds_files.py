"""EDS files of a bench: the ones it names or those shipped, and whether they describe the devices that it needs."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from drivers.acting_setpoint import DEMAND
from drivers.canopen_encoder import PROCESS_DATA
from drivers.cia402 import OperationMode
from drivers.cia402_setup import FEEDBACK, commands
from drivers.eds_file import read_eds
from drivers.eds_text import EdsError
from drivers.pdo import Entry
from drivers.sdo_setup import EDS_FOLDER
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode, DriveSection
from hil.errors import FieldError, FieldPath

MODES: Final = {
    DriveMode.CST: OperationMode.CYCLIC_SYNC_TORQUE,
    DriveMode.CSV: OperationMode.CYCLIC_SYNC_VELOCITY,
    DriveMode.CSP: OperationMode.CYCLIC_SYNC_POSITION,
}


def drive_eds(section: DriveSection) -> Path:
    """Return the EDS file of the drive."""
    return EDS_FOLDER / "servo_drive.eds" if section.eds is None else Path(section.eds)


def encoder_eds(section: DriveSection) -> Path:
    """Return the EDS file of the linear encoder."""
    return EDS_FOLDER / "linear_encoder.eds" if section.encoder.eds is None else Path(section.encoder.eds)


def check_eds_files(bench: Bench) -> tuple[str, ...]:
    """Read the EDS files of a bench and return what they leave in doubt, one sentence each.

    Raises FieldError at the field of a file that cannot be read, or lacks process data of the mode, or has them with
    another type.
    """
    notes: list[str] = []
    for use in _uses(bench):
        try:
            eds = read_eds(use.path, use.node_id)
            eds.check(use.needed)
            eds.check(entry for entry in use.wanted if entry.index in eds.dictionary)
        except EdsError as error:
            raise FieldError(use.field, f"given {error}") from None
        notes += [f"{use.path}, {note}" for note in eds.notes]
    return tuple(notes)


class _Use(NamedTuple):
    """An EDS file of the bench. wanted: process data that are used if the device has them."""

    field: FieldPath
    path: Path
    node_id: int
    needed: Sequence[Entry]
    wanted: Sequence[Entry] = ()


def _uses(bench: Bench) -> Iterator[_Use]:
    section = bench.drive or DriveSection()
    mode = MODES[section.mode]
    wanted = (DEMAND[mode],) if section.watch_setpoint else ()
    yield _Use(("drive", "eds"), drive_eds(section), section.node_id, (*commands(mode), *FEEDBACK), wanted)
    if bench.has_table_encoder and section.encoder.interface == "canopen":
        yield _Use(("drive", "encoder", "eds"), encoder_eds(section), section.encoder.node_id, PROCESS_DATA)
