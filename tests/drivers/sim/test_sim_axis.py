"""The chain itself: frequencies, energy, damping, static stiffness, stiction, convergence, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from sim_tools import PERFECT, plant_with

from drivers.sim.axis import AxisTruth, one_mass, serial_chain, seven_dof, two_mass
from drivers.sim.effects import Effect
from drivers.sim.plant import Plant

FREE = {"coulomb_torque_n_m": 0.0, "viscous_torque_n_m_s_rad": 0.0}


def eigenmode(axis: AxisTruth, index: int) -> tuple[float, np.ndarray]:
    """omega and shape from a generalised eigenvalue problem solved the other way round: M^-1 K, unsymmetric."""
    mass, _, stiffness = axis.matrices()
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    order = np.argsort(squares.real)
    return float(np.sqrt(squares.real[order[index]])), shapes[:, order[index]].real


def start_on_mode(plant: Plant, omega: float, shape: np.ndarray, amplitude_m: float = 1e-5) -> None:
    plant.positions_m[:] = amplitude_m * shape
    plant.velocities_m_s[:] = amplitude_m * shape * omega * np.sin(omega * plant.step_s / 2)  # half a step earlier


def energy(plant: Plant, stiffness: np.ndarray) -> float:
    """At the time of the positions: the velocity there is the mean of those half a step before and after."""
    q, before = plant.positions_m.copy(), plant.velocities_m_s.copy()
    mass = plant.parameters["mass"][0, : q.size]
    v = before - 0.5 * plant.step_s * (stiffness @ q) / mass
    return 0.5 * float(v @ (mass * v) + q @ stiffness @ q)


def test_two_masses_vibrate_at_89_4_hz_and_keep_their_energy() -> None:
    axis = two_mass(damping_ratio=0.0, **FREE)
    omega, shape = eigenmode(axis, 1)
    assert omega / (2 * np.pi) == pytest.approx(89.4, abs=0.05)  # Eq. 2
    plant = plant_with(axis)
    start_on_mode(plant, omega, shape)
    start = energy(plant, axis.matrices()[2])
    worst = 0.0
    for _ in range(500):
        plant.advance(0.0, 1e-3)
        worst = max(worst, abs(energy(plant, axis.matrices()[2]) / start - 1))
        expected = 1e-5 * shape * np.cos(omega * plant.time_s)
        assert plant.positions_m == pytest.approx(expected, abs=1e-8)  # 0.1 % after 45 periods
    assert worst < 1e-4


def test_seven_dof_has_the_frequencies_of_eq_20_in_time() -> None:
    axis = seven_dof(damping_ratio=0.0, **FREE)
    printed_hz = (144, 432, 870, 2474, 2909, 3900)
    assert axis.frequencies_hz()[0] == pytest.approx(0.0, abs=1e-3)
    assert axis.frequencies_hz()[1:] == pytest.approx(printed_hz, rel=2.5e-3)
    for index in range(1, 7):
        omega, shape = eigenmode(axis, index)
        plant = plant_with(axis, step_s=1e-6)
        start_on_mode(plant, omega, shape)
        for _ in range(20):
            plant.advance(0.0, 5e-4)
            assert plant.positions_m == pytest.approx(1e-5 * shape * np.cos(omega * plant.time_s), abs=2e-7)


@pytest.mark.parametrize("axis", [
    two_mass(**FREE),
    seven_dof(**FREE),
    serial_chain((300.0, 50.0, 200.0), (9e7, 7e7), damping_ratio=0.05, **FREE),
    serial_chain((300.0, 50.0, 200.0), (9e7, 7e7), damping_ratio=None, stiffness_damping_s=2e-4, nut_spring=0, **FREE),
    serial_chain((300.0, 50.0, 200.0), (9e7, 7e7), damping_ratio=None, mass_damping_1_s=20.0, **FREE),
])  # fmt: skip
def test_damping_decays_each_mode_at_its_rate(axis: AxisTruth) -> None:
    for index in range(1, min(len(axis.mass_kg), 4)):
        omega, shape = eigenmode(axis, index)
        zeta = (
            axis.damping_ratio
            if axis.damping_ratio is not None
            else 0.5 * (axis.mass_damping_1_s / omega + axis.stiffness_damping_s * omega)
        )
        plant = plant_with(axis, step_s=1e-6)
        start_on_mode(plant, omega, shape)
        whole_periods = 3
        plant.advance(0.0, round(whole_periods * 2 * np.pi / (omega * np.sqrt(1 - zeta**2)) / 1e-6) * 1e-6)
        remaining = (plant.positions_m @ shape) / (1e-5 * shape @ shape)
        assert remaining == pytest.approx(np.exp(-zeta * omega * plant.time_s), rel=0.02)


def test_static_stiffness_of_seven_dof_is_that_of_springs_in_series() -> None:
    """Motor pressed against a table that friction holds: 1/k sums over all springs, about 4.4e7 N/m."""
    axis = seven_dof(damping_ratio=0.1, coulomb_torque_n_m=50.0, viscous_torque_n_m_s_rad=0.0)
    plant = plant_with(axis, Effect("table_side_friction", {"share": 1.0}))
    plant.advance(1.0, 3.0)
    force_n = 1.0 / axis.screw_ratio_m_rad
    square = axis.screw_ratio_m_rad**2
    compliance = square / 3.94e4 + square / 1.1e4 + square / 4.17e3 + 1 / 1.96e8 + 1 / 6.4e8 + 1 / 6.53e7
    assert plant.table_true_m == 0.0
    assert plant.positions_m[0] == pytest.approx(force_n * compliance, rel=1e-6)
    assert 1 / compliance == pytest.approx(4.4e7, rel=0.02)


def test_stiction_holds_exactly_and_gives_way_beyond_the_coulomb_torque() -> None:
    plant = Plant(two_mass(), PERFECT)
    for torque in (1.0999, -1.0999, 0.3):
        plant.advance(torque, 1.0)
        assert plant.motor_true_rad == 0.0
        assert plant.motor_velocity_true_rad_s == 0.0
        assert plant.table_true_m == 0.0
    plant.advance(1.11, 0.1)
    assert plant.motor_true_rad > 0.0


def test_coasting_stops_in_finite_time_and_stays() -> None:
    """Rigid motion under Coulomb friction alone: stops after v m r / Fc, having gone v^2 m r / 2 Fc."""
    axis = two_mass(viscous_torque_n_m_s_rad=0.0)
    plant = plant_with(axis)
    plant.velocities_m_s[:] = 0.1
    momentum_s = 0.1 * (335 + 384) * axis.screw_ratio_m_rad / 1.1
    plant.advance(0.0, 2.0)
    stopped = plant.motor_true_rad
    assert plant.positions_m[0] == pytest.approx(0.5 * 0.1 * momentum_s, rel=1e-2)
    plant.advance(0.0, 1.0)
    assert plant.motor_true_rad == stopped


def test_terminal_speed_of_one_mass() -> None:
    axis = one_mass()
    plant = plant_with(axis)
    plant.advance(60.0, 5.0)
    assert plant.motor_velocity_true_rad_s == pytest.approx((60.0 - 20.394) / 203.5, rel=1e-4)
    assert plant.motor_position_rad == plant.positions_m[0]  # metres on a linear axis


def test_smaller_steps_converge() -> None:
    """Stick, slip and reversal under a smooth torque: errors against 1 us fall with the step."""

    def final(step_s: float) -> np.ndarray:
        plant = plant_with(two_mass(), step_s=step_s)
        path = []
        for k in range(600):
            plant.advance(3.0 * np.sin(2 * np.pi * 5 * k * 1e-3), 1e-3)
            path.append((plant.motor_true_rad * 0.01 / (2 * np.pi), plant.table_true_m))
        return np.array(path)

    best = final(1e-6)
    errors = {step: float(np.max(np.abs(final(step) - best))) for step in (50e-6, 10e-6, 2e-6)}
    assert np.max(np.abs(best)) > 1e-3
    assert errors[50e-6] < 3e-6
    assert errors[10e-6] < errors[50e-6] / 3
    assert errors[2e-6] < errors[10e-6] / 3


def test_refuses_what_cannot_be() -> None:
    with pytest.raises(ValueError, match=r"step_s: must be <= .*3895 Hz"):
        Plant(seven_dof(), step_s=1e-4)
    with pytest.raises(ValueError, match="needs an axis with a table"):
        Plant(one_mass(), effects=[Effect("backlash", {"gap_m": 1e-5})])
    with pytest.raises(ValueError, match="whole multiple of step_s"):
        Plant(two_mass()).advance(0.0, 1.5e-5)
    with pytest.raises(ValueError, match="one value less than mass_kg"):
        serial_chain((1.0, 2.0), (1e6, 1e6))
    with pytest.raises(ValueError, match="mass_kg: must be finite and > 0"):
        two_mass(table_mass_kg=0.0)
