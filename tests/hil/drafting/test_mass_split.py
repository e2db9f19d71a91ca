"""The parts of a two-mass axis are those of its owner, and the sum is that of the recordings."""

from __future__ import annotations

import numpy as np
import pytest

from hil.drafting.split import nominal_sum, split_of
from hil.identification.least_squares import Estimate
from hil.recording.recording import Recording

LEAD_M = 0.02 * np.pi  # 1 kg is 1e-4 kg m^2
TOTAL = Estimate(1e-3, 1e-5, "least squares")


def told(**nominal: float) -> Recording:
    return Recording("log", {"time_s": np.arange(3) * 1e-3}, 1e-3, {"nominal": nominal} if nominal else {})


@pytest.mark.parametrize(
    ("nominal", "load"),
    [
        ({"load_mass_kg": 3.0}, 3e-4),
        ({"motor_inertia_kg_m2": 7e-4}, 3e-4),
        ({"load_mass_kg": 6.0, "motor_inertia_kg_m2": 14e-4}, 3e-4),  # their ratio counts
    ],
)
def test_parts_that_are_told_make_up_the_sum(nominal: dict[str, float], load: float) -> None:
    split = split_of(TOTAL, told(**nominal), LEAD_M, turns=False)
    assert split.told
    assert split.held == ("load_mass_kg" in nominal)
    assert split.load.value == pytest.approx(load)
    assert split.motor.value + split.load.value == pytest.approx(TOTAL.value)
    assert 0.0 < split.load.std_error < split.load.value


@pytest.mark.parametrize(
    "nominal", [{}, {"load_mass_kg": 10.0}, {"motor_inertia_kg_m2": 2e-3}, {"load_inertia_kg_m2": 3.0}]
)
def test_parts_that_are_not_told_or_exceed_the_sum_are_halves(nominal: dict[str, float]) -> None:
    split = split_of(TOTAL, told(**nominal), LEAD_M, turns=False)
    assert not split.told
    assert ("does not fit" in split.how) == bool({"load_mass_kg", "motor_inertia_kg_m2"} & set(nominal))
    assert split.load.value == split.motor.value == 5e-4 == split.load.std_error


def test_the_inertia_of_a_load_that_turns_is_geared() -> None:
    split = split_of(TOTAL, told(load_inertia_kg_m2=3.0), LEAD_M, turns=True)
    assert split.load.value == pytest.approx(3.0 * 1e-4, rel=1e-9)


def test_a_lighter_load_leaves_the_sum() -> None:
    split = split_of(TOTAL, told(), LEAD_M, turns=False).lighter(0.2)
    assert (split.load.value, split.motor.value) == pytest.approx((1e-4, 9e-4))


def test_the_sum_is_nominal_where_both_parts_are_told() -> None:
    both = nominal_sum(told(load_mass_kg=3.0, motor_inertia_kg_m2=7e-4), LEAD_M, turns=False)
    assert both is not None
    assert both.value == pytest.approx(1e-3)
    assert nominal_sum(told(load_mass_kg=3.0), LEAD_M, turns=False) is None
