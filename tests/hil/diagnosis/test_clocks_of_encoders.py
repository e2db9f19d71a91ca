"""The clocks of two encoders that run apart: a delay that grows with time, below the noise of a row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, renamed, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.questions import ENCODER_LATENESS
from hil.diagnosis.result import CLOCK
from hil.diagnosis.structure_left import Dependence, structure_left
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.recording.recording import read_recording

ROWS, NOISE_RAD, RATE = 20_000, 0.02, 4e-5


def clocks(folder: Path, rate: float) -> list[Dependence]:
    """What is told of the clocks of an axis whose second encoder runs fast by a rate."""
    columns = axis(ROWS)
    read = np.interp(columns["t"] * (1.0 - rate), columns["t"], columns["angle"])
    columns["load"] = read + np.random.default_rng(5).normal(0.0, NOISE_RAD, ROWS)
    named = renamed(columns, t="time_s", angle="motor_angle_rad", load="load_angle_rad", torque="torque_Nm")
    import_(write(folder / "log.csv", named), None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    prepared = prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml"))
    left = structure_left(fit_nominal_parameters(prepared.train), prepared.held_out)
    return [one for one in left if one.question.name == CLOCK]


def test_clocks_of_encoders_that_run_apart_are_told(tmp_path: Path) -> None:
    (one,) = clocks(tmp_path, RATE)
    assert one.question.change is not None
    assert one.question.change.coefficient == ENCODER_LATENESS
    assert one.question.change.rate == pytest.approx(RATE, rel=0.2)
    assert one.in_words("N m").startswith("the clocks of both encoders run apart by")
    assert "the second encoder is recorded" in one.in_words("N m")
    assert "later than at the begin" in one.in_words("N m")


def test_one_clock_is_not_two(tmp_path: Path) -> None:
    assert clocks(tmp_path, 0.0) == []
