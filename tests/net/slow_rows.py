"""Friction of real recordings from every 4th, 10th and 50th row, sampled and averaged, beside that of all rows.

    python tests/net/slow_rows.py [--only PART]     from the root of the repository, recordings beside it

A value is told if it is within 10 % of that of all rows, `-` if its error is as large as its deviation or it is not
significant, and WRONG else.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from real_recordings import RECORDINGS, imported

from hil.drafting.plant_values import PlantValues, plant_values
from hil.errors import InputError
from hil.identification.derived_channels import with_position
from hil.identification.least_squares import Estimate
from hil.quantities import ROTARY_LEAD_M
from hil.recording.recording import Recording, read_recording

FILES = (
    *(f"rig/{name}/train_1.csv" for name in ("null", "stribeck", "backlash", "lead")),
    "emps/DATA_EMPS.mat",
    *(f"kuka/axis{name}.csv" for name in ("1_a", "1_b", "1_c", "2_a", "3_c")),
    *(f"sinumerik/{name}.csv" for name in ("axis1_part2", "axis2_part1", "axis2_part2")),
    *(f"laas/{name}.csv" for name in ("speed", "acceleration")),
)
EVERY = (4, 10, 50)


def main() -> None:
    """Print a line for each recording and thinning."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="only recordings whose name contains this")
    options = parser.parse_args()
    wrong = 0
    print(f"{'recording':32} {'rows':>12} {'Coulomb':>22} {'viscous':>22} {'inertia':>22}")
    for file in FILES:
        if options.only not in file:
            continue
        recording = read(RECORDINGS / file)
        whole = fitted(recording)
        print(f"{file:32} {1e3 * recording.period_s:9.3g} ms {shown(whole)}", flush=True)
        for every in EVERY:
            for mean in (False, True):
                found = fitted(thinned(recording, every, mean))
                told = [verdict(found, whole, name) for name in ("coulomb", "viscous")]
                wrong += told.count("WRONG")
                print(f"{'':32} {every:5} {'mean' if mean else 'sample':6} {shown(found)} {' '.join(told)}", flush=True)
    print(f"wrong: {wrong}")


def read(path: Path) -> Recording:
    """The longest part of a foreign file, imported as `hil import` does."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.parquet"
        command = [sys.executable, "-m", "hil.cli", *imported(path, str(run))]
        subprocess.run(command, capture_output=True, check=True)
        return max(with_position(read_recording(run)).parts(), key=len)


def thinned(recording: Recording, every: int, mean: bool) -> Recording:
    """Every so many rows, or the mean of each so many."""
    rows = len(recording) // every * every
    blocks = {name: values[:rows].reshape(-1, every) for name, values in recording.columns.items()}
    columns = {name: block.mean(axis=1) if mean else block[:, 0] for name, block in blocks.items()}
    return Recording(recording.name, columns, every * recording.period_s, recording.metadata)


def fitted(recording: Recording) -> PlantValues | str:
    """Values, or why there are none."""
    try:
        return plant_values([recording], 1.0 if recording.metadata.get("lead_m") == ROTARY_LEAD_M else None)
    except InputError as error:
        return str(error).split(";", maxsplit=1)[0]


def verdict(found: PlantValues | str, whole: PlantValues | str, name: str) -> str:
    """told, -, or WRONG."""
    if isinstance(found, str) or isinstance(whole, str):
        return "-"
    one, other = (getattr(values, name) for values in (found, whole))
    assert isinstance(one, Estimate)
    assert isinstance(other, Estimate)
    away = abs(one.value - other.value)
    if not (one.significant and other.significant and other.value > 0.0):
        return "-"
    return (
        "told"
        if away <= 0.1 * abs(other.value)
        else "-"
        if away <= np.hypot(one.std_error, other.std_error)
        else "WRONG"
    )


def shown(found: PlantValues | str) -> str:
    """Values with their errors."""
    if isinstance(found, str):
        return found
    return " ".join(
        f"{one.value:11.4g} +-{one.std_error:8.2g}" for one in (found.coulomb, found.viscous, found.inertia)
    )


if __name__ == "__main__":
    sys.exit(main())
