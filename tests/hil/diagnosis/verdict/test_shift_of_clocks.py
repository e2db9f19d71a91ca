"""A shift of the clocks between two fits: plain least squares of torque over motion are its witness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, renamed, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.verdict.each_alone import _late_otherwise
from hil.explanation import explain
from hil.identification.estimator import Fit
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.recording.recording import read_recording

ROWS, NOISE_N_M = 6000, 0.02


def fitted(folder: Path, rows_late: int, seed: int) -> Fit:
    """Fit of an axis whose torque is recorded some rows late."""
    folder.mkdir()
    columns = axis(ROWS + rows_late)
    torque = columns["torque"] + np.random.default_rng(seed).normal(0.0, NOISE_N_M, ROWS + rows_late)
    columns = {name: values[rows_late:] for name, values in columns.items()} | {"torque": torque[:ROWS]}
    columns["t"] = columns["t"] - columns["t"][0]
    path = write(folder / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    import_(path, None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    prepared = prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml"))
    return fit_nominal_parameters(prepared.train)


@pytest.mark.parametrize(("rows_late", "shifted"), [(0, False), (5, True)])
def test_plain_least_squares_tell_another_lateness(tmp_path: Path, rows_late: int, shifted: bool) -> None:
    """Whatever delays the twins have been fitted with."""
    one, other = fitted(tmp_path / "one", 0, 1), fitted(tmp_path / "other", rows_late, 2)
    assert _late_otherwise(one, other) is shifted
    assert _late_otherwise(other, one) is shifted


@pytest.mark.long
def test_clocks_that_run_apart_have_not_shifted(tmp_path: Path) -> None:
    """A delay that grows by 0.2 ms per second differs from part to part, and at no moment."""
    columns = axis(4 * ROWS)
    columns["torque"] = np.interp(columns["t"] * (1.0 - 2e-4), columns["t"], columns["torque"])
    columns["torque"] += np.random.default_rng(3).normal(0.0, NOISE_N_M, 4 * ROWS)
    path = write(tmp_path / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    told = explain([path], tmp_path / "out").diagnosis.result
    assert told.change is None
    assert told.statement.startswith("The clocks of torque and position run apart by 20")
    assert "shifted" not in told.statement
