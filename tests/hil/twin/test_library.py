"""The library: complete, well-formed, compiled; every mechanism is neutral at zero strength and finite."""

import dataclasses
from collections import defaultdict
from pathlib import Path
from string import Formatter

import numpy as np
import pytest
from contributions import PERIOD_S, moments, row
from hypothesis import given
from hypothesis import strategies as st
from numba import float64, typeof

from hil.twin import mechanisms
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.maps import MAPS
from hil.twin.mechanism import PARAMETERS, WIDTH, Block, Mechanism, Moment, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.physics import Active
from hil.twin.scene import AxisFacts
from hil.twin.structure.chain import two_mass

# The interface: id, block, and the parameters that a diagnosis reports by these names
TABLE = {
    "asymmetric_friction": ("motor_side", ["offset_torque_n_m"]),
    "constant_load": ("motor_side", ["load_torque_n_m"]),
    "stribeck_friction": ("motor_side", ["static_torque_n_m", "stribeck_velocity_rad_s"]),
    "presliding_hysteresis": ("motor_side", ["stiffness_n_m_rad"]),
    "position_dependent_friction": ("motor_side", ["fraction", "period_m"]),
    "friction_gradient": ("motor_side", ["slope_1_m"]),
    "load_dependent_friction": ("motor_side", ["share"]),
    "local_friction": ("motor_side", ["fraction", "begin_m", "end_m", "flank_m"]),
    "nonlinear_viscous_friction": ("motor_side", ["quadratic_n_m_s2_rad2"]),
    "friction_drift": ("motor_side", ["fraction", "time_constant_s"]),
    "table_side_friction": ("table", ["share"]),
    "table_side_viscous_friction": ("table", ["share"]),
    "backlash": ("transmission", ["gap_m"]),
    "preload_loss": ("transmission", ["zone_m", "stiffness_ratio"]),
    "position_dependent_stiffness": ("transmission", ["relative_slope"]),
    "periodic_lead_error": ("transmission", ["amplitude_m", "phase_rad"]),
    "cumulative_lead_error": ("transmission", ["slope_m_m"]),
    "thermal_growth": ("transmission", ["relative_growth", "time_constant_s"]),
    "structural_mode": ("table", ["frequency_hz", "damping_ratio"]),
    "cogging_torque": ("motor_side", ["amplitude_n_m", "cycles_per_rev", "phase_rad"]),
    "torque_ripple": ("drive", ["fraction", "cycles_per_rev"]),
    "torque_constant_drift": ("drive", ["fraction", "time_constant_s"]),
    "local_torque_constant": ("drive", ["fraction", "begin_m", "end_m", "flank_m"]),
    "torque_constant_gradient": ("drive", ["slope_1_m"]),
    "torque_constant_saturation": ("drive", ["coefficient_1_n2_m2"]),
    "torque_saturation": ("drive", ["limit_n_m"]),
    "torque_dead_zone": ("drive", ["half_width_n_m"]),
    "current_loop_lag": ("drive", ["time_constant_s"]),
    "transport_delay": ("drive", ["delay_s"]),
    "velocity_filter_lag": ("controller", ["time_constant_s"]),
    "channel_time_skew": ("sensor", ["delay_s"]),
    "encoder_eccentricity": ("sensor", ["amplitude_rad", "phase_rad"]),
    "load_encoder_eccentricity": ("sensor", ["amplitude_rad", "phase_rad"]),
    "scale_interpolation_error": ("sensor", ["amplitude_m", "period_m"]),
    "external_force": ("table", ["force_n", "start_s", "end_s"]),
    "periodic_force": ("table", ["force_n", "frequency_hz", "phase_rad"]),
    "spring_load": ("table", ["stiffness_n_m", "rest_position_m"]),
    "end_stop": ("table", ["stiffness_n_m", "edge_m"]),
    "gravity_torque": ("table", ["gravity_torque_n_m", "angle_rad"]),
}

