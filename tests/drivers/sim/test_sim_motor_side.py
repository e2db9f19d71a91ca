"""Effects on the motor side and at the table: one decisive physical fact each."""

from __future__ import annotations

import numpy as np
import pytest
from sim_tools import outer_force_n, plant_with

from drivers.port import DriverError
from drivers.sim.axis import two_mass
from drivers.sim.effects import Effect

R = 0.01 / (2 * np.pi)
AXIS = two_mass()
FRICTIONLESS = two_mass(coulomb_torque_n_m=0.0, viscous_torque_n_m_s_rad=0.0)


def friction_n_m(effect: Effect, velocity_rad_s: float, position_m: float = 0.0, after_s: float = 0.0) -> float:
    """Torque of all friction at this speed, from the loss of momentum."""
    plant = plant_with(AXIS, effect)
    if after_s:
        plant.advance(0.0, after_s)
    return -outer_force_n(plant, velocity_rad_s * R, position_m=position_m) * R


def test_asymmetric_friction_shifts_friction_and_stiction() -> None:
    effect = Effect("asymmetric_friction", {"offset_torque_n_m": 0.2})
    assert friction_n_m(effect, 10.0) == pytest.approx(1.1 + 0.064 + 0.2, rel=1e-9)
    assert friction_n_m(effect, -10.0) == pytest.approx(-1.1 - 0.064 + 0.2, rel=1e-9)
    plant = plant_with(AXIS, effect)
    for held in (0.0, 1.299, -0.899):
        plant.advance(held, 0.1)
        assert plant.motor_true_rad == 0.0
    plant.advance(-0.92, 0.1)
    assert plant.motor_true_rad < 0.0


def test_constant_load_pulls_at_standstill_too() -> None:
    load = Effect("constant_load", {"load_torque_n_m": 0.8})
    assert friction_n_m(load, 10.0) == pytest.approx(1.1 + 0.064 + 0.8, rel=1e-9)
    plant = plant_with(AXIS, load)
    plant.advance(-0.29, 0.1)
    assert plant.motor_true_rad == 0.0
    plant.advance(-0.31, 0.1)
    assert plant.motor_true_rad < 0.0


@pytest.mark.parametrize(("form", "share"), [("gaussian", np.exp(-1)), ("exponential", np.exp(-1)), ("atan", 0.5)])
def test_stribeck_friction_falls_from_the_static_torque(form: str, share: float) -> None:
    parameters = {"static_torque_n_m": 1.7, "stribeck_velocity_rad_s": 3.0}
    effect = Effect("stribeck_friction", parameters, form)
    plant = plant_with(AXIS, effect)
    plant.advance(1.699, 0.5)
    assert plant.motor_true_rad == 0.0
    plant.advance(1.701, 0.5)
    assert plant.motor_true_rad > 0.01  # runs away: friction fell
    assert friction_n_m(effect, 3.0) == pytest.approx(1.1 + 0.6 * share + 0.0064 * 3, rel=1e-9)


@pytest.mark.parametrize("form", ["dahl", "lugre", "gms"])
def test_presliding_is_elastic_at_first_hysteretic_then_yields(form: str) -> None:
    stiffness = 2000.0
    plant = plant_with(AXIS, Effect("presliding_hysteresis", {"stiffness_n_m_rad": stiffness}, form))

    def ramp(start: float, end: float) -> float:
        for torque in np.linspace(start, end, 400):
            plant.advance(torque, 1e-3)
        return plant.motor_true_rad

    assert ramp(0.0, 0.02) == pytest.approx(0.02 / stiffness, rel=0.05)
    ramp(0.02, 0.9)
    left = ramp(0.9, 0.0)
    assert 0.05 * 0.9 / stiffness < left < 5 * 0.9 / stiffness  # set behind, but a micro-motion
    ramp(0.0, 1.2)
    plant.advance(1.2, 0.5)
    assert plant.motor_true_rad > 50 * 0.9 / stiffness  # slides


def test_presliding_follows_the_dahl_curve() -> None:
    """x = -(F / sigma) ln(1 - T / F) when first loaded."""
    plant = plant_with(AXIS, Effect("presliding_hysteresis", {"stiffness_n_m_rad": 2000.0}))
    for torque in np.linspace(0.0, 0.8, 1000):
        plant.advance(torque, 1e-3)
    assert plant.motor_true_rad == pytest.approx(-1.1 / 2000 * np.log(1 - 0.8 / 1.1), rel=0.01)


def test_position_dependent_friction_varies_along_the_travel() -> None:
    effect = Effect("position_dependent_friction", {"fraction": 0.3, "period_m": 0.04, "phase_rad": 0.5})
    for x in (0.0, 0.013, 0.031):
        expected = 1.1 * (1 + 0.3 * np.sin(2 * np.pi * x / 0.04 + 0.5)) + 0.064
        assert friction_n_m(effect, 10.0, x) == pytest.approx(expected, rel=1e-6)


