"""A change below the noise of a row: from which moment on the axis is another one, by all rows together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import COULOMB_N_M, INERTIA_KG_M2, axis, renamed, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.moment_of_change import SteadyChange
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.result import TREND
from hil.diagnosis.structure_left import TORQUE, structure_left
from hil.explanation import explain
from hil.identification.intended_motion import measured_motion
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.torque_left import fit_plain, needed_torque
from hil.recording.recording import read_recording

ROWS, AT = 9000, 4000
HEAVIER, NOISE_N_M = 1.08, 0.08


def recorded(folder: Path, inertia: np.ndarray, friction_n_m: np.ndarray, load_n_m: np.ndarray | float = 0.0) -> Path:
    columns = axis(ROWS, inertia_kg_m2=inertia)
    columns["torque"] += (friction_n_m - COULOMB_N_M) * np.sign(columns["speed"]) + load_n_m
    columns["torque"] += np.random.default_rng(5).normal(0.0, NOISE_N_M, ROWS)
    return write(folder / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))


@pytest.mark.long
def test_a_load_that_is_put_on_is_told_with_its_moment(tmp_path: Path) -> None:
    heavier = np.where(np.arange(ROWS) < AT, 1.0, HEAVIER) * INERTIA_KG_M2
    found = explain([recorded(tmp_path, heavier, np.full(ROWS, COULOMB_N_M))], tmp_path / "out").diagnosis
    change = found.result.change
    assert found.result.verdict == "axis_changed"
    assert change is not None
    assert change.moment_s == pytest.approx(1e-3 * AT, abs=0.3)
    assert found.result.statement.startswith(f"The axis changed at {change.moment_s:.2f} s of log: inertia ")
    (inertia,) = (one for one in change.parameters if one.name == "inertia_kg_m2")
    assert inertia.values[1].value / inertia.values[0].value == pytest.approx(HEAVIER, abs=0.02)
    found.plot("change")


def test_the_sign_of_a_structure_is_that_of_the_torque_that_the_axis_needs(tmp_path: Path) -> None:
    """More friction in the last quarter: there the torque needed beyond the twin's has the sign of the motion."""
    more = np.where(np.arange(ROWS) < 3 * ROWS // 4, 1.0, 1.5) * COULOMB_N_M
    import_(recorded(tmp_path, np.full(ROWS, INERTIA_KG_M2), more), None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    fit = fit_nominal_parameters(prepared.train)
    plain = fit_plain(fit.data)
    assert plain is not None
    (run,), (left,) = prepared.held_out.runs, needed_torque(fit.hypothesis, prepared.held_out, plain)
    way = measured_motion(run).moved.direction[left.rows]
    assert float(np.mean(left.left[left.rows] * way)) > 0.1 * COULOMB_N_M
    told = [one.in_words("N m") for one in structure_left(fit, prepared.held_out) if one.channel == TORQUE]
    assert any("the Coulomb friction is" in one and "larger than before" in one for one in told)


@pytest.mark.parametrize(("rate", "way"), [(1e-4, "earlier"), (-1e-4, "later")])
def test_a_clock_of_the_torque_that_runs_fast_is_seen(tmp_path: Path, rate: float, way: str) -> None:
    """The torque of a later moment stands in a row: by 2.7 ms more at the end than at the begin."""
    rows = 3 * ROWS
    columns = axis(rows)
    t = columns["t"]
    columns["torque"] = np.interp(t + rate * t, t, columns["torque"])
    columns["torque"] += np.random.default_rng(5).normal(0.0, NOISE_N_M, rows)
    path = write(tmp_path / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    import_(path, None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    left = structure_left(fit_nominal_parameters(prepared.train), prepared.held_out)
    ((clock, words),) = (
        (one.question.change, one.in_words("N m")) for one in left if isinstance(one.question.change, SteadyChange)
    )
    assert clock.rate == pytest.approx(-rate, rel=0.1)
    assert f"the torque is recorded {1e3 * rows * 1e-3 * abs(rate):.1f}"[:-1] in words
    assert f" {way} than at the begin" in words


def test_a_change_of_friction_is_seen_at_one_speed_too(tmp_path: Path) -> None:
    """There the delay of the torque tells nothing and hides nothing; one speed does not tell which friction it is."""
    t = 1e-3 * np.arange(2 * ROWS)
    angle = 20.0 * np.abs(np.mod(t / 2.0, 2.0) - 1.0)
    way = np.sign(np.gradient(angle, 1e-3))
    torque = (COULOMB_N_M + 0.1 * (t >= 9.0)) * way + np.random.default_rng(5).normal(0.0, 0.01, t.size)
    angle += np.random.default_rng(6).normal(0.0, 1e-4, t.size)
    path = write(tmp_path / "log.csv", {"time_s": t, "motor_angle_rad": angle, "torque_Nm": torque})
    import_(path, None, tmp_path / "log.parquet", None, None)
    (tmp_path / "axis.yaml").write_text(
        f"axis: {{model: rotary, gear_ratio: 1, inertia_kg_m2: 1e-3, coulomb_torque_n_m: {COULOMB_N_M}, "
        "viscous_torque_n_m_s_rad: 1e-4}\ncontrol: {law: unknown}\n"
        "encoders: {motor: {counts_per_rev: 65536}, table: null}\n"
    )
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    left = structure_left(fit_nominal_parameters(prepared.train), prepared.held_out)
    told = [one.in_words("N m") for one in left]
    assert any("from 9.0" in one and "friction is" in one and "larger than before" in one for one in told)


@pytest.mark.long
def test_a_weight_that_the_bench_has_not_may_change_at_a_moment(tmp_path: Path) -> None:
    """A weight throughout, and more of it and of the inertia from a moment on: its value in each part is told."""
    after = np.arange(ROWS) >= AT
    columns = axis(ROWS, inertia_kg_m2=np.where(after, 1.3, 1.0) * INERTIA_KG_M2)
    columns["torque"] += np.where(after, 1.3, 0.9) + np.random.default_rng(5).normal(0.0, NOISE_N_M, ROWS)
    path = write(tmp_path / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    found = explain([path], tmp_path / "out").diagnosis
    change = found.result.change
    assert found.result.verdict == "axis_changed"
    assert change is not None
    assert change.moment_s == pytest.approx(1e-3 * AT, abs=0.3)
    load = next(one.values for one in change.parameters if "load_torque" in one.name)
    assert [one.value for one in load] == pytest.approx([0.9, 1.3], abs=0.05)
    assert "already" not in found.result.statement
    (panel, *_) = found.plot("change").axes
    assert abs(float(np.median(panel.lines[0].get_ydata()))) < 0.5


@pytest.mark.long
def test_rows_that_a_logger_lost_are_a_shift_of_the_clocks(tmp_path: Path) -> None:
    """The torque is early by 9 rows from a moment on: nothing of the axis changed."""
    columns = axis(ROWS + 9)
    torque = columns["torque"] + np.random.default_rng(5).normal(0.0, 0.1 * NOISE_N_M, ROWS + 9)
    columns = {name: values[:ROWS] for name, values in columns.items()}
    columns["torque"] = np.concatenate([torque[:AT], torque[AT + 9 :]])
    path = write(tmp_path / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    result = explain([path], tmp_path / "out").diagnosis.result
    assert result.verdict == "axis_changed"
    assert result.change is not None
    assert result.statement.startswith("The clocks of torque and position shifted (rows lost, or a clock that was set)")
    (delay,) = result.change.parameters
    assert delay.values[1].value - delay.values[0].value == pytest.approx(9e-3, abs=5e-4)
    assert result.change.moment_s == pytest.approx(1e-3 * AT, abs=0.3)


@pytest.mark.parametrize(
    ("friction_n_m", "load_n_m", "told"),
    [(0.03, 0.0, "the Coulomb friction grows by"), (0.0, -0.03, "the load falls by"), (0.0, 0.0, "")],
)
def test_what_changes_steadily_is_told_with_its_change(
    friction_n_m: float, load_n_m: float, told: str, tmp_path: Path
) -> None:
    """By less than half of the noise of a row within the recording."""
    share = np.arange(ROWS) / ROWS
    drifting = recorded(
        tmp_path, np.full(ROWS, INERTIA_KG_M2), COULOMB_N_M + friction_n_m * share, load_n_m=load_n_m * share
    )
    import_(drifting, None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    prepared = prepare([read_recording(tmp_path / "log.parquet")], [], load_bench(tmp_path / "axis.yaml"))
    left = structure_left(fit_nominal_parameters(prepared.train), prepared.held_out)
    trends = [(one.question.change, one.in_words("N m")) for one in left if one.question.name == TREND]
    assert len(trends) == bool(told)
    for change, words in trends:
        assert isinstance(change, SteadyChange)
        assert change.rate * change.duration_s == pytest.approx(friction_n_m + load_n_m, rel=0.15)
        assert told in words
