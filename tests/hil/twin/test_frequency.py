"""Natural, recursive and modal transfer functions agree; time and frequency domain agree; the cascade."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from hil.control import cascade
from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1, seven_dof, two_mass
from hil.twin.structure.frequency import (
    bandwidth_hz,
    closed_loop,
    modal_damping,
    modal_transfer,
    natural_transfer,
    sampled_closed_loop,
    sampled_transfer,
)
from hil.twin.structure.modal import Modal, discretise, modal
from hil.validation.paper.formulas import recursive_transfer

LEAD_M = 0.010
R = LEAD_M / (2.0 * pi)
CHAINS = {
    "2-dof": two_mass(335.0, 384.0, 5.64e7, 0.03, LEAD_M),
    "7-dof": seven_dof(RECONSTRUCTED_TABLE_1, 0.03),
}
FREQUENCY_HZ = np.geomspace(1.0, 4000.0, 3000)  # rigid body to above the highest mode


def make_gains(**changes) -> cascade.Gains:
    table_2 = {
        "position_gain_1_s": 36.84,
        "velocity_gain_n_m_s_rad": 20e-3 * 1.4 * 60 / (2 * pi),  # Kp Kt
        "velocity_integral_time_s": 6.2e-3,
        "ratio_m_rad": R,
    }
    return cascade.make_gains(**(table_2 | changes))


@pytest.mark.parametrize("name", CHAINS)
def test_natural_and_modal_transfer_functions_agree(name: str) -> None:
    chain = CHAINS[name]
    modes = modal(chain)
    natural = natural_transfer(chain, modal_damping(chain, modes), FREQUENCY_HZ)
    for found, expected in zip(modal_transfer(modes, FREQUENCY_HZ), natural, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("nut_position_m", [0.0, 0.2, 0.4])
def test_the_corrected_recursion_agrees_with_matrix_and_modes(nut_position_m: float) -> None:
    """Dampers c = beta k beside every spring give the modal damping xi = beta w / 2 exactly."""
    beta_s = 2e-5
    chain = seven_dof(RECONSTRUCTED_TABLE_1, 0.0, nut_position_m)
    inertias, stiffnesses = RECONSTRUCTED_TABLE_1.reduced(nut_position_m)
    modes = modal(chain)
    modes = replace(modes, damping_ratio=beta_s * modes.frequency_rad_s / 2.0)
    recursive = recursive_transfer(inertias, stiffnesses, beta_s * stiffnesses, FREQUENCY_HZ)
    natural = natural_transfer(chain, beta_s * chain.stiffness_n_m_rad, FREQUENCY_HZ)
    modal_form = modal_transfer(modes, FREQUENCY_HZ)
    for a, b, c in zip(recursive, natural, modal_form, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9)
        np.testing.assert_allclose(c, b, rtol=1e-9)


def test_the_recursion_takes_a_damper_of_its_own_for_every_spring() -> None:
    """Only (c_t3 + c_t5) s in TF_3-4, not the printed c_t5 s, agrees with the matrix form."""
    chain = CHAINS["7-dof"]
    inertias, stiffnesses = RECONSTRUCTED_TABLE_1.reduced()
    damping = np.array([0.5, 0.2, 0.9, 0.1, 0.3, 0.04])
    # the matrices of dampers and springs have one pattern: put the dampers in the springs' place
    springs = np.array(
        [
            [1, -1, 0, 0, 0, 0, 0],
            [0, 1, -1, 0, 0, 0, 0],
            [0, 0, 1, -1, 0, 0, 0],
            [0, 0, 0, 0, 1, 0, 0],
            [0, 0, 0, 1, 1, -1, 0],
            [0, 0, 0, 0, 0, 1, -1],
        ],
        dtype=float,
    )
    matrix = springs.T @ np.diag(damping) @ springs
    recursive = recursive_transfer(inertias, stiffnesses, damping, FREQUENCY_HZ)
    for a, b in zip(recursive, natural_transfer(chain, matrix, FREQUENCY_HZ), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9)


def test_two_dof_transfer_functions_are_eq_3_and_eq_11() -> None:
    modes = modal(CHAINS["2-dof"])
    m1, m2, k, xi = 335.0, 384.0, 5.64e7, 0.03
    s = 2j * pi * FREQUENCY_HZ
    w = np.sqrt(k * (m1 + m2) / (m1 * m2))
    c = 2 * xi * k / w  # the damper of Eq. 3 that gives the modal damping of Eq. 9
    tf1, tf2 = modal_transfer(modes, FREQUENCY_HZ)
    eq_3 = (m2 * s**2 + c * s + k) / (s**2 * (m1 * m2 * s**2 + (m1 + m2) * (c * s + k)))
    np.testing.assert_allclose(tf1 * R**2, eq_3, rtol=1e-9)
    np.testing.assert_allclose(tf2, (c * s + k) / (m2 * s**2 + c * s + k), rtol=1e-9)
    rm = m2 / m1
    eq_11 = (2 * xi * w * s + w**2) / ((1 + rm) * s**2 + 2 * xi * w * s + w**2)
    np.testing.assert_allclose(tf2, eq_11, rtol=1e-9)


def sine_gain(signal: np.ndarray, time_s: np.ndarray, frequency_hz: float, drift: bool) -> complex:
    """Complex amplitude of a sine in a signal; `drift` allows for the rigid body's offset and ramp."""
    basis = [np.cos(2 * pi * frequency_hz * time_s), np.sin(2 * pi * frequency_hz * time_s)]
    if drift:
        basis += [np.ones_like(time_s), time_s]
    cosine, sine = np.linalg.lstsq(np.column_stack(basis), signal, rcond=None)[0][:2]
    return sine + 1j * cosine


