"""The catalogue of effects: complete, validated, usable in any subset at once."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sim_tools import motion

from drivers.sim.axis import seven_dof, two_mass
from drivers.sim.effects import CATALOGUE, Effect
from drivers.sim.reality import record
from drivers.sim.sensors import Sensors
from drivers.sim.servo import Servo

# the interface: every id with all parameters it requires, here with a value that shows
SHOWN = {
    "asymmetric_friction": {"offset_torque_n_m": 0.15},
    "constant_load": {"load_torque_n_m": 0.3},
    "stribeck_friction": {"static_torque_n_m": 1.7, "stribeck_velocity_rad_s": 3.0},
    "presliding_hysteresis": {"stiffness_n_m_rad": 3000.0},
    "position_dependent_friction": {"fraction": 0.2, "period_m": 0.02},
    "nonlinear_viscous_friction": {"quadratic_n_m_s2_rad2": 2e-5},
    "friction_drift": {"fraction": -0.3, "time_constant_s": 1.0},
    "table_side_friction": {"share": 0.5},
    "table_side_viscous_friction": {"share": 0.8},
    "backlash": {"gap_m": 1e-5},
    "preload_loss": {"zone_m": 5e-6, "stiffness_ratio": 0.3},
    "position_dependent_stiffness": {"relative_slope": -3.0},
    "periodic_lead_error": {"amplitude_m": 5e-6, "phase_rad": 1.0},
    "cumulative_lead_error": {"slope_m_m": 1e-4},
    "thermal_growth": {"relative_growth": 2e-3, "time_constant_s": 2.0},
    "structural_mode": {"frequency_hz": 45.0, "damping_ratio": 0.03},
    "cogging_torque": {"amplitude_n_m": 0.1, "cycles_per_rev": 10, "phase_rad": 0.5},
    "torque_ripple": {"fraction": 0.05, "cycles_per_rev": 6},
    "torque_constant_drift": {"fraction": -0.3, "time_constant_s": 1.0},
    "torque_constant_gradient": {"slope_1_m": -2.0},
    "torque_constant_saturation": {"coefficient_1_n2_m2": 2e-3},
    "torque_saturation": {"limit_n_m": 2.0},
    "torque_dead_zone": {"half_width_n_m": 0.1},
    "current_loop_lag": {"time_constant_s": 8e-4},
    "transport_delay": {"delay_s": 1.3e-3},
    "velocity_filter_lag": {"time_constant_s": 8e-4},
    "channel_time_skew": {"delay_s": 2.2e-3},
    "encoder_eccentricity": {"amplitude_rad": 3e-3, "phase_rad": 0.2},
    "load_encoder_eccentricity": {"amplitude_rad": 1e-4, "phase_rad": 0.7},
    "scale_interpolation_error": {"amplitude_m": 3e-6, "period_m": 2e-5},
    "external_force": {"force_n": 300.0, "start_s": 0.4, "end_s": 0.8},
    "periodic_force": {"force_n": 300.0, "frequency_hz": 5.0, "phase_rad": 0.3},
    "spring_load": {"stiffness_n_m": 3000.0, "rest_position_m": 0.0},
    "end_stop": {"stiffness_n_m": 1e5, "edge_m": 0.02},
    "gravity_torque": {"gravity_torque_n_m": 300.0, "angle_rad": 1.0},
    "friction_gradient": {"slope_1_m": 3.0},
    "load_dependent_friction": {"share": 0.2},
    "local_torque_constant": {"fraction": -0.2, "begin_m": 0.01, "end_m": 0.03, "flank_m": 2e-3},
    "local_friction": {"fraction": 0.5, "begin_m": 0.01, "end_m": 0.03, "flank_m": 2e-3},
}
EFFECTS = {name: Effect(name, parameters) for name, parameters in SHOWN.items()}
# together with all loads the drive needs more than the limit that shows alone
TOGETHER = {**EFFECTS, "torque_saturation": Effect("torque_saturation", {"limit_n_m": 6.0})}
POSITION, VELOCITY = motion(1.0)


def run(*effects: Effect, step_s: float = 1e-5) -> dict[str, np.ndarray]:
    return record(two_mass(), Sensors(), effects, Servo(), POSITION, VELOCITY, step_s=step_s)


def test_catalogue_holds_exactly_the_interface() -> None:
    required = {
        name: {p for p, entry in definition.parameters.items() if entry.default is None}
        for name, definition in CATALOGUE.items()
    }
    assert required == {name: set(parameters) for name, parameters in SHOWN.items()}
    assert len(CATALOGUE) == 39


@pytest.mark.parametrize("name", SHOWN)
def test_each_effect_shows_well_above_the_noise_in_a_recording(name: str) -> None:
    """The same seed gives the same noise: without the effect the difference would be exactly zero."""
    plain, changed = run(), run(EFFECTS[name])
    excess = {
        "motor_position_rad": 4 * 2 * np.pi / 2**20,
        "table_position_m": 4 * 0.5e-6,
        "torque_n_m": 0.01,
    }
    assert any(np.max(np.abs(changed[c] - plain[c])) > limit for c, limit in excess.items())
    assert all(np.all(np.isfinite(values)) for values in changed.values())


@pytest.mark.parametrize(("name", "form"), [(n, f) for n, d in CATALOGUE.items() for f in d.forms[1:]])
def test_forms_differ_from_the_default(name: str, form: str) -> None:
    default, other = run(EFFECTS[name]), run(Effect(name, SHOWN[name], form))
    assert any(not np.array_equal(default[channel], other[channel]) for channel in default)


@pytest.mark.parametrize("axis", [two_mass(), seven_dof()])
def test_all_effects_at_once(axis: object) -> None:
    rows = record(axis, Sensors(), list(TOGETHER.values()), Servo(), POSITION, VELOCITY)
    assert np.max(np.abs(rows["table_position_m"] - POSITION)) < 5e-3
    assert np.ptp(rows["table_position_m"]) > 0.02


@settings(max_examples=25)
@given(st.sets(st.sampled_from(sorted(SHOWN))), st.sampled_from([1e-5, 5e-5]))
def test_any_subset_stays_under_control(names: set[str], step_s: float) -> None:
    rows = run(*(TOGETHER[name] for name in sorted(names)), step_s=step_s)
    assert np.max(np.abs(rows["motor_position_rad"] * 0.01 / (2 * np.pi) - POSITION)) < 5e-3


@given(st.permutations(sorted(SHOWN)[:6]))
@settings(max_examples=5)
def test_order_does_not_matter(names: list[str]) -> None:
    rows, again = (run(*(EFFECTS[name] for name in order)) for order in (names, sorted(names)))
    assert np.array_equal(rows["torque_n_m"], again["torque_n_m"])


def test_neutral_parameters_change_nothing() -> None:
    neutral = [
        Effect("asymmetric_friction", {"offset_torque_n_m": 0.0}),
        Effect("stribeck_friction", {"static_torque_n_m": 1.1, "stribeck_velocity_rad_s": 3.0}),
        Effect("friction_drift", {"fraction": 0.0, "time_constant_s": 1.0}),
        Effect("backlash", {"gap_m": 0.0}),
        Effect("preload_loss", {"zone_m": 0.0, "stiffness_ratio": 0.5}),
        Effect("periodic_lead_error", {"amplitude_m": 0.0, "phase_rad": 1.0}),
        Effect("torque_dead_zone", {"half_width_n_m": 0.0}),
        Effect("transport_delay", {"delay_s": 0.0}),
        Effect("torque_ripple", {"fraction": 0.0, "cycles_per_rev": 3}),
        Effect("table_side_friction", {"share": 0.0}),
        Effect("channel_time_skew", {"delay_s": 0.0}),
    ]
    plain, changed = run(), run(*neutral)
    counts = {"motor_position_rad": 2 * np.pi / 2**20, "table_position_m": 0.5e-6}
    for channel, count in counts.items():  # rounding may move a reading by a count, and the loop answers
        assert np.max(np.abs(changed[channel] - plain[channel])) < 3.5 * count, channel
    assert np.std(changed["torque_n_m"] - plain["torque_n_m"]) < 1e-3


@pytest.mark.parametrize(("make", "says"), [
    (lambda: Effect("backslash", {}), r"effect 'backslash': unknown; allowed: asymmetric_friction, .*backlash"),
    (lambda: Effect("backlash", {"gap": 1.0}), r"effect backlash: parameter unknown gap; allowed: gap_m"),
    (lambda: Effect("backlash"), r"effect backlash: parameter missing gap_m"),
    (lambda: Effect("backlash", {"gap_m": -1e-6}), r"effect backlash: gap_m must be in \[0, inf\], got -1e-06"),
    (lambda: Effect("backlash", {"gap_m": float("nan")}), r"gap_m must be in"),
    (lambda: Effect("stribeck_friction", SHOWN["stribeck_friction"], "dahl"), r"allowed: gaussian, exponential, atan"),
    (lambda: run(EFFECTS["backlash"], EFFECTS["backlash"]), r"effect backlash: given twice"),
    (lambda: run(Effect("asymmetric_friction", {"offset_torque_n_m": 1.2})), r"must be <= the Coulomb friction 1.1"),
])  # fmt: skip
def test_refusals_say_what_is_allowed(make: object, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        make()


def test_effects_travel_between_processes() -> None:
    for effect in EFFECTS.values():
        assert pickle.loads(pickle.dumps(effect)) == effect
