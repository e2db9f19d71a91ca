"""Effects of the drive and of the sensors, and the sensors themselves: one decisive fact each."""

from __future__ import annotations

import numpy as np
import pytest
from sim_tools import PERFECT, outer_force_n, plant_with

from drivers.sim.axis import one_mass, two_mass
from drivers.sim.effects import Effect
from drivers.sim.plant import Plant
from drivers.sim.sensors import Sensors

R = 0.01 / (2 * np.pi)
FREE = two_mass(coulomb_torque_n_m=0.0, viscous_torque_n_m_s_rad=0.0)


def torque_and_current(effect: Effect, command_n_m: float, angle_rad: float = 0.0) -> tuple[float, float]:
    """Mechanical torque from the momentum, and the torque channel."""
    plant = plant_with(FREE, effect)
    return outer_force_n(plant, torque_n_m=command_n_m, position_m=angle_rad * R) * R, plant.torque_n_m


def test_torque_ripple_is_unseen_by_the_current() -> None:
    ripple = Effect("torque_ripple", {"fraction": 0.1, "cycles_per_rev": 6})
    torque, current = torque_and_current(ripple, 2.0, 0.4)
    assert torque == pytest.approx(2.0 * (1 + 0.1 * np.sin(2.4)), rel=1e-9)
    assert current == 2.0


def test_torque_constant_is_straight_along_the_travel() -> None:
    effect = Effect("torque_constant_gradient", {"slope_1_m": -2.0})
    for x, share in ((0.1, 0.8), (-0.1, 1.2), (0.0, 1.0), (0.6, 0.0)):
        torque, current = torque_and_current(effect, 3.0, x / R)
        assert torque == pytest.approx(3.0 * share, rel=1e-9, abs=1e-12)
        assert current == 3.0


@pytest.mark.parametrize(("x", "share"), [(0.05, 1.0), (0.1, 0.9), (0.15, 0.8), (0.205, 0.95), (0.25, 1.0)])
def test_a_torque_constant_is_lower_in_a_zone(x: float, share: float) -> None:
    zone = {"fraction": -0.2, "begin_m": 0.1, "end_m": 0.2, "flank_m": 0.02}
    torque, current = torque_and_current(Effect("local_torque_constant", zone), 3.0, x / R)
    assert torque == pytest.approx(3.0 * share, rel=1e-9)
    assert current == 3.0


def test_a_torque_constant_drifts_unseen_by_the_current() -> None:
    drift = Effect("torque_constant_drift", {"fraction": -0.3, "time_constant_s": 0.01})
    plant = plant_with(FREE, drift)
    assert outer_force_n(plant, torque_n_m=2.0) == pytest.approx(2.0 / R, rel=1e-3)
    plant.advance(0.0, 0.2)
    assert outer_force_n(plant, torque_n_m=2.0) == pytest.approx(0.7 * 2.0 / R, rel=1e-6)
    assert plant.torque_n_m == pytest.approx(2.0)


def test_torque_constant_falls_with_current() -> None:
    effect = Effect("torque_constant_saturation", {"coefficient_1_n2_m2": 0.002})
    for command in (5.0, -5.0):
        torque, current = torque_and_current(effect, command)
        assert torque == pytest.approx(command * (1 - 0.002 * 25), rel=1e-9)
        assert current == command
    top = 1 / np.sqrt(3 * 0.002)
    assert torque_and_current(effect, 100.0)[0] == pytest.approx(top * 2 / 3, rel=1e-9)


@pytest.mark.parametrize(("form", "seen"), [("visible", (3.0, 0.7)), ("hidden", (5.0, 1.0))])
def test_torque_limit_and_dead_zone(form: str, seen: tuple[float, float]) -> None:
    limit = Effect("torque_saturation", {"limit_n_m": 3.0}, form)
    assert torque_and_current(limit, 5.0) == pytest.approx((3.0, seen[0]), rel=1e-9)
    assert torque_and_current(limit, -2.0) == pytest.approx((-2.0, -2.0), rel=1e-9)
    zone = Effect("torque_dead_zone", {"half_width_n_m": 0.3}, form)
    assert torque_and_current(zone, 0.29)[0] == pytest.approx(0.0, abs=1e-9)
    assert torque_and_current(zone, 1.0) == pytest.approx((0.7, seen[1]), rel=1e-9)