# Parameters at which a mechanism leaves the value 0.7 of its stage, or any value, as it is
VALUE = 0.7
NEUTRAL = {
    "stribeck_friction": {"static_torque_n_m": VALUE, "stribeck_velocity_rad_s": 3.0},
    "position_dependent_friction": {"fraction": 0.0, "period_m": 0.02, "phase_rad": 1.0},
    "friction_drift": {"fraction": 0.0, "time_constant_s": 10.0},
    "torque_constant_drift": {"fraction": 0.0, "time_constant_s": 10.0},
    "preload_loss": {"zone_m": 1e-4, "stiffness_ratio": 1.0},
    "periodic_lead_error": {
        "amplitude_m": 0.0,
        "phase_rad": 1.0,
        "amplitude_2_m": 0.0,
        "phase_2_rad": 0.0,
        "amplitude_3_m": 0.0,
        "phase_3_rad": 0.0,
    },
    "thermal_growth": {"relative_growth": 0.0, "time_constant_s": 10.0, "bearing_m": 0.0},
    "cogging_torque": {"amplitude_n_m": 0.0, "cycles_per_rev": 6.0, "phase_rad": 1.0},
    "torque_ripple": {"fraction": 0.0, "cycles_per_rev": 6.0, "phase_rad": 1.0},
    "torque_saturation": {"limit_n_m": VALUE},
    "encoder_eccentricity": {"amplitude_rad": 0.0, "phase_rad": 1.0},
    "load_encoder_eccentricity": {"amplitude_rad": 0.0, "phase_rad": 1.0},
    "scale_interpolation_error": {"amplitude_m": 0.0, "period_m": 2e-5, "phase_rad": 1.0},
    "external_force": {"force_n": 0.0, "start_s": 1.0, "end_s": 2.0},
    "periodic_force": {"force_n": 0.0, "frequency_hz": 7.0, "phase_rad": 1.0},
    "spring_load": {"stiffness_n_m": 0.0, "rest_position_m": 0.1},
    "gravity_torque": {"gravity_torque_n_m": 0.0, "angle_rad": 1.0},
}

OUTSIDE = (Stage.CHAIN, Stage.CHANNEL, Stage.ANSWER)  # plain Python
STEPPED = [mechanism for mechanism in LIBRARY if mechanism.variants[0].stage not in OUTSIDE]
SUFFIX = {
    Dimension.TORQUE: "_n_m",
    Dimension.MOTOR_SPEED: "_rad_s",
    Dimension.MOTOR_STIFFNESS: "_n_m_rad",
    Dimension.MOTOR_DRAG: "_n_m_s2_rad2",
    Dimension.INVERSE_TORQUE_SQUARED: "_1_n2_m2",
    Dimension.ANGLE: "_rad",
    Dimension.LENGTH: "_m",
    Dimension.TIME: "_s",
    Dimension.FORCE: "_n",
    Dimension.STIFFNESS: "_n_m",
    Dimension.FREQUENCY: "_hz",
    Dimension.COUNT: "cycles_per_rev",
}  # RATIO and PER_LENGTH bear no unit of their own

each = pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda mechanism: mechanism.id)
each_stepped = pytest.mark.parametrize("mechanism", STEPPED, ids=lambda mechanism: mechanism.id)


def test_every_effect_is_there_once_with_its_block_and_parameters() -> None:
    assert sorted(mechanism.id for mechanism in LIBRARY) == sorted(TABLE)
    for effect, (block, names) in TABLE.items():
        assert BY_ID[effect].block == Block(block)
        assert set(names) <= set(BY_ID[effect].names)


def test_one_file_per_mechanism() -> None:
    files = {path.stem for path in Path(mechanisms.__path__[0]).glob("*.py")} - {"__init__"}
    assert files == {mechanism.id for mechanism in LIBRARY}
    assert set(BY_ID) - files == {mapped.id for mapped in MAPS}


def fields(sentence):
    """The names in braces."""
    return {field for _, field, _, _ in Formatter().parse(sentence) if field is not None}


@each
def test_bounds_units_and_text(mechanism) -> None:
    assert len(mechanism.parameters) <= PARAMETERS
    for parameter in mechanism.parameters:
        assert np.isfinite([parameter.low, parameter.high]).all()
        assert parameter.low < parameter.high
        assert parameter.name.endswith(SUFFIX.get(parameter.dimension, ""))
    known = {*mechanism.names, *(["wave"] if mechanism.indices(Role.ORDER) else [])}
    assert fields(mechanism.text.sentence) <= known | ({"variant"} if all(mechanism.forms) else set())
    assert mechanism.text.sentence.endswith(".")
    for variant in mechanism.variants:
        if variant.text:
            assert fields(variant.text.sentence) <= {*mechanism.names, "viscous_speed"}
            assert variant.text.sentence.endswith(".")
            assert not variant.text.reversed or fields(variant.text.reversed) == fields(variant.text.sentence)
            assert len(mechanism.variants) > 1
    assert mechanism.element
    assert mechanism.equation
    assert mechanism.source


def own(record, kind):
    """Fields of a record that differ from their default and are no function."""
    given = [field.name for field in dataclasses.fields(kind) if getattr(record, field.name) != field.default]
    return {name for name in given if not callable(getattr(record, name))}


