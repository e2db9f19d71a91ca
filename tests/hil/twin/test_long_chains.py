"""Damping of chains in the stepping kernel: where a lead errs, in play, with lost preload, with a structure."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from contributions import RATIO_M
from scipy.linalg import expm

from hil.control.cascade import make_gains
from hil.twin.axis import Start, Twin
from hil.twin.library import BY_ID
from hil.twin.physics import Active, Physics
from hil.twin.structure.ballscrew import RECONSTRUCTED_TABLE_1
from hil.twin.structure.chain import one_mass, seven_dof, two_mass
from hil.twin.structure.frequency import modal_damping
from hil.twin.structure.modal import modal

GAINS = make_gains(
    position_gain_1_s=10.0, velocity_gain_n_m_s_rad=0.1, ratio_m_rad=RATIO_M, velocity_integral_time_s=0.05
)
LONG = seven_dof(RECONSTRUCTED_TABLE_1, 0.05)


def twin(chain, *active):
    """An axis without friction."""
    return Twin(Physics(chain, 0.0, 0.0), GAINS, active)


def driven(chain, stiffness, damping, torque):
    """Table [m] of J q'' + C q' + K q = f by the matrix exponential, torques (n,) at the motor held for a tick each."""
    n, none = len(chain.names), np.zeros((len(chain.names),) * 2)
    slope = np.linalg.solve(
        np.block([[np.eye(n), none], [none, chain.inertia_kg_m2]]),
        np.block([[none, np.eye(n)], [-stiffness, -damping]]),
    )
    push = np.append(np.zeros(n), np.linalg.solve(chain.inertia_kg_m2, np.eye(n)[chain.motor]))
    moved = expm(np.pad(np.column_stack([slope, push]), ((0, 1), (0, 0))) * GAINS.period_s)
    state, table = np.zeros(2 * n), []
    for held in torque:
        table.append(state[chain.table] * RATIO_M)
        state = (moved @ np.append(state, held))[:-1]
    return np.array(table)


def off(found, expected):
    """Share of the motion from tick to tick by which two positions differ."""
    return np.std(np.diff(found) - np.diff(expected)) / np.std(np.diff(expected))


def test_a_lead_error_shakes_a_long_chain_as_its_equations_say() -> None:
    """At constant feed, D q = (K s + i w C s) e with the motor's own shaking given: all but the motor, harmonic by
    harmonic, s the table's side. The third harmonic runs close to the first mode."""
    chain, modes = LONG, modal(LONG)
    turns_hz, amplitude_m, period_s = 0.9 * modes.frequency_rad_s[1] / (6.0 * pi), 2e-6, 1e-3
    axis = Twin(
        Physics(chain, 0.0, 0.01),
        GAINS,
        (Active("periodic_lead_error", (amplitude_m, 0.3, 0.5 * amplitude_m, 1.0, 0.4 * amplitude_m, -2.0), 0),),
    )
    speed = 2.0 * pi * turns_hz * RATIO_M
    n = round(60.0 / turns_hz / period_s)
    time_s = period_s * np.arange(n)
    moved = axis.simulate(speed * time_s, np.full(n, speed), Start(0.0, speed))
    last = slice(-round(30.0 / turns_hz / period_s), None)
    angle, turned = moved.motor_position[last], 2.0 * pi * turns_hz * time_s[last]
    waves = np.column_stack([np.ones(angle.size), *(wave(k * angle) for k in (1, 2, 3) for wave in (np.cos, np.sin))])
    motor, table = (
        np.linalg.lstsq(waves, values[last] - turned, rcond=None)[0]
        for values in (moved.motor_position, moved.table_position_m / RATIO_M)
    )
    damping, side, rest = modal_damping(chain, modes), chain.side(chain.table), np.arange(7) != chain.motor
    for k, size, phase in ((1, 1.0, 0.3), (2, 0.5, 1.0), (3, 0.4, -2.0)):
        omega = 2.0 * pi * turns_hz * k
        dynamic = chain.stiffness_n_m_rad + 1j * omega * damping - omega**2 * chain.inertia_kg_m2
        error = size * amplitude_m / RATIO_M * np.exp(1j * (phase - 0.5 * pi))
        shaken, found = (values[2 * k - 1] - 1j * values[2 * k] for values in (motor, table))
        load = (chain.stiffness_n_m_rad + 1j * omega * damping) @ side * error - dynamic[:, chain.motor] * shaken
        expected = np.linalg.solve(dynamic[np.ix_(rest, rest)], load[rest])[-1]
        assert found == pytest.approx(expected, abs=0.05 * abs(expected))


