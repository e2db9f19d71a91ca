"""A draft has the constant torque that the motion tells, below friction or above it."""

from __future__ import annotations

from pathlib import Path

import pytest
from foreign_axis import COULOMB_N_M, axis, renamed, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_

AXIS = axis(rows=8000)


@pytest.mark.parametrize(("share", "drafted_load"), [(0.2, True), (0.0, False), (1.5, True)])
def test_a_constant_torque_is_in_the_draft(tmp_path: Path, share: float, drafted_load: bool) -> None:
    offset = share * COULOMB_N_M
    shifted = AXIS | {"torque": AXIS["torque"] + offset}
    columns = renamed(shifted, t="time_s", angle="motor_angle_rad", torque="torque_Nm")
    import_(write(tmp_path / "log.csv", columns), None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    bench = load_bench(tmp_path / "axis.yaml")
    assert [entry.effect for entry in bench.mechanisms] == ["constant_load"] * drafted_load
    if drafted_load:
        assert bench.mechanisms[0].parameters["load_torque_n_m"] == pytest.approx(offset, rel=0.1)