def test_a_friction_gradient_is_straight_along_the_travel() -> None:
    for x in (0.0, 0.1, -0.2):
        expected = 1.1 * (1.0 + 2.0 * x) + 0.064
        assert friction_n_m(Effect("friction_gradient", {"slope_1_m": 2.0}), 10.0, x) == pytest.approx(expected)


def test_local_friction_is_a_zone_with_straight_flanks() -> None:
    effect = Effect("local_friction", {"fraction": 0.4, "begin_m": 0.1, "end_m": 0.2, "flank_m": 0.02})
    for x, share in ((0.0, 0.0), (0.09, 0.0), (0.1, 0.5), (0.105, 0.75), (0.15, 1.0), (0.2, 0.5), (0.3, 0.0)):
        assert friction_n_m(effect, 10.0, x) == pytest.approx(1.1 * (1.0 + 0.4 * share) + 0.064)


@pytest.mark.parametrize(("torque_n_m", "way"), [(3.49, 0), (3.51, 1), (0.51, 0), (0.49, -1)])
def test_load_dependent_friction_holds_a_weight_the_better_the_more_torque_it_takes(
    torque_n_m: float, way: int
) -> None:
    """T - 2 = +-(1.1 + 0.2 * 2) at the limits."""
    load = Effect("constant_load", {"load_torque_n_m": 2.0})
    plant = plant_with(AXIS, load, Effect("load_dependent_friction", {"share": 0.2}))
    plant.advance(torque_n_m, 0.2)
    assert (abs(plant.motor_true_rad) > 1e-4) is (way != 0)  # the torque rises within the first step
    assert way == 0 or np.sign(plant.motor_true_rad) == way


def test_nonlinear_viscous_friction_is_odd_and_quadratic() -> None:
    effect = Effect("nonlinear_viscous_friction", {"quadratic_n_m_s2_rad2": 1e-5})
    for speed in (200.0, -200.0):
        expected = np.sign(speed) * (1.1 + 0.0064 * 200 + 1e-5 * 200**2)
        assert friction_n_m(effect, speed) == pytest.approx(expected, rel=1e-9)


def test_friction_drift_scales_all_friction_with_time() -> None:
    effect = Effect("friction_drift", {"fraction": -0.4, "time_constant_s": 2.0})
    cold = 1.1 + 0.064
    assert friction_n_m(effect, 10.0) == pytest.approx(cold, rel=1e-4)
    assert friction_n_m(effect, 10.0, after_s=2.0) == pytest.approx(cold * (1 - 0.4 * (1 - np.exp(-1))), rel=1e-4)


def test_a_viscous_drift_leaves_coulomb_friction_as_it_is() -> None:
    effect = Effect("friction_drift", {"fraction": -0.4, "time_constant_s": 2.0}, "viscous")
    warm = 1.1 + 0.064 * (1 - 0.4 * (1 - np.exp(-1)))
    assert friction_n_m(effect, 10.0, after_s=2.0) == pytest.approx(warm, rel=1e-4)


def test_table_side_friction_acts_behind_the_spring() -> None:
    """All friction on the table: the motor winds up the spring by T / (r k), the table does not stir."""
    plant = plant_with(AXIS, Effect("table_side_friction", {"share": 1.0}))
    plant.advance(0.5, 2.0)  # a step: the spring swings up to twice this
    assert plant.table_true_m == 0.0
    assert plant.positions_m[0] == pytest.approx(0.5 / R / 5.64e7, rel=1e-6)
    half = plant_with(AXIS, Effect("table_side_friction", {"share": 0.5}))
    half.advance(0.549, 1.0)
    assert half.motor_true_rad == 0.0
    assert friction_n_m(Effect("table_side_friction", {"share": 0.5}), 10.0) == pytest.approx(1.164, rel=1e-9)


@pytest.mark.parametrize(
    ("coulomb", "more", "viscous"), [(0.0, 0.6, 0.6), (0.5, 0.4, 0.7), (0.5, -0.4, 0.3), (0.5, -1.0, 0.0)]
)
def test_viscous_friction_on_the_table_has_a_share_of_its_own(coulomb: float, more: float, viscous: float) -> None:
    """At a steady speed the spring holds what acts on the table; the friction of the axis is what it was."""
    effects = [
        Effect("table_side_friction", {"share": coulomb}),
        Effect("table_side_viscous_friction", {"share": more}),
    ]
    warm = {"fraction": 0.5, "time_constant_s": 1e-3}
    drifts = (Effect("friction_drift", warm), 1.5, 1.5), (Effect("friction_drift", warm, "viscous"), 1.0, 1.5)
    for drift, scale, thicker in ((None, 1.0, 1.0), *drifts):
        plant = plant_with(AXIS, *effects, *([drift] if drift else []))
        plant.advance(scale * 1.1 + thicker * 0.64, 0.01)
        plant.velocities_m_s[:] = 100.0 * R
        plant.advance(scale * 1.1 + thicker * 0.64, 0.5)
        held = (scale * 1.1 * coulomb + thicker * 0.64 * viscous) / R
        assert plant.velocities_m_s[0] == pytest.approx(100.0 * R, rel=1e-3)
        assert (plant.positions_m[0] - plant.positions_m[1]) * 5.64e7 == pytest.approx(held, rel=1e-2, abs=1.0)


