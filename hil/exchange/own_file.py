"""Read back what `hil export` wrote: the metadata in a file tell that it is one, and the recording needs no map."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hil.channels import CHANNELS
from hil.exchange.content import METADATA
from hil.exchange.csv_file import read_csv
from hil.exchange.export import WRITERS
from hil.files.input_file import bounded, is_file
from hil.importing.channel_groups import CLOCK
from hil.importing.foreign_columns import check_foreign
from hil.importing.variables import load_variables
from hil.recording.arrow_files import checked_metadata
from hil.recording.recording import Recording, recording_of


@bounded
def read_exported(path: Path) -> Recording | None:
    """The recording that `path` was exported from; None for a file of another origin.

    Raises InputError: damaged, metadata or columns that are no recording, a library that is not installed.
    """
    if path.suffix.lower() not in WRITERS or not is_file(path) or not path.stat().st_size:
        return None
    check_foreign(path)
    if path.suffix.lower() == ".csv":
        found = read_csv(path)
        if found is None:
            return None
        columns, units, text = found
    else:
        arrays, units = load_variables(path)
        if METADATA not in arrays:
            return None
        text = str(np.asarray(arrays[METADATA]).reshape(-1)[0])
        if "time_s" not in arrays and CLOCK in arrays:  # the clock of an MDF group
            arrays = {"time_s": arrays[CLOCK]} | arrays
        columns = {
            name: np.asarray(values, dtype=np.float64).reshape(-1)
            for name, values in arrays.items()
            if name in CHANNELS and np.asarray(values).dtype.kind in "fiub"
        }
    return recording_of(path, columns, _known(units), checked_metadata(path, text))


def _known(units: Mapping[str, str]) -> dict[str, str]:
    return {name: unit for name, unit in units.items() if name in CHANNELS and unit}
