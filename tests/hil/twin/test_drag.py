"""Friction in the stepping kernel: steady speeds as its equations say; drag stops an axis but never drives one."""

import numpy as np
import pytest

from hil.control import cascade
from hil.twin.axis import Start, Steps, Twin
from hil.twin.physics import Active, Physics
from hil.twin.structure.chain import LINEAR_LEAD_M, one_mass, two_mass

MASS_KG, COULOMB_N, VISCOUS_N_S_M = 100.0, 20.0, 200.0
SPEED_M_S = COULOMB_N / VISCOUS_N_S_M  # at which viscous friction equals Coulomb friction
GAINS = cascade.make_gains(
    position_gain_1_s=100.0,
    velocity_gain_n_m_s_rad=5000.0,
    ratio_m_rad=1.0,
    velocity_feedforward=0.0,
    velocity_integral_time_s=None,
    velocity_period_s=1e-3,
    position_period_s=1e-3,
)


def twin(*active, coulomb=COULOMB_N, viscous=VISCOUS_N_S_M, **steps):
    """A linear axis of one mass."""
    return Twin(Physics(one_mass(MASS_KG, LINEAR_LEAD_M), coulomb, viscous, linear=True), GAINS, active, **steps)


def thinning(n_s2_m2):
    return Active("nonlinear_viscous_friction", (n_s2_m2,), 1)


def with_speed(n):
    return Active("asymmetric_friction", (n,), 1)


def speeds(found):
    """Mean speed of each period [m/s]."""
    return np.diff(found.motor_position) / GAINS.period_s


@pytest.mark.parametrize(
    ("active", "forwards", "backwards"),
    [
        (thinning(500.0), 2.0 * COULOMB_N + 5.0, 2.0 * COULOMB_N + 5.0),
        (with_speed(-4.0), 2.0 * COULOMB_N - 4.0, 2.0 * COULOMB_N + 4.0),
    ],
)
def test_the_force_that_holds_the_speed_at_which_the_strength_is_told(active, forwards, backwards) -> None:
    for sign, force in ((1.0, forwards), (-1.0, backwards)):
        found = twin(active).drive(np.full(10_000, sign * force))
        assert speeds(found)[-1] == pytest.approx(sign * SPEED_M_S, rel=1e-4)


def test_a_lubricant_that_thins_changes_viscous_friction_alone() -> None:
    warm = Active("friction_drift", (-0.4, 1e-3), 1)
    found = twin(warm).drive(np.full(10_000, COULOMB_N + 0.6 * VISCOUS_N_S_M * SPEED_M_S))
    assert speeds(found)[-1] == pytest.approx(SPEED_M_S, rel=1e-4)


@pytest.mark.parametrize(
    "contact",
    [(), (Active("presliding_hysteresis", (4e6,)),), (Active("presliding_hysteresis", (4e6,), 1),)],
    ids=["rigid", "elastic", "slips"],
)
@pytest.mark.parametrize(
    "active", [thinning(5e5), Active("nonlinear_viscous_friction", (1e8,))], ids=["thinning", "quadratic"]
)
def test_drag_stops_a_coasting_axis_and_never_turns_it_round(active, contact) -> None:
    """One step per tick and drag that could stop the axis many times over within it."""
    coasting = twin(active, *contact, steps=Steps(GAINS.period_s, GAINS.period_s))
    found = speeds(coasting.drive(np.zeros(400), Start(0.0, SPEED_M_S)))
    # an elastic contact gives back what it took: Fc^2 / 2 k of energy
    springs_back = np.sqrt(COULOMB_N**2 / 4e6 / MASS_KG) if contact else 1e-12
    assert found[0] > 0.0
    assert found.min() >= -springs_back
    assert abs(found[-1]) <= springs_back


def test_a_step_across_rest_agrees_with_fine_steps() -> None:
    """Force that swings the axis to and fro through rest, where the drag of a thinning lubricant is steepest."""
    time_s = np.arange(4000) * GAINS.period_s
    force = 60.0 * np.sin(2.0 * np.pi * time_s)
    coarse, fine = (
        twin(thinning(2000.0), steps=Steps(fine_s=step_s)).drive(force).motor_position for step_s in (2e-5, 2e-6)
    )
    assert np.ptp(fine) > 0.01
    np.testing.assert_allclose(coarse, fine, atol=2e-5 * np.ptp(fine))


def test_without_viscous_friction_there_is_no_such_speed() -> None:
    force = np.full(500, 30.0)
    plain = twin(viscous=0.0).drive(force).motor_position
    for active in (thinning(500.0), with_speed(-4.0)):
        np.testing.assert_array_equal(twin(active, viscous=0.0).drive(force).motor_position, plain)


@pytest.mark.parametrize(
    ("active", "drag_n"),
    [
        (Active("nonlinear_viscous_friction", (500.0,)), 500.0 * SPEED_M_S**2),
        (with_speed(6.0), 6.0),
        (thinning(500.0), 500.0 * SPEED_M_S**2),
    ],
    ids=["quadratic", "by direction", "thinning"],
)
def test_a_share_of_all_friction_pulls_at_the_table(active, drag_n) -> None:
    """At a steady speed the spring holds what the guideways take."""
    stiffness_n_m, share, friction_n = 2e5, 0.6, 2.0 * COULOMB_N + drag_n
    axis = Twin(
        Physics(two_mass(60.0, 40.0, stiffness_n_m, 0.1, LINEAR_LEAD_M), COULOMB_N, VISCOUS_N_S_M, linear=True),
        GAINS,
        (active, Active("table_side_friction", (share,))),
    )
    found = axis.drive(np.full(10_000, friction_n))
    assert speeds(found)[-1] == pytest.approx(SPEED_M_S, rel=1e-4)
    assert found.motor_position[-1] - found.table_position_m[-1] == pytest.approx(
        share * friction_n / stiffness_n_m, rel=1e-4
    )