def drive_modes(modes: Modal, torque: np.ndarray, period_s: float) -> np.ndarray:
    """(k, 2) motor and table angle at the start of each period in which torque[k] is held."""
    d = discretise(modes, period_s)
    delta, speed = np.zeros((2, modes.frequency_rad_s.size))
    force = modes.shape[modes.motor]
    answer = np.empty((torque.size, 2))
    for k, value in enumerate(torque):
        answer[k] = modes.shape[modes.motor] @ delta, modes.shape[modes.table] @ delta
        delta, speed = (
            d.a11 * delta + d.a12 * speed + d.b1 * force * value,
            d.a21 * delta + d.a22 * speed + d.b2 * force * value,
        )
    return answer


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("frequency_hz", [20.0, 70.0, 100.0, 250.0])
def test_discretised_modes_driven_by_a_sine_answer_as_the_frequency_response_says(name, frequency_hz) -> None:
    modes, period_s = modal(CHAINS[name]), 1e-3
    time_s = np.arange(4000) * period_s
    answer = drive_modes(modes, np.sin(2 * pi * frequency_hz * time_s), period_s)
    late = time_s > 2.0  # the slowest elastic mode has died away: exp(-0.03 * 2 pi 89 * 2) = 2e-15
    z = np.exp(2j * pi * np.array([frequency_hz]) * period_s)
    for column, expected in enumerate(sampled_transfer(modes, period_s, z)):
        found = sine_gain(answer[late, column], time_s[late], frequency_hz, drift=True)
        assert abs(found / expected[0] - 1.0) < 1e-6


def test_with_a_short_period_the_sampled_response_is_the_continuous_one_behind_a_hold() -> None:
    modes, period_s = modal(CHAINS["7-dof"]), 1e-5
    frequency_hz = np.geomspace(5.0, 500.0, 50)
    motor, table = sampled_transfer(modes, period_s, np.exp(2j * pi * frequency_hz * period_s))
    hold = np.sinc(frequency_hz * period_s) * np.exp(-1j * pi * frequency_hz * period_s)
    tf1, tf2 = modal_transfer(modes, frequency_hz)
    np.testing.assert_allclose(motor, tf1 * hold, rtol=1e-4)
    np.testing.assert_allclose(table, tf1 * tf2 * hold, rtol=1e-4)


