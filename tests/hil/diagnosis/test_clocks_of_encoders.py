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


def drift(columns: dict[str, np.ndarray], rate: float) -> np.ndarray:
    return np.interp(columns["t"] * (1.0 - rate), columns["t"], columns["angle"])


def clocks(folder: Path, read: np.ndarray) -> list[Dependence]:
    """The clock findings for a reading (n,) of the second encoder."""
    columns = axis(ROWS)
    columns["load"] = read + np.random.default_rng(5).normal(0.0, NOISE_RAD, ROWS)
    named = renamed(columns, t="time_s", angle="motor_angle_rad", load="load_angle_rad", torque="torque_Nm")
    import_(write(folder / "log.csv", named), None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    prepared = prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml"))
    left = structure_left(fit_nominal_parameters(prepared.train), prepared.held_out)
    return [one for one in left if one.question.name == CLOCK]


@pytest.mark.parametrize(("rate", "way"), [(RATE, "later"), (-RATE, "earlier")])
def test_clocks_of_encoders_that_run_apart_are_told(tmp_path: Path, rate: float, way: str) -> None:
    (one,) = clocks(tmp_path, drift(axis(ROWS), rate))
    assert one.question.change is not None
    assert one.question.change.coefficient == ENCODER_LATENESS
    assert one.question.change.rate == pytest.approx(rate, rel=0.2)
    assert one.in_words("N m").startswith("the clocks of both encoders run apart by")
    assert "the second encoder is recorded" in one.in_words("N m")
    assert f"{way} than at the begin" in one.in_words("N m")


@pytest.mark.parametrize("other", ["one clock", "a step of lateness", "a reversal error that grows", "a growing twist"])
def test_another_change_is_no_clock(tmp_path: Path, other: str) -> None:
    columns = axis(ROWS)
    share, angle = columns["t"] / columns["t"][-1], columns["angle"]
    read = {
        "one clock": angle,
        "a step of lateness": np.interp(columns["t"] - 5e-4 * (share > 0.5), columns["t"], angle),
        "a reversal error that grows": angle - 0.15 * share * np.sign(columns["speed"]),
        "a growing twist": angle - 2e-3 * (1.0 + 5.0 * share) * columns["torque"],
    }
    assert clocks(tmp_path, read[other]) == []
