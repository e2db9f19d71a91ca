"""Units of names and values as text."""

from __future__ import annotations

from typing import get_args

import pytest

from hil.bench.axis_models import Axis
from hil.channels import CHANNELS
from hil.quantities import UNITS, change, digits, misread_factors, percent, quantity, unit_of

# as diagnosis.json has always given them
PARAMETERS = {
    "motor_mass_kg": "kg",
    "table_mass_kg": "kg",
    "mass_kg": "kg",
    "motor_inertia_kg_m2": "kg m^2",
    "inertia_kg_m2": "kg m^2",
    "load_inertia_kg_m2": "kg m^2",
    "stiffness_n_m_rad": "N m/rad",
    "stiffness_n_m": "N/m",
    "nut_support_stiffness_n_m": "N/m",
    "nut_stiffness_n_m": "N/m",
    "coupling_stiffness_n_m_rad": "N m/rad",
    "damping_ratio": "1",
    "inertia_scale": "1",
    "stiffness_scale": "1",
    "coulomb_torque_n_m": "N m",
    "viscous_torque_n_m_s_rad": "N m s/rad",
    "coulomb_force_n": "N",
    "viscous_force_n_s_m": "N s/m",
    "time_constant_s": "s",
    "coulomb_voltage_v": "V",
    "voltage_constant_v_s_rad": "V s/rad",
}


def test_units_of_channels_follow_from_their_names() -> None:
    assert {name: unit_of(name) for name in CHANNELS} == {name: entry.unit for name, entry in CHANNELS.items()}


def test_units_of_nominal_parameters_follow_from_their_names() -> None:
    nominal = {name for model in get_args(get_args(Axis)[0]) for name in model.NOMINAL}
    assert nominal
    assert {name: unit_of(name) for name in nominal} == {name: PARAMETERS[name] for name in nominal}
    assert {name: unit_of(name) for name in PARAMETERS} == PARAMETERS


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.05, "s", "50.0 ms"),
        (0.03, "1", "3.00 %"),
        (5.64e7, "N/m", "56.4 N/µm"),
        (12.0, "m", "12.0 m"),
        (4.0, "1/rev", "4.00"),
        (2e-5, "rad", "20.0 µrad"),
        (0.5, "kg m^2", "0.500 kg m^2"),
    ],
)
def test_values_have_the_unit_in_which_they_are_read(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text


def test_ratios_and_changes() -> None:
    assert percent(0.1234) == "12.3 %"
    assert percent(1e-7) == "< 0.001 %"
    assert change(1.1, 1.0) == "+10.0 %"
    assert change(1.1, 0.0) == "–"
    assert digits(1234567.0) == "1.23e+06"


def test_a_channel_in_a_wrong_unit_is_off_by_the_inverse_of_its_factor() -> None:
    factors = misread_factors("mm", "um", "deg")
    assert list(factors.values()) == ["mm", "µm", "degrees"]
    assert list(factors) == pytest.approx([1e3, 1e6, 57.29578])
    assert list(misread_factors("lbf ft")) == pytest.approx([0.73756], rel=1e-4)
    assert "km" not in UNITS