def simulate_cascade(modes: Modal, gains: cascade.Gains, frequency_hz: float, delay_ticks: int) -> complex:
    """Drive the closed loop with a sine through the control law itself; complex gain to the table."""
    d = discretise(modes, gains.period_s)
    delta, speed = np.zeros((2, modes.frequency_rad_s.size))
    time_s = np.arange(8000) * gains.period_s
    w = 2 * pi * frequency_hz
    state, waiting = cascade.init(0.0), [0.0] * delay_ticks
    table = np.empty(time_s.size)
    for k, t in enumerate(time_s):
        motor_rad, table[k] = modes.shape[modes.motor] @ delta, R * (modes.shape[modes.table] @ delta)
        command, velocity = 1e-3 * np.sin(w * t), 1e-3 * w * np.cos(w * t)
        state, outputs = cascade.step(gains, state, cascade.Inputs(command, velocity, motor_rad, table[k]))
        waiting.append(outputs.torque_n_m)
        force = modes.shape[modes.motor] * waiting.pop(0)
        delta, speed = (
            d.a11 * delta + d.a12 * speed + d.b1 * force,
            d.a21 * delta + d.a22 * speed + d.b2 * force,
        )
    late = time_s >= 4.0
    return sine_gain(table[late], time_s[late], frequency_hz, drift=False) / 1e-3


@pytest.mark.parametrize(
    ("name", "changes", "delay_ticks"),
    [
        ("2-dof", {}, 0),
        ("7-dof", {"position_from_table": True}, 0),
        ("7-dof", {"velocity_feedforward": 0.0, "two_sample_mean": True}, 1),
        ("2-dof", {"velocity_filter_time_constant_s": 4e-4, "velocity_integral_time_s": None}, 0),
    ],
)
def test_the_simulated_loop_answers_as_the_frequency_response_says(name, changes, delay_ticks) -> None:
    modes, gains = modal(CHAINS[name]), make_gains(**changes)
    frequency_hz = np.array([4.0, 30.0])
    expected = sampled_closed_loop(modes, gains, frequency_hz, delay_ticks)
    for f, value in zip(frequency_hz, expected, strict=True):
        # four seconds hold whole periods of 4 and 30 Hz: the images beside the sine fall out
        assert abs(simulate_cascade(modes, gains, float(f), delay_ticks) / value - 1.0) < 1e-6


def test_the_position_loop_of_table_2_has_a_bandwidth_of_6_6_hz_without_feed_forward() -> None:
    """The source prints 2.32 Hz, which its own gains do not give."""
    frequency_hz = np.geomspace(0.1, 400.0, 4000)
    without = make_gains(velocity_feedforward=0.0)
    two, seven = (
        bandwidth_hz(frequency_hz, closed_loop(modal(CHAINS[name]), without, frequency_hz))
        for name in ("2-dof", "7-dof")
    )
    assert two == pytest.approx(6.55, abs=0.05)
    assert seven == pytest.approx(two, rel=0.03)  # "the bandwidth ... is the same in the two models"
    with_feedforward = closed_loop(modal(CHAINS["2-dof"]), make_gains(), frequency_hz)
    assert bandwidth_hz(frequency_hz, with_feedforward) > 5.0 * two


def test_bandwidth_of_a_first_order_lag_is_its_corner_and_nan_where_it_never_falls() -> None:
    frequency_hz = np.geomspace(0.1, 100.0, 2000)
    assert bandwidth_hz(frequency_hz, 1.0 / (1.0 + 1j * frequency_hz / 7.0)) == pytest.approx(7.0, rel=1e-4)
    assert np.isnan(bandwidth_hz(frequency_hz, np.ones(2000, dtype=complex)))