def test_what_one_mechanism_alone_needs_is_a_function_of_its_own() -> None:
    """No flag of the general records serves a single mechanism; a variant may replace what its mechanism says."""
    users = defaultdict(set)
    for one in LIBRARY:
        replaced = {field.name for field in dataclasses.fields(Mechanism)}
        names = own(one, Mechanism) | own(one.search, SearchHints) | own(one.text, Text)
        for name in names.union(*(own(variant, Variant) - replaced for variant in one.variants)):
            users[name].add(one.id)
    assert users.keys() > {"needs_table", "most", "beside", "softens", "contact", "turning"}
    assert {name: found for name, found in users.items() if len(found) == 1} == {}


@each
def test_variants_differ_by_name_and_act_in_the_kernel_or_outside(mechanism) -> None:
    assert len(set(mechanism.forms)) == len(mechanism.variants) > 0
    assert len({variant.stage in OUTSIDE for variant in mechanism.variants}) == 1


@each_stepped
def test_compiles_to_the_one_signature(mechanism) -> None:
    moment = typeof(Moment(*[0.0] * len(Moment._fields)))
    for variant in mechanism.variants:
        variant.contribution.compile((float64, moment, float64[::1], float64[::1]))
        assert variant.contribution.nopython_signatures[0].return_type == float64


@each_stepped
@given(at=moments)
def test_neutral_at_zero_strength(mechanism, at) -> None:
    neutral = NEUTRAL.get(mechanism.id, dict.fromkeys(mechanism.names, 0.0))
    for variant in range(len(mechanism.variants)):
        values = row([neutral[name] for name in mechanism.names])
        first = at._replace(within_s=0.0)
        assert mechanism.variants[variant].contribution(VALUE, first, values, np.zeros(WIDTH)) == pytest.approx(
            VALUE, rel=1e-12
        )


def test_neutral_structure_and_skew() -> None:
    chain = two_mass(335.0, 384.0, 5.64e7, 0.03, 0.01)
    assert BY_ID["structural_mode"].variants[0].contribution(chain, (30.0, 0.05, 0.0)) is chain
    channels = tuple(np.random.default_rng(1).normal(size=(4, 50)))
    for variant in range(3):
        np.testing.assert_array_equal(
            BY_ID["channel_time_skew"].variants[variant].contribution(channels, (0.0,), PERIOD_S), channels
        )


@each_stepped
@given(data=st.data(), at=moments, value=st.floats(-1e3, 1e3))
def test_finite_within_bounds_and_at_zero(mechanism, data, at, value) -> None:
    strategies = [st.floats(p.low, p.high) | st.sampled_from([0.0, p.low, p.high]) for p in mechanism.parameters]
    variant = data.draw(st.integers(0, len(mechanism.variants) - 1))
    values = row(data.draw(st.tuples(*strategies)))
    memory = np.zeros(WIDTH)
    for within_s in (0.0, at.step_s, 0.0):
        out = mechanism.variants[variant].contribution(value, at._replace(within_s=within_s), values, memory)
        assert np.isfinite(out)
    assert np.isfinite(memory).all()


@pytest.mark.parametrize("mechanism", [m for m in LIBRARY if m.neutral_at_zero], ids=lambda m: m.id)
def test_no_name_applies_to_a_strength_at_the_bound_without_effect(mechanism: Mechanism) -> None:
    axis = AxisFacts(0.3, 1e-3, 1.0, 3.0, 1e-9, 10.0)
    typical = list(mechanism.complete(mechanism.typical_values(axis)))
    for index in mechanism.indices(Role.STRENGTH):
        typical[index] = max(mechanism.parameters[index].low, 0.0) + 2e-20
    assert not mechanism.is_claimable(typical, 0, axis)
    assert any(
        mechanism.is_claimable(mechanism.typical_values(axis), form, axis) for form in range(len(mechanism.forms))
    )


def test_an_offset_is_what_adds_one_torque_at_each_time_place_and_speed() -> None:
    found = {
        (mechanism.id, variant)
        for mechanism in LIBRARY
        for variant in range(len(mechanism.variants))
        if Active(mechanism.id, tuple(_inside(one) for one in mechanism.parameters), variant).is_offset
    }
    assert found == {("constant_load", 0), ("asymmetric_friction", 0)}
    assert not Active("constant_load", (0.0,)).is_offset


def _inside(parameter: Parameter) -> float:
    return 0.5 * (max(parameter.low, -1.0) + min(parameter.high, 2.0)) + 0.013
