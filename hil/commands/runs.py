"""Read the recording of a command and say what was done to its clock."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hil.report.console import err

if TYPE_CHECKING:
    from hil.recording.recording import Recording


def read_run(path: Path) -> Recording:
    """Read a recording; gaps and uneven stamps are printed. Raises InputError as `read_recording`."""
    from hil.recording.recording import CLOCK_NOTES, read_recording

    recording = read_recording(path)
    for note in recording.metadata.get(CLOCK_NOTES, []):
        err.print(f"{recording.name}: {note}", markup=False)
    return recording
