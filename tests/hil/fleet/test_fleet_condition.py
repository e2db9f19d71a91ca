"""The condition by one recording of a simulated axis with known wear, and what a recording does not tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ageing_fleet import Wear, draw_axis, recording_of

from hil.bench.bench_file import Bench
from hil.errors import InputError
from hil.fleet.condition import condition
from hil.fleet.constants import Constants, fit_constants
from hil.fleet.quantities import BY_NAME, Told
from hil.identification.measured import Measured, take
from hil.validation.proof.draw.axes import DrawnAxis


@pytest.fixture(scope="module")
def axis() -> DrawnAxis:
    rng = np.random.default_rng([1, 0])
    return next(one for one in iter(lambda: draw_axis(rng, "two_mass"), None) if one.period_s == 1e-3)


def taken(axis: DrawnAxis, bench: Bench, wear: Wear, seed: int = 3) -> Measured:
    return take(recording_of(axis, wear, seed, 3.0), bench)


@pytest.fixture(scope="module")
def constants(axis: DrawnAxis) -> Constants:
    return fit_constants([taken(axis, axis.bench, Wear(), seed) for seed in (1, 2)], axis.bench)


def test_quantities_are_those_of_the_axis(axis: DrawnAxis, constants: Constants) -> None:
    """Values of the simulated reality, within the errors or what the model leaves open; masses were wrong by 30 %."""
    new, worn = (
        condition(taken(axis, constants.bench, wear), constants)
        for wear in (Wear(), Wear(friction=1.3, gap_m=13e-6, lead_error_m=5e-6, late_s=220e-6))
    )
    assert set(new) == set(BY_NAME)

    def value(found: dict[str, Told], name: str) -> float:
        told = found[name].value
        assert told is not None, found[name].reason
        return told

    inertia = (axis.true["motor_mass_kg"] + axis.true["table_mass_kg"]) * axis.truth.drive_ratio_m_rad**2
    assert constants.inertia == pytest.approx(inertia, rel=0.01)
    for found, factor in ((new, 1.0), (worn, 1.3)):
        factor *= 1.0 + 0.02 * np.random.default_rng(3).standard_normal()  # the scatter of this seed
        for way in ("forward", "back"):
            assert value(found, f"coulomb_{way}") == pytest.approx(factor * axis.true["coulomb_torque_n_m"], rel=0.02)
            assert value(found, f"viscous_{way}") == pytest.approx(
                factor * axis.true["viscous_torque_n_m_s_rad"], rel=0.03
            )
    friction_n = axis.true["coulomb_torque_n_m"] / axis.truth.drive_ratio_m_rad
    windup_m = friction_n / axis.true["stiffness_n_m"]  # twice the half of the friction that is at the table
    assert value(new, "reversal") == pytest.approx(3e-6 + windup_m, rel=0.25)
    more_m = 10e-6 + 0.3 * windup_m
    assert value(worn, "reversal") - value(new, "reversal") == pytest.approx(more_m, rel=0.1)
    assert value(worn, "lead_error") == pytest.approx(5e-6, rel=0.05)
    assert value(worn, "table_delay") - value(new, "table_delay") == pytest.approx(200e-6, rel=0.05)
    assert value(new, "stiffness") == pytest.approx(axis.true["stiffness_n_m"], rel=0.4)  # by the believed table mass


def test_a_recording_of_another_axis_is_refused(axis: DrawnAxis, constants: Constants) -> None:
    heavy = replace(axis, true={**axis.true, "table_mass_kg": 4.0 * axis.true["table_mass_kg"]})
    with pytest.raises(InputError, match=r"is of another axis: it moves .* times the inertia"):
        condition(taken(heavy, constants.bench, Wear()), constants)


def test_one_of_another_axis_among_the_first_changes_no_constant(axis: DrawnAxis, constants: Constants) -> None:
    heavy = replace(axis, true={**axis.true, "table_mass_kg": 4.0 * axis.true["table_mass_kg"]})
    good = [taken(axis, axis.bench, Wear(), seed) for seed in (1, 2)]
    assert fit_constants([taken(heavy, axis.bench, Wear()), *good], axis.bench) == constants


def test_what_is_not_told_has_a_reason_and_no_value(axis: DrawnAxis, constants: Constants) -> None:
    run = taken(axis, constants.bench, Wear())
    alone = replace(run, table_m=np.empty(0))
    found = condition(alone, constants, set_points=False)
    assert found["reversal"] == Told(None, None, "no encoder at the table")
    assert found["quadrant"] == Told(None, None, "no set-points are recorded")
    assert found["coulomb_forward"].value is not None


def test_an_axis_at_rest_is_refused(axis: DrawnAxis, constants: Constants) -> None:
    run = taken(axis, constants.bench, Wear())
    still = replace(run, motor=np.full_like(run.motor, run.motor[0]))
    with pytest.raises(InputError, match="hardly moves, allowed sliding motion"):
        condition(still, constants)
