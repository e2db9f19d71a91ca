"""The comparison finds nothing where twin and axis are the same, and puts a mismatch into the block it is in."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from compare_runs import bench_with, record

from hil.bench.bench_file import Bench, load_bench
from hil.bench.control_section import without_law
from hil.errors import InputError
from hil.identification.compare import Comparison, compare
from hil.identification.measured import bench_of, take
from hil.identification.twin_deviation import low_pass
from hil.recording.recording import Recording
from hil.report.compare_report import parameter_rows, rows_of, write_comparison


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Recording]:
    """A run of the reference axis, which is as its twin believes."""
    return record(tmp_path_factory.mktemp("run"), bench_with())


@pytest.fixture(scope="module")
def clean(run: Recording) -> Comparison:
    """Its comparison."""
    return compare(run, bench_of(run))


def block_rms(result: Comparison) -> dict[str, float]:
    return {block.deviation.name: block.deviation.rms for block in result.blocks}


def test_an_axis_as_believed_leaves_noise(clean: Comparison) -> None:
    assert clean.explained
    assert 0.9 < clean.torque_over_noise < 1.1
    assert clean.channel("table_position_m").rms < 0.3e-6
    assert clean.channel("motor_position").rms < 0.1e-6
    assert clean.channel("acceleration_m_s2").relative < 0.05
    assert clean.channel("following_error_m").rms == pytest.approx(clean.channel("table_position_m").rms)
    assert block_rms(clean)["controller"] < 1e-9


@pytest.mark.parametrize("mode", ["csv", "csp"])
def test_loops_in_the_drive_are_those_of_the_twin(tmp_path: Path, mode: str) -> None:
    data = bench_with().model_dump()
    data["drive"]["mode"] = mode
    result = compare(record(tmp_path, Bench.model_validate(data)), Bench.model_validate(data))
    assert result.explained
    assert result.torque_over_noise < 1.0
    assert result.channel("following_error_m").rms < 1.0e-6
    assert any(f"In {mode} the drive closes its own control loops" in note for note in result.notes)


@pytest.mark.parametrize(
    ("effect", "parameters", "block"),
    [
        ("current_loop_lag", {"time_constant_s": 0.001}, "drive"),
        ("constant_load", {"load_torque_n_m": 0.5}, "motor and load"),
        ("periodic_lead_error", {"amplitude_m": 5e-6, "phase_rad": 0.5}, "transmission and table"),
    ],
)
def test_a_concealed_effect_shows_in_its_block(
    tmp_path: Path, clean: Comparison, effect: str, parameters: dict[str, float], block: str
) -> None:
    recording = record(tmp_path, bench_with({"effects": [{"effect": effect, "parameters": parameters}]}))
    result = compare(recording, bench_of(recording))
    assert not result.explained
    grown = {name: rms / block_rms(clean)[name] for name, rms in block_rms(result).items() if name != "controller"}
    assert max(grown, key=lambda name: grown[name]) == block
    assert grown[block] > 3.0
    assert block_rms(result)["controller"] < 1e-9


def test_another_gain_shows_in_the_controller_only(run: Recording, clean: Comparison) -> None:
    bench = bench_of(run)
    law = bench.control.model_copy(update={"velocity_gain_ma_rpm": 22.0})
    result = compare(run, bench.model_copy(update={"control": law}))
    assert block_rms(result)["controller"] > 0.05
    for name in ("drive", "motor and load", "transmission and table"):
        assert block_rms(result)[name] == pytest.approx(block_rms(clean)[name], rel=1e-6)


def test_the_fit_finds_the_true_parameters(tmp_path: Path) -> None:
    true = {
        "motor_mass_kg": 300.0,
        "table_mass_kg": 420.0,
        "stiffness_n_m": 5e7,
        "coulomb_torque_n_m": 0.9,
        "viscous_torque_n_m_s_rad": 0.008,
    }
    recording = record(tmp_path, bench_with({"axis": true}))
    bench = bench_of(recording)
    assert compare(recording, bench).torque_over_noise > 5.0
    result = compare(recording, bench, fit=True)
    assert result.explained
    assert result.fit is not None
    found = {parameter.name: parameter for parameter in result.fit.parameters}
    for name, value in true.items():
        assert found[name].value == pytest.approx(value, rel=0.02)
        assert abs(found[name].value - value) < 6.0 * found[name].standard_error + 2e-3 * value


@pytest.mark.parametrize("cut", [1, 2, 3, 450])
def test_a_recording_may_begin_anywhere(run: Recording, cut: int) -> None:
    """The ticks of the position loop are found, and a start in motion is the right one after it has settled."""
    columns = {name: values[cut:] for name, values in run.columns.items()}
    later = replace(run, columns=columns)
    bench = bench_of(run)
    assert len(later) - take(later, bench).motor.size == -cut % 4
    result = compare(later, bench)
    assert result.channel("table_position_m").rms < 1e-6
    assert result.torque_over_noise < 1.3


def test_velocity_is_low_passed_without_delay() -> None:
    time_s = np.arange(4000) * 1e-3
    slow, fast = np.sin(2 * np.pi * 5 * time_s), np.sin(2 * np.pi * 400 * time_s)
    assert np.allclose(low_pass(slow + fast, 1e-3)[200:-200], slow[200:-200], atol=1e-3)


def _without(run: Recording, channel: str) -> Recording:
    return replace(run, columns={name: values for name, values in run.columns.items() if name != channel})


def test_what_does_not_belong_together_is_refused(run: Recording) -> None:
    bench = bench_of(run)
    with pytest.raises(InputError, match=r"table_position_m is not recorded.*'table: null'"):
        compare(_without(run, "table_position_m"), bench)
    with pytest.raises(InputError, match="rotary axis, allowed a linear one, as in the bench emps"):
        compare(run, load_bench("emps"))
    with pytest.raises(InputError, match=r"given a period of 0\.002 s, allowed velocity_period_s"):
        compare(replace(run, period_s=0.002), bench)
    with pytest.raises(InputError, match="given 100 rows, allowed"):
        compare(replace(run, columns={name: values[:100] for name, values in run.columns.items()}), bench)
    with pytest.raises(InputError, match="no bench is recorded"):
        bench_of(replace(run, metadata={}))


def test_without_a_table_encoder_the_motor_is_compared(run: Recording) -> None:
    bench = bench_of(run)
    blind = bench.model_copy(update={"encoders": bench.encoders.model_copy(update={"table": None})})
    result = compare(_without(run, "table_position_m"), blind)
    assert result.explained
    assert "transmission and table" not in block_rms(result)
    assert result.channels[0].name == "motor_position_m"


@pytest.mark.parametrize("limit_n_m", [None, 12.0])
def test_an_unstable_twin_is_said_so_with_figures_of_its_blocks(
    run: Recording, tmp_path: Path, limit_n_m: float | None
) -> None:
    """A limit of the torque bounds the loop: it swings."""
    bench = bench_of(run)
    feather = bench.axis.model_copy(update={"motor_mass_kg": 0.5, "table_mass_kg": 0.5})
    law = bench.control.model_copy(update={"torque_limit_n_m": limit_n_m})
    result = compare(run, bench.model_copy(update={"axis": feather, "control": law}))
    assert not result.held
    assert not result.explained
    assert "in closed loop the twin is unstable" in result.statement
    assert "in closed loop the twin is unstable" in repr(result)
    write_comparison(result, tmp_path)
    numbers = json.loads((tmp_path / "compare.json").read_text())  # refuses NaN and infinity
    assert numbers["channels"] == {}
    assert not numbers["stable_in_closed_loop"]
    assert [name for name, _, _, _ in rows_of(result)] == list(numbers["blocks"])
    assert 0.0 < numbers["blocks"]["motor and load"]["rms"] < 10.0


@pytest.mark.parametrize("fit", [False, True])
def test_without_a_control_law_the_blocks_are_compared(run: Recording, clean: Comparison, fit: bool) -> None:
    bench = bench_of(run)
    unknown = bench.model_copy(update={"control": without_law(bench.known_control)})
    plant = {name: values for name, values in run.columns.items() if "command" not in name}
    result = compare(replace(run, columns=plant), unknown, fit=fit)
    assert not result.channels
    assert "control law is unknown" in result.statement
    assert set(block_rms(result)) == {"motor and load", "transmission and table"}
    assert block_rms(result)["motor and load"] == pytest.approx(block_rms(clean)["motor and load"], rel=0.1)


def test_fitted_values_are_printed_with_those_at_a_bound_marked(tmp_path: Path) -> None:
    """A table five times as heavy as believed: the fit ends at three times."""
    light = bench_with(axis={"table_mass_kg": 384.0 / 5.0})
    result = compare(record(tmp_path, bench_with()), light, fit=True)
    assert result.fit is not None
    rows = {row[0]: row for row in parameter_rows(result.fit)}
    assert rows["table_mass_kg"][3] == "at its bound"
    assert any("table_mass_kg: not identifiable from this motion" in note for note in result.notes)
    assert rows["motor_mass_kg"][3] != "at its bound"


def test_a_fit_that_creeps_gives_its_best_and_says_so(run: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.identification.nominal_fit.MOST_STEPS", 2)
    axis = bench_of(run).axis.model_copy(update={"coulomb_torque_n_m": 1.6, "stiffness_n_m": 3.0e7})
    wrong = bench_of(run).model_copy(update={"axis": axis})
    result = compare(run, wrong, fit=True)
    assert result.fit is not None
    assert not result.fit.converged
    assert any("before it converged" in note for note in result.notes)
    assert result.torque.rms < compare(run, wrong).torque.rms


def test_a_loop_elsewhere_is_not_blamed_on_the_axis(run: Recording) -> None:
    bench = bench_of(run)
    gains = bench.control.model_copy(update={"position_gain_1_s": 1.5 * bench.control.position_gain_1_s})
    result = compare(run, bench.model_copy(update={"control": gains}))
    assert not result.explained
    assert result.statement.startswith("The control loop of the twin differs from the real one")
