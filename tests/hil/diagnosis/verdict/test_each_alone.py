"""Recordings of one axis before and after a change: the parameters that differ are said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, recorded
from foreign_axis import INERTIA_KG_M2, axis, renamed, write

from hil.bench.bench_file import Bench, load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.verdict.each_alone import changed
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.recording.recording import read_recording
from hil.report.diagnosis_report import write_diagnosis

OWNER = bench()


def rough(factor: float) -> Bench:
    friction = OWNER.axis.coulomb_torque_n_m  # type: ignore[union-attr]
    return OWNER.model_copy(
        update={"axis": OWNER.axis.model_copy(update={"coulomb_torque_n_m": factor * friction})}  # type: ignore[arg-type]
    )


def differing(*benches: Bench, terms: tuple[Term, ...] = ()) -> dict[str, tuple[float, ...]]:
    runs = [take(recorded(one, *terms, seed=k, name=f"run {k}"), OWNER) for k, one in enumerate(benches)]
    nominal = fit_nominal_parameters(dataset(runs, OWNER))
    found = changed(nominal, nominal.data.over([]))
    return {one.name: tuple(value.value for value in one.values) for one in found.told.parameters} if found else {}


def test_a_parameter_that_differs_between_recordings_is_said() -> None:
    first, second = differing(rough(1.3), OWNER)["coulomb_torque_n_m"]
    assert first / second == pytest.approx(1.3, rel=0.02)
    assert "table_mass_kg" not in differing(rough(1.3), OWNER)


def test_alike_recordings_and_those_that_are_not_explained_alone_say_nothing() -> None:
    assert not differing(OWNER, OWNER)
    assert not differing(OWNER)
    assert not differing(rough(1.3), OWNER, terms=(Term("cogging_torque", 0, (0.3, 6.0, 0.2)),))


@pytest.mark.parametrize("second", [False, pytest.param(True, marks=pytest.mark.long)])
def test_the_moment_at_which_the_inertia_changes_is_said(tmp_path: Path, second: bool) -> None:
    """Torque of a motion in closed form: a load is put on in the training part, or in the part that is held out."""
    at = 9000 if second else 4000
    columns = axis(12000, inertia_kg_m2=np.where(np.arange(12000) < at, 1.0, 1.6) * INERTIA_KG_M2)
    path = write(tmp_path / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    import_(path, None, tmp_path / "log.parquet", None, None)
    identify(tmp_path / "log.parquet", tmp_path / "axis.yaml")
    found = diagnose([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    result = found.result
    assert result.verdict == "axis_changed"
    assert result.change is not None
    assert result.statement.startswith(f"The axis changed at {result.change.moment_s:.2f} s of log (")
    assert result.unexplained.share < 0.01
    assert not result.parameter_corrections  # none holds throughout
    write_diagnosis(found, tmp_path)
    assert (tmp_path / "change.png").stat().st_size > 10_000
    assert result.location is not None
    assert sum(phase.share for phase in result.location.phases) == pytest.approx(1.0)  # also if it is held out
    assert result.change.moment_s == pytest.approx(1e-3 * at, abs=0.1)
    before, after = next(one.values for one in result.change.parameters if one.name == "inertia_kg_m2")
    assert after.value / before.value == pytest.approx(1.6, rel=0.02)