def test_cogging_torque_is_locked_to_the_angle_and_unseen_by_the_current() -> None:
    cogging = Effect("cogging_torque", dict(amplitude_n_m=0.2, cycles_per_rev=12, phase_rad=0.3))
    plant = plant_with(FRICTIONLESS, cogging)
    for angle in (0.0, 0.7, 2.0):
        torque = outer_force_n(plant, torque_n_m=1.0, position_m=angle * R) * R
        assert torque == pytest.approx(1.0 + 0.2 * np.sin(12 * angle + 0.3), rel=1e-9)
        assert plant.torque_n_m == 1.0


def test_external_force_acts_within_its_window_only() -> None:
    plant = plant_with(FRICTIONLESS, Effect("external_force", dict(force_n=-150.0, start_s=0.01, end_s=0.02)))
    forces = {}
    for time_ms in (5, 15, 25):
        plant.advance(0.0, time_ms * 1e-3 - plant.time_s)
        forces[time_ms] = outer_force_n(plant)
        plant.advance(0.0, 8e-5)
        plant.positions_m[:] = plant.velocities_m_s[:] = 0.0
    assert forces == pytest.approx({5: 0.0, 15: -150.0, 25: 0.0}, abs=1e-6)


def test_spring_load_pulls_the_table_to_its_rest_position() -> None:
    plant = plant_with(FRICTIONLESS, Effect("spring_load", {"stiffness_n_m": 2000.0, "rest_position_m": 0.02}))
    assert outer_force_n(plant, position_m=0.05) == pytest.approx(-2000.0 * 0.03, rel=1e-9)


@pytest.mark.parametrize(("form", "free_m", "pressed_m"), [("upper end", 0.0, 0.05), ("lower end", 0.05, -0.02)])
def test_an_end_stop_pushes_the_table_back_on_one_side(form: str, free_m: float, pressed_m: float) -> None:
    plant = plant_with(FRICTIONLESS, Effect("end_stop", {"stiffness_n_m": 2000.0, "edge_m": 0.02}, form))
    assert outer_force_n(plant, position_m=pressed_m) == pytest.approx(-2000.0 * (pressed_m - 0.02), rel=1e-9)
    plant = plant_with(FRICTIONLESS, Effect("end_stop", {"stiffness_n_m": 2000.0, "edge_m": 0.02}, form))
    assert outer_force_n(plant, position_m=free_m) == 0.0


def test_periodic_force_is_a_sine_of_time() -> None:
    shake = Effect("periodic_force", {"force_n": 40.0, "frequency_hz": 7.0, "phase_rad": 0.3})
    plant = plant_with(FRICTIONLESS, shake)
    for _ in range(5):
        force, time_s = outer_force_n(plant), plant.time_s - plant.step_s
        assert force == pytest.approx(40.0 * np.sin(2 * np.pi * 7.0 * time_s + 0.3), rel=1e-6, abs=1e-6)


def test_gravity_turns_the_load_towards_straight_down() -> None:
    plant = plant_with(FRICTIONLESS, Effect("gravity_torque", {"gravity_torque_n_m": 40.0, "angle_rad": np.pi / 6}))
    assert outer_force_n(plant, position_m=0.0) == pytest.approx(-20.0, rel=1e-9)


def test_friction_effects_combine() -> None:
    """Stribeck, position and offset at once: [Fc + (Fs - Fc) s] (1 + fraction sin) + offset + viscous."""
    effects = (
        Effect("stribeck_friction", {"static_torque_n_m": 1.7, "stribeck_velocity_rad_s": 5.0}),
        Effect("position_dependent_friction", {"fraction": 0.2, "period_m": 0.04}),
        Effect("asymmetric_friction", {"offset_torque_n_m": 0.1}),
    )
    torque = -outer_force_n(plant_with(AXIS, *effects), 5.0 * R, position_m=0.01) * R
    assert torque == pytest.approx((1.1 + 0.6 * np.exp(-1)) * 1.2 + 0.1 + 0.032, rel=1e-6)


def test_an_axis_whose_position_is_no_number_is_said() -> None:
    plant = plant_with(FRICTIONLESS)
    plant.state["position"][...] = np.nan
    with pytest.raises(DriverError, match="the simulated axis is unstable: its position is no number"):
        plant.advance(0.0, 1e-3)
