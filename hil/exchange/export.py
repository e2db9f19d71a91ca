"""Export a recording: the ending of the file says the format."""

import os
from collections.abc import Callable
from pathlib import Path

from hil.errors import InputError
from hil.exchange.content import Content, content_of
from hil.exchange.csv_file import metadata_path, write_csv, write_csv_metadata
from hil.exchange.hdf5_file import write_hdf5
from hil.exchange.mat_file import write_mat
from hil.exchange.mcap_file import write_mcap
from hil.exchange.mdf_file import write_mdf
from hil.files.input_file import is_file
from hil.recording.recording import Recording

WRITERS: dict[str, Callable[[Path, Content], None]] = {
    ".mf4": write_mdf,
    ".mcap": write_mcap,
    ".csv": write_csv,
    ".mat": write_mat,
    ".h5": write_hdf5,
    ".hdf5": write_hdf5,
}


def refuse_existing(path: Path) -> None:
    """Raise InputError for a file that exists."""
    if is_file(path):
        raise InputError(f"{path}: the file exists and is not overwritten; give another name or remove it")


def export_recording(recording: Recording, path: Path) -> tuple[Path, ...]:
    """Write a recording to `path`, whole or not at all; return the files. A CSV file has its metadata in a second one.

    Raises InputError: another ending, a file that exists, no rights or space, a library that is not installed.
    """
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise InputError(f"{path}: given the ending {path.suffix!r}, allowed {', '.join(WRITERS)}; correct it")
    beside = [metadata_path(path)] if ending == ".csv" else []
    for target in (path, *beside):
        refuse_existing(target)
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{ending}")
    content = content_of(recording)
    try:
        WRITERS[ending](part, content)
        if beside:
            write_csv_metadata(path, content)
        part.replace(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror or error}); choose a folder with rights and space"
        ) from None
    finally:
        part.unlink(missing_ok=True)
    return path, *beside