@pytest.mark.parametrize(
    ("coulomb", "more", "viscous"), [(0.0, 0.6, 0.6), (0.5, 0.4, 0.7), (0.5, -0.4, 0.3), (0.5, -1.0, 0.0)]
)
def test_viscous_friction_pulls_at_the_table_with_a_share_of_its_own(coulomb, more, viscous) -> None:
    """At a steady speed the spring holds it; viscous friction equals Coulomb friction there."""
    stiffness_n_m = 2e5
    axis = Twin(
        Physics(two_mass(60.0, 40.0, stiffness_n_m, 0.1, LINEAR_LEAD_M), COULOMB_N, VISCOUS_N_S_M, linear=True),
        GAINS,
        (Active("table_side_friction", (coulomb,)), Active("table_side_viscous_friction", (more,))),
    )
    found = axis.drive(np.full(10_000, 2.0 * COULOMB_N))
    assert speeds(found)[-1] == pytest.approx(SPEED_M_S, rel=1e-4)
    assert found.motor_position[-1] - found.table_position_m[-1] == pytest.approx(
        (coulomb + viscous) * COULOMB_N / stiffness_n_m, rel=1e-4
    )


@pytest.mark.parametrize("more", [0.0, -0.5])
def test_without_viscous_friction_on_the_table_nothing_changes(more) -> None:
    force = 60.0 * np.sin(np.arange(2000) * GAINS.period_s * 2.0 * np.pi)
    plain = twin().drive(force).motor_position
    found = twin(Active("table_side_viscous_friction", (more,))).drive(force).motor_position
    np.testing.assert_allclose(found, plain, rtol=0.0, atol=1e-15)


def test_what_drifts_scales_drag_too() -> None:
    warm = Active("friction_drift", (0.5, 1e-3))
    quadratic = Active("nonlinear_viscous_friction", (500.0,))
    found = twin(quadratic, warm).drive(np.full(10_000, 1.5 * (2.0 * COULOMB_N + 500.0 * SPEED_M_S**2)))
    assert speeds(found)[-1] == pytest.approx(SPEED_M_S, rel=1e-4)


@pytest.mark.parametrize(
    "contact",
    [(), (Active("presliding_hysteresis", (4e6,)),), (Active("presliding_hysteresis", (4e6,), 1),)],
    ids=["rigid", "elastic", "slips"],
)
@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
@pytest.mark.parametrize(
    "active",
    [Active("nonlinear_viscous_friction", (1e4,)), thinning(1e4), with_speed(15.0)],
    ids=["quadratic", "thinning", "by direction"],
)
def test_drag_on_a_swinging_table_takes_energy_and_gives_none(active, share, contact) -> None:
    """Motor and table are made to swing against each other, without damping in the spring, and left alone."""
    motor_kg, table_kg, stiffness_n_m = 60.0, 40.0, 2e5
    axis = Twin(
        Physics(two_mass(motor_kg, table_kg, stiffness_n_m, 0.0, LINEAR_LEAD_M), COULOMB_N, VISCOUS_N_S_M, linear=True),
        GAINS,
        (active, Active("table_side_friction", (share,)), *contact),
    )
    time_s = np.arange(1000) * GAINS.period_s
    resonance_rad_s = np.sqrt(stiffness_n_m * (1.0 / motor_kg + 1.0 / table_kg))
    found = axis.drive(np.where(time_s < 0.3, 1500.0 * np.sin(resonance_rad_s * time_s), 0.0))
    motor_m, table_m = found.motor_position, found.table_position_m
    energy = (
        0.5 * motor_kg * np.gradient(motor_m, GAINS.period_s) ** 2
        + 0.5 * table_kg * np.gradient(table_m, GAINS.period_s) ** 2
        + 0.5 * stiffness_n_m * (table_m - motor_m) ** 2
    )
    alone = energy[305:]
    assert np.all(np.isfinite(energy))
    assert alone[0] > 5.0
    assert alone.max() < 1.02 * alone[0]
    assert alone[-100:].max() < 0.5 * alone[0]


@pytest.mark.parametrize("variant", [0, 1], ids=["Dahl", "Maxwell slip"])
@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_a_contact_yields_on_both_sides_before_it_slides(share, variant) -> None:
    """Far below Coulomb friction the contacts of motor and table are springs beside and behind that of the screw."""
    contact_n_m, screw_n_m, force_n = 4e6, 2e6, 0.002 * COULOMB_N
    axis = Twin(
        Physics(two_mass(60.0, 40.0, screw_n_m, 0.2, LINEAR_LEAD_M), COULOMB_N, VISCOUS_N_S_M, linear=True),
        GAINS,
        (Active("presliding_hysteresis", (contact_n_m,), variant), Active("table_side_friction", (share,))),
    )
    found = axis.drive(force_n * np.minimum(np.arange(4000) / 2000.0, 1.0))
    on_motor, on_table = (1.0 - share) * contact_n_m, share * contact_n_m
    held = on_motor + (1.0 / (1.0 / screw_n_m + 1.0 / on_table) if on_table else 0.0)
    motor_m, table_m = (float(np.mean(part[-1000:])) for part in (found.motor_position, found.table_position_m))
    assert motor_m == pytest.approx(force_n / held, rel=5e-3)
    assert table_m == pytest.approx(force_n / held * screw_n_m / (screw_n_m + on_table), rel=5e-3)
