"""The pulse after a reversal: made for friction before sliding, measured on axes of other equations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from compensated_benches import there_and_back

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.compensating.compensate import Plan, plan_compensation, section_of
from hil.compensating.prediction import predict
from hil.compensating.shapes import PULSE
from hil.control.compensation_tables import Over
from hil.twin.steady_motion import torque_after_reversal

FADE_S = 0.3
SOFT = {"presliding_hysteresis": {"stiffness_n_m_rad": 60.0}}


def bench_with(effects: dict[str, dict[str, float]], **sections: object) -> Bench:
    """The reference bench, whose owner knows the effects that its simulated axis has."""
    entries = [{"effect": name, "parameters": values} for name, values in effects.items()]
    data = load_bench("reference").model_dump(mode="json")
    return Bench.model_validate(data | {"mechanisms": entries, "simulation": {"effects": entries}} | sections)


@pytest.fixture(scope="module")
def soft() -> Plan:
    bench = bench_with(SOFT)
    return plan_compensation(bench, there_and_back(bench, 0.1, 0.1), None, FADE_S)


def following(run: hil.Recording, ratio: float) -> float:
    """Following error after the fade-in, rms [m]."""
    first = round(FADE_S * 1e3)
    error = (run["position_command_m"] - ratio * run["motor_position_rad"])[first:]
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize(("to_m", "feed_m_s", "rest_s"), [(0.063, 0.02, 0.3), (0.05, 0.04, 0.01)])
def test_the_pulse_helps_on_motions_that_it_was_not_made_on(
    soft: Plan, to_m: float, feed_m_s: float, rest_s: float, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = section_of(soft, Path("bench.diagnosed.yaml"), "2026-01-31")
    without = whole | {"entries": [entry for entry in whole["entries"] if entry["name"] != PULSE]}
    assert len(without["entries"]) == len(whole["entries"]) - 1
    errors = []
    for section in (without, whole):
        bench = bench_with(SOFT, compensation=section)
        motion = there_and_back(bench, to_m, feed_m_s, rest_s)
        errors.append(following(hil.simulate(bench, motion, seed=5), bench.axis.ratio_m_rad))
    with capsys.disabled():
        print(
            "\nfollowing error without the pulse {:.3f}, with it {:.3f} µm rms".format(*(1e6 * one for one in errors))
        )
    assert errors[1] < 0.9 * errors[0]


def test_it_names_its_source(soft: Plan) -> None:
    assert soft.derived.sources[PULSE] == ("presliding_hysteresis",)
    (table,) = (one for one in soft.compensation.tables if one.name == PULSE)
    assert table.over is Over.REVERSAL_WAY
    assert table.forward[-1] == table.backward[-1] == 0.0
    np.testing.assert_allclose(table.forward, -table.backward, atol=0.02 * np.abs(table.forward).max())


def test_the_torque_after_a_reversal_is_that_of_the_friction_law() -> None:
    """Bristles of stiffness k that bend by z take F(1 - 2 exp(-k x / F)) on the way x, F the Coulomb friction."""
    twin, angle = bench_with(SOFT).twin(), load_bench("reference").axis.ratio_m_rad
    friction = load_bench("reference").axis.coulomb_torque_n_m
    way = np.geomspace(5e-6, 2e-4, 12)
    for direction in (1.0, -1.0):
        missing = torque_after_reversal(twin, 0.1, direction, way)
        expected = -direction * 2.0 * friction * np.exp(-60.0 * way / angle / friction)
        np.testing.assert_allclose(missing, expected, atol=0.05 * friction)


@pytest.mark.parametrize(
    "effects", [{}, {"stribeck_friction": {"static_torque_n_m": 1.8, "stribeck_velocity_rad_s": 1.5}}]
)
def test_an_axis_that_slides_at_once_gets_no_pulse(effects: dict[str, dict[str, float]]) -> None:
    bench = bench_with(effects)
    made = plan_compensation(bench, there_and_back(bench, 0.1, 0.1), None, FADE_S)
    assert PULSE not in {one.name for one in made.compensation.tables}


@pytest.mark.parametrize(
    ("stiffness", "why"), [(600.0, "its pulse after a reversal"), (6000.0, "or no table follows it")]
)
def test_bristles_too_stiff_for_a_pulse_are_told(stiffness: float, why: str) -> None:
    bench = bench_with({"presliding_hysteresis": {"stiffness_n_m_rad": stiffness}})
    made = plan_compensation(bench, there_and_back(bench, 0.1, 0.1), None, FADE_S)
    assert PULSE not in {one.name for one in made.compensation.tables}
    assert why in dict(made.derived.left_out)["presliding_hysteresis"]


@pytest.mark.parametrize("gain_1_s", [0.0, 5000.0, 1e5])
def test_without_a_position_loop_or_with_an_unstable_one_there_is_no_pulse(gain_1_s: float) -> None:
    twin = bench_with(SOFT).twin()
    moved = replace(twin, gains=twin.gains._replace(position_gain_1_s=gain_1_s))
    assert not torque_after_reversal(moved, 0.1, 1.0, np.geomspace(1e-6, 1e-4, 9)).any()


@pytest.mark.parametrize("gain_1_s", [2.0, 80.0, 150.0])
def test_the_pulse_does_not_depend_on_the_gain_of_the_position_loop(gain_1_s: float) -> None:
    twin, way = bench_with(SOFT).twin(), np.geomspace(5e-6, 2e-4, 12)
    other = replace(twin, gains=twin.gains._replace(position_gain_1_s=gain_1_s))
    expected, found = (torque_after_reversal(one, 0.1, 1.0, way) for one in (twin, other))
    np.testing.assert_allclose(found, expected, atol=0.02)


@pytest.mark.parametrize(("to_m", "feed_m_s"), [(1e-5, 1e-4), (3e-6, 5e-5), (5e-4, 1e-4)])
def test_strokes_within_the_bristles_and_creep_get_no_whole_pulse(soft: Plan, to_m: float, feed_m_s: float) -> None:
    bench = bench_with(SOFT)
    motion = there_and_back(bench, to_m, feed_m_s, 0.1)
    without = tuple(one for one in soft.compensation.tables if one.name != PULSE)
    errors = [
        predict(bench, motion, replace(soft.compensation, tables=tables), FADE_S).following_m
        for tables in (without, soft.compensation.tables)
    ]
    assert errors[1] < 1.05 * errors[0]
