"""A mismatch is put where it is: block, phase, position, speed, period; nothing is claimed where nothing is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from diagnosis_runs import bench, evaluated, recorded, rows_of
from numpy.typing import NDArray

from hil.diagnosis.location.locate import _range, locate, mismatch_energies, phase_shares, phases, windows
from hil.diagnosis.location.periodicity import Lock, lock
from hil.diagnosis.location.residual_energy import Energy, energies
from hil.diagnosis.result import Location, PhaseKind
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured, take
from hil.identification.terms import Term

FloatArray = NDArray[np.float64]
OWNER = bench()


def located(*terms: Term, named: bool = False) -> Location:
    """Location of terms that the twin lacks and whose parameters are right otherwise."""
    run = take(recorded(OWNER, *terms), OWNER)
    without = evaluated(Hypothesis(OWNER), [run])
    return locate(without, evaluated(Hypothesis(OWNER, terms), without.data) if named else without)


@pytest.mark.parametrize(
    ("term", "block", "channel"),
    [
        (Term("constant_load", 0, (0.5,)), "motor_side", "motor_position_rad"),
        (Term("periodic_lead_error", 0, (5e-6, 0.3)), "transmission", "table_position_m"),
        (Term("current_loop_lag", 0, (1e-3,)), "drive", "torque_n_m"),
        (Term("velocity_filter_lag", 0, (1e-3,)), "controller", "torque_command_n_m"),
    ],
)
def test_the_block_is_found_without_a_name(term: Term, block: str, channel: str) -> None:
    found = located(term)
    assert found.block == block
    assert found.channels[0] == channel


def test_with_a_name_block_and_element_are_those_of_the_mechanism() -> None:
    found = located(Term("encoder_eccentricity", 0, (5e-4, 0.3)), named=True)
    assert found.block == "sensor"
    assert found.element == "motor encoder"
    assert found.order_per_rev == 1.0


@pytest.mark.parametrize("named", [True, False])
def test_stribeck_friction_is_at_low_speed(named: bool) -> None:
    found = located(Term("stribeck_friction", 0, (1.8, 3.0)), named=named)
    assert found.speed_m_s is not None
    assert found.speed_m_s[1] < 0.05
    assert found.phases[0].kind in (PhaseKind.CREEP, PhaseKind.STANDSTILL)


def test_an_angle_locked_error_is_told_from_a_time_locked_one() -> None:
    assert located(Term("periodic_lead_error", 0, (1e-6, 0.3, 5e-6, 0.3))).order_per_rev == 2.0
    assert located(Term("periodic_lead_error", 0, (5e-6, 0.3))).order_per_rev == 1.0
    run = take(recorded(OWNER), OWNER)

    def locked(signal: FloatArray) -> Lock:
        return lock([Energy(run, np.zeros(run.motor.size), {"motor": signal})], "motor", OWNER, ())

    assert locked(np.sin(2.0 * np.pi * 37.0 * run.time_s)).frequency_hz == pytest.approx(37.0, abs=0.3)
    assert locked(np.sin(3.0 * run.motor)) == Lock(period_m=0.01 / 3.0, order_per_rev=3.0)
    by_position = locked(np.sin(2.0 * np.pi * run.position_command_m / 0.0231))
    assert by_position.period_m == pytest.approx(0.0231, rel=0.03)
    assert by_position.order_per_rev is by_position.frequency_hz is None


def test_at_a_single_speed_nothing_is_claimed() -> None:
    run = take(recorded(OWNER), OWNER)
    rows = np.abs(np.abs(run.velocity_command_m_s) - 0.25) < 0.01
    one = rows_of(run, rows)
    seen = [Energy(one, np.zeros(one.motor.size), {"motor": np.sin(one.motor * 3.0)})]
    assert lock(seen, "motor", OWNER, ()).order_per_rev is None


def test_the_error_of_an_encoder_is_where_it_stands_at_every_speed() -> None:
    term = Term("scale_interpolation_error", 0, (2e-6, 1e-3, 0.3))
    run = take(recorded(OWNER, term), OWNER)
    without = evaluated(Hypothesis(OWNER), [run])
    (seen,) = mismatch_energies(without, evaluated(Hypothesis(OWNER, (term,)), without.data))
    speed = np.abs(run.velocity_command_m_s)
    slow, fast = ((speed > low) & (speed < high) for low, high in ((0.01, 0.05), (0.15, 0.3)))
    assert np.mean(seen.rows[fast]) == pytest.approx(np.mean(seen.rows[slow]), rel=0.3)


def test_a_force_in_a_window_is_found_in_its_window() -> None:
    found = located(Term("external_force", 0, (300.0, 1.0, 1.3)), named=True)
    assert found.windows_s
    assert all(a >= 0.9 and b <= 1.5 for a, b in found.windows_s)


def test_windows_and_phases_of_noise_claim_nothing(clean: tuple[Fit, Measured]) -> None:
    fit, run = clean
    seen = energies(fit.hypothesis, fit.data)
    assert _range([run.position_command_m], seen) is None
    assert _range([np.abs(run.velocity_command_m_s)], seen) is None
    assert lock(seen, "torque", OWNER, ()).frequency_hz is None
    assert windows(Energy(run, np.ones(run.motor.size), {})) == ()


def test_phases_are_those_of_the_set_points() -> None:
    run = take(recorded(OWNER), OWNER)
    kinds = phases(run)
    assert set(kinds) == {kind.value for kind in PhaseKind}
    still = run.velocity_command_m_s == 0.0
    assert set(kinds[still]) <= {PhaseKind.STANDSTILL, PhaseKind.REVERSAL}
    fast = np.abs(run.velocity_command_m_s) > 0.2
    assert set(kinds[fast]) <= {PhaseKind.CONSTANT_FEED, PhaseKind.ACCELERATION}


def test_shares_of_phases_add_up() -> None:
    found = located(Term("backlash", 0, (30e-6,)), named=True)
    assert sum(phase.share for phase in found.phases) == pytest.approx(1.0)


def test_energy_in_one_place_is_claimed_there() -> None:
    run = take(recorded(OWNER, times=2), OWNER)
    rows = np.where(np.abs(run.position_command_m - 0.045) < 0.004, 100.0, 0.0)
    found = _range([run.position_command_m], [Energy(run, rows, {})])
    assert found is not None
    assert 0.038 < found[0] < found[1] < 0.052


@pytest.fixture(scope="module")
def clean() -> tuple[Fit, Measured]:
    """The twin of an axis that is as believed."""
    run = take(recorded(OWNER), OWNER)
    return evaluated(Hypothesis(OWNER), [run]), run


def test_shares_of_nothing_are_zero(clean: tuple[Fit, Measured]) -> None:
    _, run = clean
    shares: Sequence[float] = [phase.share for phase in phase_shares([Energy(run, np.zeros(run.motor.size), {})])]
    assert sum(shares) == 0.0