@pytest.mark.parametrize("form", ["visible", "hidden"])
def test_current_loop_lag_is_first_order(form: str) -> None:
    plant = plant_with(FREE, Effect("current_loop_lag", {"time_constant_s": 2e-3}, form))
    mean = []
    for _ in range(6):
        plant.advance(1.0, 1e-3)
        mean.append(plant.torque_n_m)
    edges = np.arange(7) * 1e-3
    integral = edges - 2e-3 * (1 - np.exp(-edges / 2e-3))
    if form == "visible":
        assert mean == pytest.approx(np.diff(integral) / 1e-3, rel=1e-9)
    else:
        assert mean == [1.0] * 6
    momentum = np.array([335.0, 384.0]) @ plant.velocities_m_s
    assert momentum * R == pytest.approx(integral[-1] - 0.5e-5 * (1 - np.exp(-3)), rel=1e-5)  # half a step earlier


@pytest.mark.parametrize("delay_s", [1e-3, 2.37e-3, 2.5e-5])
def test_transport_delay_shifts_the_torque(delay_s: float) -> None:
    plant = plant_with(FREE, Effect("transport_delay", {"delay_s": delay_s}))
    seen = []
    for k in range(6):
        plant.advance(1.0 + k, 1e-3)
        seen.append(plant.torque_n_m)
    edges = np.clip(np.arange(7) * 1e-3 - delay_s, 0.0, None)
    command_integral = np.interp(edges, np.arange(7) * 1e-3, np.cumsum([0, *range(1, 7)]) * 1e-3)
    assert seen == pytest.approx(np.diff(command_integral) / 1e-3, abs=1e-9)
    hidden = plant_with(two_mass(), Effect("transport_delay", {"delay_s": delay_s}, "hidden"))
    hidden.advance(5.0, np.floor(delay_s / 1e-5) * 1e-5)
    assert hidden.torque_n_m == 5.0
    assert hidden.motor_true_rad == 0.0  # has not felt it yet
    hidden.advance(5.0, 3e-5)
    assert hidden.motor_true_rad > 0.0


@pytest.mark.parametrize("delay_s", [5e-4, 3.217e-3])
def test_channel_time_skew_records_one_channel_late(delay_s: float) -> None:
    def late_and_true(form: str) -> tuple[np.ndarray, np.ndarray]:
        effects = [Effect("channel_time_skew", {"delay_s": delay_s}, form)] if form else []
        plant, rows = Plant(FREE, PERFECT, effects), []
        for k in range(60):
            plant.advance(np.sin(0.3 * k), 1e-3)
            rows.append((plant.table_position_m, plant.motor_position_rad, plant.torque_n_m))
        return np.array(rows).T

    prompt = late_and_true("")
    time_s = np.arange(1, 61) * 1e-3
    for index, form in enumerate(("table_position", "motor_position")):
        rows = late_and_true(form)
        late = np.interp(time_s[10:] - delay_s, time_s, prompt[index])
        assert rows[index][10:] == pytest.approx(late, abs=2e-3 * np.ptp(prompt[index]))
        assert np.delete(rows, index, 0) == pytest.approx(np.delete(prompt, index, 0), abs=0.0)
    rows = late_and_true("torque")
    edges = np.cumsum([0.0, *prompt[2]]) * 1e-3
    integral = np.interp(np.clip(np.arange(61) * 1e-3 - delay_s, 0, None), np.arange(61) * 1e-3, edges)
    assert rows[2] == pytest.approx(np.diff(integral) / 1e-3, abs=1e-9)
    assert rows[:2] == pytest.approx(prompt[:2], abs=0.0)


def test_encoder_eccentricity_reads_a_sine_of_the_angle() -> None:
    plant = plant_with(FREE, Effect("encoder_eccentricity", {"amplitude_rad": 2e-3, "phase_rad": 0.4}))
    plant.velocities_m_s[:] = 0.02
    for _ in range(50):
        plant.advance(0.0, 0.01)
        angle = plant.motor_true_rad
        assert plant.motor_position_rad == pytest.approx(angle + 2e-3 * np.sin(angle + 0.4), abs=1e-12)


def test_a_graduation_off_centre_errs_by_the_angle_between_its_centre_and_the_axis() -> None:
    """To first order a sine of the load's angle; the law of sines holds exactly."""
    amplitude, phase = 0.02, 0.4
    effect = Effect("load_encoder_eccentricity", {"amplitude_rad": amplitude, "phase_rad": phase})
    plant = plant_with(FREE, effect)
    plant.velocities_m_s[:] = 0.5
    for _ in range(50):
        plant.advance(0.0, 0.1)
        angle = plant.table_true_m
        error = plant.table_position_m - angle
        assert error == pytest.approx(amplitude * np.sin(angle + phase), abs=0.6 * amplitude**2)
        assert np.sin(error) == pytest.approx(amplitude * np.sin(angle + phase - error), abs=1e-12)


