"""Recordings of one axis before and after a change: the parameters that differ are said."""

from __future__ import annotations

import re
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

OWNER = bench()


def rough(factor: float) -> Bench:
    friction = OWNER.axis.coulomb_torque_n_m  # type: ignore[union-attr]
    return OWNER.model_copy(
        update={"axis": OWNER.axis.model_copy(update={"coulomb_torque_n_m": factor * friction})}  # type: ignore[arg-type]
    )


def said(*benches: Bench, terms: tuple[Term, ...] = ()) -> str:
    runs = [take(recorded(one, *terms, seed=k, name=f"run {k}"), OWNER) for k, one in enumerate(benches)]
    nominal = fit_nominal_parameters(dataset(runs, OWNER))
    return changed(nominal, nominal.data.over([]))


def test_a_parameter_that_differs_between_recordings_is_said() -> None:
    text = said(rough(1.3), OWNER)
    assert "coulomb_torque_n_m" in text
    assert "in run 0" in text
    assert "mass" not in text


def test_alike_recordings_and_those_that_are_not_explained_alone_say_nothing() -> None:
    assert not said(OWNER, OWNER)
    assert not said(OWNER)
    assert not said(rough(1.3), OWNER, terms=(Term("cogging_torque", 0, (0.3, 6.0, 0.2)),))


@pytest.mark.parametrize("second", [False, True])
def test_the_moment_at_which_the_inertia_changes_is_said(tmp_path: Path, second: bool) -> None:
    """Torque of a motion in closed form: a load is put on in the training part, or in the part that is held out."""
    at = 9000 if second else 4000
    columns = axis(12000, inertia_kg_m2=np.where(np.arange(12000) < at, 1.0, 1.6) * INERTIA_KG_M2)
    path = write(tmp_path / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    import_(path, None, tmp_path / "log.parquet", None, None)
    identify(tmp_path / "log.parquet", tmp_path / "axis.yaml")
    result = diagnose([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml")).result
    assert result.verdict == "unexplained"
    assert "the axis changed there" in result.statement
    assert result.location is not None
    assert sum(phase.share for phase in result.location.phases) == pytest.approx(1.0)  # also if it is held out
    moment_s = float(re.search(r"change at ([\d.]+) s", result.statement)[1])  # type: ignore[index]
    assert moment_s == pytest.approx(1e-3 * at, abs=0.1)
    before, after = re.findall(r"inertia_kg_m2 (\S+) \S+ \S+ before, (\S+)", result.statement)[0]
    assert float(after) / float(before) == pytest.approx(1.6, rel=0.02)
