"""An axis whose inertia changes while it is recorded, from the file to the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import INERTIA_KG_M2, axis, renamed, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.diagnose import diagnose
from hil.recording.recording import read_recording
from hil.report.diagnosis_report import write_diagnosis


def assert_change_is_told(folder: Path, at: int) -> None:
    """Diagnose a motion in closed form whose load is put on in row `at` of 12000; the last third is held out."""
    columns = axis(12000, inertia_kg_m2=np.where(np.arange(12000) < at, 1.0, 1.6) * INERTIA_KG_M2)
    path = write(folder / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    import_(path, None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    recording, bench = read_recording(folder / "log.parquet"), load_bench(folder / "axis.yaml")
    found = diagnose([recording], [], bench, budget_s=1000.0)  # whatever the speed of the machine
    result = found.result
    assert result.verdict == "axis_changed"
    assert result.change is not None
    assert result.statement.startswith(f"The axis changed at {result.change.moment_s:.2f} s of log: ")
    assert result.unexplained.share < 0.01
    assert not result.parameter_corrections  # none holds throughout
    write_diagnosis(found, folder)
    assert (folder / "change.png").is_file()
    panels = found.plot("change").axes
    assert len(panels) == len(found.reported.judged.change.runs)
    one_set, of_each_part = (np.concatenate([panel.lines[at].get_ydata() for panel in panels]) for at in (0, 1))
    assert np.nanstd(of_each_part) < 0.2 * np.std(one_set)
    assert all("[N m]" in panel.get_ylabel() for panel in panels)
    assert result.location is not None
    assert sum(phase.share for phase in result.location.phases) == pytest.approx(1.0)  # also if it is held out
    assert result.change.moment_s == pytest.approx(1e-3 * at, abs=0.1)
    before, after = next(one.values for one in result.change.parameters if one.name == "inertia_kg_m2")
    assert after.value / before.value == pytest.approx(1.6, rel=0.02)