def test_scale_interpolation_error_repeats_with_the_signal_period() -> None:
    plant = plant_with(FREE, Effect("scale_interpolation_error", {"amplitude_m": 1e-7, "period_m": 2e-5}))
    plant.velocities_m_s[:] = 1e-4
    for _ in range(50):
        plant.advance(0.0, 0.01)
        x = plant.table_true_m
        assert plant.table_position_m == pytest.approx(x + 1e-7 * np.sin(2 * np.pi * x / 2e-5), abs=1e-14)


def test_encoders_round_to_their_counts() -> None:
    plant = Plant(FREE, Sensors(motor_counts_per_rev=4096, table_resolution_m=1e-6, torque_noise_n_m=0.0))
    plant.velocities_m_s[:] = 0.013
    for _ in range(50):
        plant.advance(0.0, 1e-3)
        count = 2 * np.pi / 4096
        assert plant.motor_position_rad / count == pytest.approx(round(plant.motor_position_rad / count), abs=1e-6)
        assert abs(plant.motor_position_rad - plant.motor_true_rad) <= count / 2 * 1.000001
        assert abs(plant.table_position_m - plant.table_true_m) <= 0.5e-6 * 1.000001
    linear = Plant(one_mass(lead_m=0.0025), Sensors(motor_counts_per_rev=50_000))
    linear.positions_m[0] = 1.23e-7
    linear.advance(0.0, 1e-3)
    assert linear.motor_position_rad == pytest.approx(1e-7, rel=1e-9)  # 50 nm counts


def test_turn_on_offset_shifts_the_reading_not_the_axis() -> None:
    plant = Plant(FREE, Sensors(0, 0, motor_offset_rad=0.01, table_offset_m=1e-3))
    assert plant.motor_position_rad == pytest.approx(0.0, abs=1e-15)
    assert plant.motor_true_rad == pytest.approx(-0.01)
    assert plant.table_position_m == pytest.approx(1e-3 - 0.01 * R)


def test_noise_has_its_rms_and_correlation_and_follows_the_seed() -> None:
    def noise(seed: int, **settings: float) -> np.ndarray:
        plant, rows = Plant(two_mass(), Sensors(0, 0, **settings), seed=seed), []
        for _ in range(20_000):
            plant.advance(0.0, 1e-5)
            rows.append((plant.torque_n_m, plant.motor_position_rad, plant.table_position_m))
        return np.array(rows).T

    torque, motor, table = noise(1, motor_noise_rad=1e-5, table_noise_m=2e-7)
    assert np.std(torque) == pytest.approx(0.01, rel=0.03)
    assert np.std(motor) == pytest.approx(1e-5, rel=0.03)
    assert np.std(table) == pytest.approx(2e-7, rel=0.03)
    assert abs(np.corrcoef(torque[1:], torque[:-1])[0, 1]) < 0.03
    assert abs(np.corrcoef(torque, motor)[0, 1]) < 0.03
    assert np.mean(torque**4) / np.mean(torque**2) ** 2 == pytest.approx(3.0, abs=0.2)
    coloured = noise(2, torque_noise_correlation=0.8)[0]
    assert np.std(coloured) == pytest.approx(0.01, rel=0.05)
    assert np.corrcoef(coloured[1:], coloured[:-1])[0, 1] == pytest.approx(0.8, abs=0.03)
    assert np.array_equal(coloured, noise(2, torque_noise_correlation=0.8)[0])
    assert not np.array_equal(coloured, noise(3, torque_noise_correlation=0.8)[0])


def test_sampling_jitter_scatters_readings_with_speed() -> None:
    plant = Plant(FREE, Sensors(0, 0, 0.0, 0.0, torque_noise_n_m=0, sampling_jitter_s=2e-5))
    for speed in (0.0, 0.1):
        plant.velocities_m_s[:] = speed
        error = []
        for _ in range(3000):
            plant.advance(0.0, 1e-4)
            error.append(plant.table_position_m - plant.table_true_m)
        assert np.std(error) == pytest.approx(2e-5 * speed, rel=0.05)


def test_sensors_refuse_nonsense() -> None:
    with pytest.raises(ValueError, match=r"sensors.torque_noise_n_m: must be finite and >= 0"):
        Sensors(torque_noise_n_m=-1.0)
    with pytest.raises(ValueError, match="torque_noise_correlation: must be < 1"):
        Sensors(torque_noise_correlation=1.0)
