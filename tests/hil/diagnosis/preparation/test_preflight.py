"""Recordings that cannot be diagnosed are refused with the reason; sound ones pass, whatever physics they have."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded
from linear_stage import BENCH as STAGE
from linear_stage import moved
from scipy.signal import savgol_filter

from hil.bench.bench_file import load_bench
from hil.diagnosis.preparation.preflight import _factor_between, preflight, regress
from hil.errors import InputError
from hil.identification.terms import Term
from hil.recording.recording import Recording

OWNER = bench()


@pytest.fixture(scope="module")
def run() -> Recording:
    return recorded(OWNER)


def refused(recording: Recording) -> str:
    with pytest.raises(InputError) as error:
        preflight([recording], OWNER).accepted()
    return str(error.value)


def part(recording: Recording, rows: slice) -> Recording:
    return changed(recording, **{name: values[rows] for name, values in recording.columns.items()})


@pytest.mark.parametrize(
    "terms",
    [
        (),
        (Term("backlash", 0, (50e-6,)),),
        (Term("stribeck_friction", 0, (2.0, 3.0)),),
        (Term("constant_load", 0, (2.0,)),),
        (Term("current_loop_lag", 1, (2e-3,)),),
        (Term("torque_saturation", 0, (3.0,)),),
    ],
)
def test_physics_is_no_reason_to_refuse(terms: tuple[Term, ...]) -> None:
    """With parameters wrong by 30 % beside it."""
    truth = bench(motor_mass_kg=240.0, table_mass_kg=270.0, coulomb_torque_n_m=1.5)
    assert len(preflight([recorded(truth, *terms)], OWNER).accepted()) == 1


def test_the_regression_finds_inertia_and_friction(run: Recording) -> None:
    found = regress(preflight([run], OWNER).accepted()[0], OWNER)
    assert found is not None
    inertia, viscous, coulomb, offset = found.fit.values
    axis = OWNER.axis
    assert inertia == pytest.approx(719.0 * axis.ratio_m_rad**2, rel=0.05)
    assert coulomb == pytest.approx(1.1, rel=0.05)
    assert viscous == pytest.approx(0.0064, rel=0.1)
    assert abs(offset) < 0.02


def test_motion_in_one_direction_tells_no_friction_and_no_unit(run: Recording) -> None:
    """Friction and a load are one value there: a heavy load is no wrong unit of the torque."""
    command = np.linspace(0.0, 0.06, len(run))
    turn = np.round(command / OWNER.axis.ratio_m_rad / 6e-6) * 6e-6
    columns = {
        "position_command_m": command,
        "velocity_command_m_s": np.full(len(run), 0.06 / (len(run) * run.period_s)),
        "motor_position_rad": turn,
        "table_position_m": command + 1e-7 * np.sin(turn),
        "torque_n_m": 8.0 + run["torque_n_m"] - run["torque_command_n_m"],
        "torque_command_n_m": None,
    }
    prepared = preflight([changed(run, **columns)], OWNER).accepted()[0]
    found = regress(prepared, OWNER)
    assert found is not None
    assert found["coulomb"].std_error == math.inf


def test_too_short(run: Recording) -> None:
    assert "too short: given 0.7 s, allowed 0.8 s" in refused(part(run, slice(0, 700)))


def test_no_recording() -> None:
    with pytest.raises(InputError, match="given no recording"):
        preflight([], OWNER).accepted()


def test_without_excitation(run: Recording) -> None:
    still = {name: np.zeros(3000) for name in run.columns} | {"time_s": np.arange(3000) * 1e-3}
    assert "without excitation: the set-points do not move" in refused(changed(run, **still))


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ("motor_position_rad", "motor_position_rad is not recorded"),
        ("torque_n_m", "torque_n_m is not recorded"),
        ("table_position_m", "table_position_m is not recorded, but the bench reference has a linear encoder"),
    ],
)
def test_missing_channel(run: Recording, channel: str, message: str) -> None:
    assert message in refused(changed(run, **{channel: None}))


@pytest.mark.parametrize("channel", ["motor_position_rad", "table_position_m", "torque_n_m"])
def test_frozen_channel(run: Recording, channel: str) -> None:
    assert f"{channel} is frozen" in refused(changed(run, **{channel: np.full(len(run), 0.5)}))


def test_copied_channel(run: Recording) -> None:
    copy = OWNER.axis.ratio_m_rad * run["motor_position_rad"]
    assert "table_position_m is a copy of the motor position" in refused(changed(run, table_position_m=copy))


@pytest.mark.parametrize(
    ("channel", "factor", "message"),
    [
        ("motor_position_rad", -1.0, "motor_position_rad: has the wrong sign"),
        ("motor_position_rad", 180.0 / math.pi, "which suggests degrees"),
        ("motor_position_rad", 0.5 / math.pi, "which suggests revolutions"),
        ("table_position_m", -1.0, "table_position_m: has the wrong sign"),
        ("table_position_m", 1e3, "which suggests mm"),
        ("velocity_command_m_s", 60.0, "which suggests m/min"),
        (
            "torque_command_n_m",
            1e-3,
            "is 1000 × the value expected from torque_command_n_m, which suggests mN m",
        ),
        ("torque_n_m", -1.0, "torque_n_m is opposite to torque_command_n_m"),
    ],
)
def test_wrong_sign_or_unit_of_one_channel(run: Recording, channel: str, factor: float, message: str) -> None:
    assert message in refused(changed(run, **{channel: factor}))


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1e3, "mN m"), (100.0, "N cm"), (1e-3, "kN m"), (2.0 * math.pi * 100.0, "N at the table"), (1.0 / 9.81, "")],
)
def test_wrong_unit_of_the_torque(run: Recording, factor: float, unit: str) -> None:
    message = refused(changed(run, torque_n_m=factor, torque_command_n_m=factor))
    assert "the value expected from the inertia and friction of the bench (N m)" in message
    assert not unit or f"which suggests {unit}" in message


def test_a_negative_mass_is_a_wrong_sign_and_no_result(run: Recording) -> None:
    message = refused(changed(run, torque_n_m=-1.0, torque_command_n_m=-1.0))
    assert "torque_n_m has the wrong sign" in message
    assert "its regression gives a negative inertia" in message


def test_saturation_throughout(run: Recording) -> None:
    limit = np.sign(run["torque_command_n_m"]) * OWNER.gains.torque_limit_n_m
    assert "saturated throughout" in refused(changed(run, torque_command_n_m=limit, torque_n_m=limit))


@pytest.mark.parametrize(("hz", "half_rows"), [(50.0, 10), (12.5, 40)])
def test_a_limit_cycle_is_told_with_its_frequency(run: Recording, hz: float, half_rows: int) -> None:
    limit = OWNER.gains.torque_limit_n_m * np.sign((np.arange(len(run)) // half_rows) % 2 - 0.5)
    message = refused(changed(run, torque_command_n_m=limit, torque_n_m=limit))
    assert f"limit cycle: the control loop oscillates at {hz:g} Hz" in message.replace(".0 Hz", " Hz")
    assert "delay" in message
    assert "slower" not in message


def test_all_reasons_are_given_at_once(run: Recording) -> None:
    message = refused(changed(run, table_position_m=1e3, motor_position_rad=-1.0))
    assert len(message.splitlines()) == 2
    assert "run: motor_position_rad" in message
    assert "run: table_position_m" in message


def test_a_linear_axis_is_not_for_a_rotary_bench(run: Recording) -> None:
    with pytest.raises(InputError, match="give the bench of this axis"):
        preflight([run], load_bench("emps")).accepted()


def test_an_axis_that_lags_on_short_strokes_is_not_taken_for_another_unit() -> None:
    """The motor makes three quarters of each stroke, late."""
    lagging = recorded(OWNER)
    command = lagging["position_command_m"]
    late = np.concatenate([np.full(60, command[0]), command[:-60]])
    factor = _factor_between(command, 0.5 * (command + late) * 0.95)
    assert 0.9 < factor <= 1.0
    assert _factor_between(command, 1e3 * command) == pytest.approx(1e3)
    assert _factor_between(command, -command) == pytest.approx(-1.0)


def test_friction_that_varies_is_no_wrong_sign() -> None:
    """On a slow move the force follows the cogging, not the acceleration; of a wrong sign friction is negative."""
    slow = moved([(0.15, 0.06)])
    preflight([slow], STAGE).accepted()
    turned = replace(slow, columns=slow.columns | {"force_n": -slow.columns["force_n"]})
    with pytest.raises(InputError, match="wrong sign"):
        preflight([turned], STAGE).accepted()


def test_a_negative_inertia_of_one_recording_is_no_wrong_sign_beside_others(run: Recording) -> None:
    """All recordings have one sign; without friction it is that of a disturbance."""
    slowing = -1e-3 * savgol_filter(run["motor_position_rad"], 41, 3, 2, delta=run.period_s)
    slowing += np.random.default_rng(5).normal(0.0, 0.02, slowing.size)
    disturbed = replace(changed(run, torque_n_m=slowing, torque_command_n_m=slowing), name="disturbed")
    assert "wrong sign: its regression gives a negative inertia" in refused(disturbed)
    assert len(preflight([run, disturbed], OWNER).accepted()) == 2
    turned = replace(changed(run, torque_n_m=-1.0, torque_command_n_m=-1.0), name="turned")
    with pytest.raises(InputError, match="turned: torque_n_m has the wrong sign"):
        preflight([run, turned], OWNER).accepted()


def test_a_set_point_that_is_the_angle_of_the_motor_behind_a_gear_is_named() -> None:
    direct = load_bench("rotary")
    geared = direct.model_copy(update={"axis": direct.axis.model_copy(update={"gear_ratio": 80.0})})
    time_s = 1e-3 * np.arange(4000)
    angle, speed = 5.0 * np.sin(3.0 * time_s), 15.0 * np.cos(3.0 * time_s)
    torque = 2e-3 * np.gradient(speed, 1e-3) + 0.1 * np.sign(speed) + 0.002 * speed
    columns = {"motor_position_rad": angle, "torque_n_m": torque, "torque_command_n_m": torque}
    right, wrong = (
        Recording("run", {**columns, "position_command_m": command}, 1e-3, {}) for command in (angle / 80.0, angle)
    )
    assert len(preflight([right], geared).accepted()) == 1
    with pytest.raises(InputError, match="behind a gear of 80; in the import map write so many times"):
        preflight([wrong], geared).accepted()
