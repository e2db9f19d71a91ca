"""A line over time that grows with the speed of the motion is no force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.search.facts import axis_facts
from hil.recording.recording import read_recording
from hil.twin.library import BY_ID

LINE_HZ = 27.0


@pytest.mark.parametrize("late_s", [0.0, 2e-4])
def test_time_stamps_that_are_late_now_and_then_are_no_force(tmp_path: Path, late_s: float) -> None:
    columns = axis(8000)
    wave = np.sin(2.0 * np.pi * LINE_HZ * columns["t"])
    angle, torque = columns["angle"], columns["torque"]
    if late_s:
        angle = angle + late_s * wave * np.abs(columns["speed"])
    else:
        torque = torque - 0.1 * wave  # what the drive adds against a force
    table = {"time_s": columns["t"], "motor_angle_rad": angle, "torque_Nm": torque}
    import_(write(tmp_path / "log.csv", table), None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    bench = load_bench(tmp_path / "axis.yaml")
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], bench)
    facts = axis_facts(prepared.bench, prepared.train.runs)
    assert facts.grows_with_speed(LINE_HZ) is bool(late_s)
    assert BY_ID["periodic_force"].is_claimable((0.1, LINE_HZ, 0.0), 0, facts) is not bool(late_s)


@pytest.mark.parametrize(("waves", "may_be"), [(4.5, False), (5.5, True)])
def test_a_force_needs_five_waves_in_the_recording(tmp_path: Path, waves: float, may_be: bool) -> None:
    """The part for training has fewer."""
    columns = axis(24_000)
    line_hz = waves / float(columns["t"][-1])
    torque = columns["torque"] - 0.1 * np.sin(2.0 * np.pi * line_hz * columns["t"])
    table = {"time_s": columns["t"], "motor_angle_rad": columns["angle"], "torque_Nm": torque}
    import_(write(tmp_path / "log.csv", table), None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    facts = axis_facts(prepared.bench, prepared.train.runs)
    assert BY_ID["periodic_force"].is_claimable((0.1, line_hz, 0.0), 0, facts) is may_be