@pytest.mark.parametrize("ratio", [0.1, 0.5])
def test_lost_preload_takes_its_share_of_the_damping_between_the_sides(ratio: float) -> None:
    """All of the motion lies in the soft zone: K' = K - (1 - rho) k t t', C' = C - (1 - rho) C s s' C / s' C s."""
    torque = 0.01 * np.random.default_rng(1).standard_normal(400)
    found = twin(LONG, Active("preload_loss", (1e-3, ratio), 0)).drive(torque)
    damping, side, at = modal_damping(LONG, modal(LONG)), LONG.side(LONG.table), LONG.transmission
    resisting = damping @ side
    expected = driven(
        LONG,
        LONG.stiffness_n_m_rad - (1.0 - ratio) * LONG.transmission_stiffness_n_m_rad * np.outer(at, at),
        damping - (1.0 - ratio) * np.outer(resisting, resisting) / (side @ resisting),
        torque,
    )
    assert off(found.table_position_m, expected) < 0.01


def test_a_table_that_floats_in_the_play_flies_on() -> None:
    """The motor is accelerated away from it: neither spring nor damper of the nut acts."""
    speed_m_s, gap_m = 0.1, 1e-3
    found = twin(LONG, Active("backlash", (gap_m,), 0)).drive(np.full(22, 2.0), Start(0.0, speed_m_s))
    ahead_m = RATIO_M * found.motor_position - found.table_position_m
    assert 0.4 * gap_m < ahead_m.max() < 0.5 * gap_m
    expected = found.table_position_m[0] + speed_m_s * GAINS.period_s * np.arange(ahead_m.size)
    np.testing.assert_allclose(found.table_position_m, expected, rtol=0.0, atol=0.03 * ahead_m.max())


def test_dry_flanks_hardly_pull() -> None:
    """A strongly damped nut, pressed together and let go: what slows the table before the other flank meets it."""
    gap_m, torque, slowed = 1e-4, np.repeat([2.0, -6.0], [30, 12]), []
    for variant in (0, 1):
        axis = seven_dof(RECONSTRUCTED_TABLE_1, 0.4)
        found = twin(axis, Active("backlash", (gap_m,), variant)).drive(torque)
        ahead_m = RATIO_M * found.motor_position - found.table_position_m
        slowed.append(-np.diff(found.table_position_m, 2)[ahead_m[2:] > -0.4 * gap_m].min())
    assert 0.0 < slowed[1] < 0.3 * slowed[0]


@pytest.mark.parametrize("structure", [(10.5, 0.00141, 6.53), (20.0, 0.01, 0.2)])
def test_one_mass_has_no_nut_whose_play_could_shake_it(structure: tuple[float, float, float]) -> None:
    torque = np.repeat([1.0, 0.0], [50, 5000])
    mode = Active("structural_mode", structure, 0)
    plain, with_play = (
        twin(one_mass(95.0, 0.01), mode, *more).drive(torque).motor_position
        for more in ((), (Active("backlash", (2e-5,), 0),))
    )
    np.testing.assert_allclose(with_play, plain, rtol=1e-9)


@pytest.mark.parametrize("structure", [(200.0, 0.9, 10.0), (400.0, 0.9, 3.0)])
def test_a_structure_damped_beyond_all_measure_stays_finite(structure: tuple[float, float, float]) -> None:
    chain = two_mass(335.0, 384.0, 5.64e7, 0.03, 0.010)
    longer = BY_ID["structural_mode"].variants[0].contribution(chain, structure)
    torque = np.random.default_rng(1).standard_normal(400)
    found = twin(chain, Active("structural_mode", structure, 0)).drive(torque).table_position_m
    expected = driven(longer, longer.stiffness_n_m_rad, longer.damping_n_m_s_rad, torque)
    assert off(found, expected) < 0.02


@pytest.mark.parametrize("variant", [0, 1])
def test_a_structure_close_to_the_mode_of_the_chain_shares_its_damping(variant: int) -> None:
    axis, structure = two_mass(335.0, 384.0, 5.64e7, 0.06, 0.010), (70.0, 0.005, 0.3)
    longer = BY_ID["structural_mode"].variants[variant].contribution(axis, structure)
    torque = np.random.default_rng(1).standard_normal(400)
    found = twin(axis, Active("structural_mode", structure, variant)).drive(torque).table_position_m
    expected = driven(longer, longer.stiffness_n_m_rad, longer.damping_n_m_s_rad, torque)
    assert off(found, expected) < 0.003


def test_a_motor_feels_the_ratio_that_a_lead_error_varies() -> None:
    """Virtual work: a force F on the table takes the torque F (r + de/dq) of a motor at constant feed."""
    amplitude_m, force_n, speed, rows = 1e-5, 100.0, 2.0 * RATIO_M, 6000
    error = Active("periodic_lead_error", (0.0, 0.0, amplitude_m, 0.5, 0.0, 0.0), 0)
    time_s = GAINS.period_s * np.arange(rows)
    axis = replace(twin(two_mass(400.0, 100.0, 1e8, 0.05, 2.0 * pi * RATIO_M), error), push_n=np.full(rows, -force_n))
    moved = axis.simulate(speed * time_s, np.full(rows, speed), Start(0.0, speed))
    settled = slice(2000, None)
    angle, torque = moved.motor_position[settled], moved.torque[settled]
    expected = force_n * (RATIO_M + 2.0 * amplitude_m * np.cos(2.0 * angle + 0.5))
    np.testing.assert_allclose(torque, expected, rtol=1e-3)
