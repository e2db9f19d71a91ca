"""hil frf on the simulated axis, whose plant is computed here from its own equations; refusals; command and page."""

from __future__ import annotations

import json
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest
import yaml
from browser import CHROMIUM, NO_CHROMIUM, browser
from command_line import hil as command
from scipy.linalg import expm

import hil

ROOT = Path(__file__).parents[3]
R = 0.010 / (2 * pi)
MOTOR, TABLE, STIFFNESS, DAMPING, VISCOUS = 335.0, 384.0, 5.64e7, 0.03, 0.0064
T = 1e-3


def two_mass_at(hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Held torque to motor [rad/(N m)] and table [m/(N m)] at the ticks: M y'' + C y' + K y = f, y = (r theta, x)."""
    mass = np.diag([MOTOR, TABLE])
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    reduced = MOTOR * TABLE / (MOTOR + TABLE)
    damping = 2 * DAMPING * np.sqrt(STIFFNESS * reduced) * spring + np.diag([VISCOUS / R**2, 0.0])
    system = np.zeros((5, 5))
    system[:2, 2:4] = np.eye(2)
    system[2:4, :2], system[2:4, 2:4] = -np.linalg.inv(mass) @ (STIFFNESS * spring), -np.linalg.inv(mass) @ damping
    system[2, 4] = 1.0 / (MOTOR * R)  # force of 1 N m
    held = expm(system * T)
    z = np.exp(2j * pi * hz * T)
    state = np.array([np.linalg.solve(one * np.eye(4) - held[:4, :4], held[:4, 4]) for one in z])
    return state[:, 0] / R, state[:, 1]


@pytest.fixture(scope="module")
def bench() -> hil.Bench:
    return hil.load_bench("reference")


@pytest.fixture(scope="module")
def recording(bench: hil.Bench) -> hil.Recording:
    data = yaml.safe_load((ROOT / "profiles" / "frequency_response.yaml").read_text())
    profile = hil.Profile.model_validate(data | {"segments": data["segments"][:3]})  # one way: planning takes seconds
    return hil.simulate(bench, hil.plan(profile, bench.period_s), seed=3)


@pytest.fixture(scope="module")
def found(recording: hil.Recording, bench: hil.Bench) -> hil.FrequencyResponse:
    return hil.frf(recording, bench)


@pytest.mark.parametrize(("name", "which"), [("plant_motor", 0), ("plant_table", 1)])
def test_the_plant_is_that_of_the_equations(found: hil.FrequencyResponse, name: str, which: int) -> None:
    curve = found.measured[name].within(found.measured[name].trusted)
    away = np.abs(curve.response - two_mass_at(curve.frequency_hz)[which])
    assert curve.trusted_hz[0] <= 2.0
    assert curve.trusted_hz[1] > 120.0  # beyond the excited band: images of the hold of the position loop
    assert np.mean(away <= curve.radius * curve.std_error) > 0.9
    assert np.median(away / np.abs(curve.response)) < 0.02


def test_the_twin_is_that_of_the_equations(found: hil.FrequencyResponse) -> None:
    for name, expected in zip(
        ("plant_motor", "plant_table"), two_mass_at(found.twin["plant_motor"].frequency_hz), strict=True
    ):
        np.testing.assert_allclose(found.twin[name].response, expected, rtol=1e-6)


def test_loops_and_margins_are_those_of_the_equations(found: hil.FrequencyResponse) -> None:
    """The velocity loop by hand: Kp (1 + T / Ti / (z - 1)) (1 - 1/z) / T times the plant of the equations."""
    hz = np.geomspace(1.0, 400.0, 4000)
    z = np.exp(2j * pi * hz * T)
    gain = 20e-3 * 1.4 * 60 / (2 * pi)
    loop = gain * (1 + T / 6.2e-3 / (z - 1)) * (1 - 1 / z) / T * two_mass_at(hz)[0]
    crossings = np.flatnonzero(np.diff(np.abs(loop) > 1.0))
    phases = np.degrees(np.angle(-loop[crossings]))
    one = found.margins["velocity_open"]
    assert one.crossover_hz == pytest.approx(hz[crossings[np.argmin(np.abs(phases))]], rel=3e-3)
    assert one.phase_deg == pytest.approx(np.abs(phases).min(), abs=0.3)
    assert one.modulus == pytest.approx(np.abs(1 + loop).min(), abs=0.01)
    assert one.delay_s == pytest.approx((np.radians(phases % 360) / (2 * pi * hz[crossings])).min(), rel=0.01)
    for name, margins in found.margins.items():
        twin = found.twin_margins[name]
        assert margins.phase_deg == pytest.approx(twin.phase_deg, abs=0.3)
        assert margins.gain_db == pytest.approx(twin.gain_db, abs=0.8)
    assert found.bandwidth_hz["position_closed"] == pytest.approx(found.twin_bandwidth_hz["position_closed"], rel=0.01)


def test_it_finds_a_table_that_is_heavier_than_the_bench_says(bench: hil.Bench, recording: hil.Recording) -> None:
    wrong = bench.model_copy(update={"axis": bench.axis.model_copy(update={"table_mass_kg": 300.0})})
    found = hil.frf(recording, wrong)
    assert found.resonances.antiresonance_hz == pytest.approx(np.sqrt(STIFFNESS / TABLE) / (2 * pi), rel=0.005)
    assert found.twin_resonances.antiresonance_hz == pytest.approx(np.sqrt(STIFFNESS / 300.0) / (2 * pi), rel=0.005)


def test_a_chirp_on_a_feed_gives_the_plant_too(bench: hil.Bench) -> None:
    data = hil.load_profile(ROOT / "profiles" / "chirp.yaml").model_dump()
    for part in data["segments"]:
        if part["kind"] == "chirp":
            part |= {"end_hz": 110.0, "amplitude_m": 0.0004, "base_feed_m_s": 2.0 * part["base_feed_m_s"]}
    found = hil.frf(hil.simulate(bench, hil.plan(hil.Profile.model_validate(data), T), seed=1), bench)
    curve = found.measured["plant_motor"].within(found.measured["plant_motor"].trusted)
    away = np.abs(curve.response / two_mass_at(curve.frequency_hz)[0] - 1.0)
    assert found.method == "welch"
    assert np.median(away) < 0.03
    assert any("sweep leak" in note for note in found.notes)


def test_an_axis_that_stops_in_the_excitation_is_reported(bench: hil.Bench) -> None:
    profile = hil.load_profile(ROOT / "profiles" / "multisine.yaml")
    found = hil.frf(hil.simulate(bench, hil.plan(profile, T), seed=1), bench)
    assert found.distorted
    assert any("8 of 8 laps" in note for note in found.notes)


def test_recordings_that_cannot_tell_it_are_refused_with_what_to_record(
    bench: hil.Bench, recording: hil.Recording
) -> None:
    rest = {"schema_version": 1, "limits": {"velocity_m_s": 0.4, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0}}
    still = {"kind": "dwell", "duration_s": 1.0}
    move = {"kind": "sine_squared", "to_m": 0.03, "feed_m_s": 0.1}
    no_torque = {
        name: values for name, values in recording.columns.items() if name not in ("torque_n_m", "torque_command_n_m")
    }
    constant = recording.columns | {"torque_n_m": np.ones(len(recording))}
    plans = {name: hil.plan(hil.Profile.model_validate(rest | {"segments": parts}), T) for name, parts in (
        ("still", [still]), ("move", [still, move, still]))}  # fmt: skip
    cases = [
        (hil.simulate(bench, plans["still"]), "rest throughout"),
        (hil.simulate(bench, plans["move"]), "no 8 segments"),
        (replace(recording, columns=no_torque), "torque_n_m is not recorded"),
        (replace(recording, columns=constant), "given a constant"),
    ]
    for wrong, message in cases:
        with pytest.raises(hil.InputError, match=message) as refusal:
            hil.frf(wrong, bench)
        assert "hil run profiles/frequency_response.yaml" in str(refusal.value)


def test_the_command_writes_page_and_numbers(tmp_path: Path, recording: hil.Recording) -> None:
    if CHROMIUM is None:
        pytest.skip(NO_CHROMIUM)
    from hil.recording.recording import write_parquet

    write_parquet(recording, tmp_path / "sweep.parquet")
    ran = command(tmp_path, "frf", "sweep.parquet", "--bench", "reference", "--out", "out")
    assert ran.returncode == 0, ran.stderr
    assert "first antiresonance [Hz]" in ran.stdout
    assert "trustworthy from 1" in ran.stdout
    numbers = json.loads((tmp_path / "out" / "frf.json").read_text())
    curve = numbers["measured"]["responses"]["plant_motor"]
    assert len(curve["frequency_hz"]) == len(curve["real"]) == len(curve["std_error"]) == len(curve["coherence"])
    assert numbers["measured"]["margins"]["position_open"]["phase_deg"] == pytest.approx(86.7, abs=0.3)
    with browser(tmp_path / "browser", f"file://{tmp_path}/out/frf.html") as page:
        for width, dark in ((1000, False), (1000, True), (390, False)):
            page.size(width, 900, dark)
            assert page.run("document.documentElement.scrollWidth") <= width
        page.until("[...document.images].length == 6 && [...document.images].every(one => one.naturalWidth > 600)")
        assert page.errors == []
