"""Effects between motor and table, and the mode the chain has not: one decisive physical fact each."""

from __future__ import annotations

import numpy as np
import pytest
from sim_tools import plant_with

from drivers.sim.axis import AxisTruth, seven_dof, two_mass
from drivers.sim.effects import Effect
from drivers.sim.plant import Plant

R = 0.01 / (2 * np.pi)
K = 5.64e7
FREE = {"coulomb_torque_n_m": 0.0, "viscous_torque_n_m_s_rad": 0.0}
HELD_TABLE = Effect("table_side_friction", {"share": 1.0})


def pressed_stretch_m(torque_n_m: float, *effects: Effect, position_m: float = 0.0) -> float:
    """Stretch when the motor presses on a table that strong friction holds still."""
    plant = plant_with(two_mass(coulomb_torque_n_m=50.0, viscous_torque_n_m_s_rad=0.0), HELD_TABLE, *effects)
    plant.reset(position_m)
    table = plant.table_true_m
    for torque in np.linspace(0.0, torque_n_m, 200):
        plant.advance(torque, 1e-3)
    plant.advance(torque_n_m, 1.5)
    assert plant.table_true_m == table
    return float(plant.positions_m[0]) - position_m


@pytest.mark.parametrize("axis", [two_mass, seven_dof])
def test_backlash_leaves_the_table_while_the_motor_reverses_by_the_gap(axis: type[AxisTruth]) -> None:
    """The table, held by friction F, starts back only after gap + 2 F / k of motor travel."""

    def lost_motion_m(*effects: Effect) -> float:
        plant = plant_with(axis(viscous_torque_n_m_s_rad=0.0), HELD_TABLE, *effects)
        turned = 0.0
        for direction in (1, -1):  # quasi-static: torque ramps up to just under and then over the friction
            for torque in np.linspace(0.0, direction * 1.2, 6000):
                table = plant.table_true_m
                plant.advance(torque, 2e-4)
                if direction * (plant.table_true_m - table) > 0:
                    break
            if direction > 0:
                turned = float(plant.positions_m[0])
                plant.advance(1.05, 0.2)  # comes to rest against the contact
                turned = float(plant.positions_m[0])
        return turned - float(plant.positions_m[0])

    play = lost_motion_m(Effect("backlash", {"gap_m": 30e-6})) - lost_motion_m()
    assert play == pytest.approx(30e-6, rel=0.02)


def test_backlash_lets_the_table_coast_without_force() -> None:
    plant = plant_with(two_mass(**FREE), Effect("backlash", {"gap_m": 1e-3}))
    plant.velocities_m_s[1] = 0.01
    plant.advance(0.0, 0.04)
    assert plant.velocities_m_s.tolist() == [0.0, 0.01]
    plant.advance(0.0, 0.2)
    assert plant.velocities_m_s[0] > 0.0  # met the flank and dragged the motor


def test_seven_dof_backlash_is_free_in_the_gap() -> None:
    plant = plant_with(seven_dof(**FREE), Effect("backlash", {"gap_m": 1e-3}))
    plant.velocities_m_s[5:] = 0.01  # nut and table glide together
    plant.advance(0.0, 0.04)
    assert plant.velocities_m_s[[0, 1, 2, 3]] == pytest.approx(np.zeros(4), abs=1e-9)
    assert plant.velocities_m_s[5:] == pytest.approx([0.01, 0.01], abs=1e-9)


def test_backlash_contact_does_not_create_energy() -> None:
    plant = plant_with(two_mass(**FREE), Effect("backlash", {"gap_m": 2e-5}))
    plant.velocities_m_s[:] = (0.02, -0.02)
    mass = np.array([335.0, 384.0])
    last = 0.5 * mass @ plant.velocities_m_s**2
    momentum = mass @ plant.velocities_m_s
    for _ in range(300):
        plant.advance(0.0, 1e-3)
        stretch = abs(plant.positions_m[0] - plant.positions_m[1]) - 1e-5
        now = 0.5 * mass @ plant.velocities_m_s**2 + 0.5 * K * max(stretch, 0.0) ** 2
        assert now <= last * (1 + 0.01)
        last = min(last, now)
    assert last < 0.05  # of 0.14 J, damped by the contacts
    assert mass @ plant.velocities_m_s == pytest.approx(momentum, abs=1e-9)


def test_preload_loss_is_soft_about_zero_and_stiff_beyond() -> None:
    loss = Effect("preload_loss", {"zone_m": 4e-6, "stiffness_ratio": 0.25})
    inside_n_m = 0.2 * K * 4e-6 / 2 * 0.25 * R
    assert pressed_stretch_m(inside_n_m, loss) == pytest.approx(0.2 * 2e-6, rel=1e-3)
    assert pressed_stretch_m(-inside_n_m, loss) == pytest.approx(-0.2 * 2e-6, rel=1e-3)
    assert pressed_stretch_m(2.0, loss) == pytest.approx(2.0 / R / K + 0.75 * 2e-6, rel=1e-3)


