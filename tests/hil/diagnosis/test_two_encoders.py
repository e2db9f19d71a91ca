"""Two encoders and a noisy torque: an axis with a light motor that lacks nothing gets no name, lost motion its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from foreign_axis import write
from two_mass_axis import TwoMassAxis, columns

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.result import Result
from hil.recording.recording import read_recording


def diagnosed(folder: Path, axis: TwoMassAxis) -> Result:
    (folder / "readme.txt").write_text("Belt axis, 62.832 mm per motor turn. Carriage about 14.3 kg.\n")
    source = write(folder / "log.csv", columns(axis, seconds=24.0, noise_n_m=0.05))
    import_(source, None, folder / "log.parquet", readme=folder / "readme.txt")
    identify([folder / "log.parquet"], folder / "axis.yaml")
    return diagnose([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml")).result


@pytest.mark.long
def test_friction_of_the_load_and_a_light_motor_are_nothing_that_is_missing(tmp_path: Path) -> None:
    assert [one.effect for one in diagnosed(tmp_path, TwoMassAxis(motor_kg=1.0)).missing] == []


@pytest.mark.long
def test_lost_motion_beside_friction_of_the_load_is_named(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, TwoMassAxis(gap_m=6e-5)).missing
    assert found
    assert {"backlash", "preload_loss"} & {found[0].effect, *found[0].equivalents}