def test_position_dependent_stiffness_changes_along_the_travel() -> None:
    slope = Effect("position_dependent_stiffness", {"relative_slope": -1.5})
    assert pressed_stretch_m(2.0, slope, position_m=0.2) == pytest.approx(2.0 / R / (0.7 * K), rel=1e-3)
    assert pressed_stretch_m(2.0, slope) == pytest.approx(2.0 / R / K, rel=1e-3)


def coasting(*effects: Effect, speed_m_s: float = 0.005) -> Plant:
    """Runs on without friction; vibrations from the start die out within 0.5 s."""
    plant = plant_with(two_mass(**FREE), *effects)
    plant.velocities_m_s[:] = speed_m_s
    plant.advance(0.0, 0.5)
    return plant


def test_periodic_lead_error_repeats_every_revolution() -> None:
    effect = Effect("periodic_lead_error", dict(amplitude_m=6e-6, phase_rad=1.5, amplitude_3_m=1e-6, phase_3_rad=0.2))
    plant = coasting(effect)
    for _ in range(200):
        plant.advance(0.0, 0.02)
        angle = plant.motor_true_rad
        expected = 6e-6 * np.sin(angle + 1.5) + 1e-6 * np.sin(3 * angle + 0.2)
        assert plant.table_true_m - R * angle == pytest.approx(expected, abs=3e-8)
    assert plant.motor_true_rad > 4 * np.pi


def test_cumulative_lead_error_grows_along_the_travel() -> None:
    plant = coasting(Effect("cumulative_lead_error", {"slope_m_m": 8e-5}), speed_m_s=0.1)
    plant.advance(0.0, 2.0)
    x = R * plant.motor_true_rad
    assert x > 0.2
    assert plant.table_true_m - x == pytest.approx(8e-5 * x, rel=1e-3)


@pytest.mark.parametrize("bearing_m", [0.0, -0.3])
def test_thermal_growth_scales_the_way_from_the_bearing_with_time(bearing_m: float) -> None:
    effect = Effect("thermal_growth", {"relative_growth": 1e-4, "time_constant_s": 3.0, "bearing_m": bearing_m})
    plant = coasting(effect, speed_m_s=0.1)
    plant.advance(0.0, 2.5)
    x = R * plant.motor_true_rad
    assert plant.table_true_m - x == pytest.approx(1e-4 * (1 - np.exp(-1)) * (x - bearing_m), rel=5e-3)


@pytest.mark.parametrize("form", ["attached", "base"])
def test_structural_mode_adds_its_mode(form: str) -> None:
    """Free vibration on each mode of the three-mass system, written down here by hand."""
    omega_extra, extra = 2 * np.pi * 60.0, 0.3 * 384.0
    mode = Effect("structural_mode", dict(frequency_hz=60.0, damping_ratio=0.0, mass_ratio=0.3), form)
    mass = np.array([335.0, 384.0, extra])
    nut = np.array([1.0, -1.0, 0.0 if form == "attached" else 1.0])
    foot = np.array([0.0, 1.0, -1.0]) if form == "attached" else np.array([0.0, 0.0, 1.0])
    stiffness = K * np.outer(nut, nut) + extra * omega_extra**2 * np.outer(foot, foot)
    squares, shapes = np.linalg.eig(stiffness / mass[:, None])
    assert np.sum(squares.real > 1.0) == 2
    for square, shape in zip(squares.real, shapes.real.T, strict=True):
        if square < 1.0:
            continue
        omega = float(np.sqrt(square))
        plant = plant_with(two_mass(damping_ratio=0.0, **FREE), mode)
        plant.positions_m[:] = 1e-5 * shape
        plant.velocities_m_s[:] = 1e-5 * shape * omega * np.sin(omega * 5e-6)
        for _ in range(50):
            plant.advance(0.0, 1e-3)
            assert plant.positions_m == pytest.approx(1e-5 * shape * np.cos(omega * plant.time_s), abs=5e-8)
            seen = plant.table_true_m - (plant.positions_m[2] if form == "base" else 0.0)
            assert plant.table_position_m == pytest.approx(seen, abs=1e-15)


def test_structural_mode_is_damped_at_its_ratio() -> None:
    """Attached to a table that friction holds, the extra mass is a single oscillator."""
    mode = Effect("structural_mode", dict(frequency_hz=40.0, damping_ratio=0.05))
    plant = plant_with(two_mass(coulomb_torque_n_m=50.0), HELD_TABLE, mode)
    plant.positions_m[2] = 1e-5
    omega = 2 * np.pi * 40.0
    plant.advance(0.0, round(4 * 2 * np.pi / (omega * np.sqrt(1 - 0.05**2)) / 1e-5) * 1e-5)
    assert plant.positions_m[2] == pytest.approx(1e-5 * np.exp(-0.05 * omega * plant.time_s), rel=0.01)
