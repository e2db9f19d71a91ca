"""Noise and timing of the sensors are estimated from a recording alone."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, recorded
from scipy.signal import lfilter

from hil.errors import InputError
from hil.identification.dataset import prepare_dataset
from hil.identification.measured import take
from hil.identification.sensor_noise import _jitter_s, _of_drive, _rounding, white_noise
from hil.identification.standstill import resting

PERIOD_S = 1e-3


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_recording_in_memory_with_nan_or_infinity_is_refused(value: float) -> None:
    owner = bench()
    recording = recorded(owner)
    recording["table_position_m"][500] = value
    with pytest.raises(InputError, match=f"row 500: table_position_m: given {value}, allowed a finite number"):
        take(recording, owner)


VELOCITY = np.repeat([0.0, 40.0, 0.0, -40.0, 0.0], 2000)


def position(noise: float, jitter_s: float, seed: int = 1) -> np.ndarray:
    """A motor that goes there and back (n,), read with noise at instants that are not quite the nominal ones."""
    rng = np.random.default_rng(seed)
    late_s = jitter_s * rng.standard_normal(VELOCITY.size)
    return np.cumsum(VELOCITY) * PERIOD_S + VELOCITY * late_s + noise * rng.standard_normal(VELOCITY.size)


@pytest.mark.parametrize("jitter_s", [5e-7, 2e-6, 1e-5])
def test_jitter_is_told_from_noise_by_the_speed(jitter_s: float) -> None:
    assert _jitter_s(position(1e-6, jitter_s), VELOCITY, 1e-6, PERIOD_S) == pytest.approx(jitter_s, rel=0.1)


def test_a_short_fast_feed_tells_the_jitter_and_a_shorter_one_does_not() -> None:
    for rows, told in ((7 * 64, True), (4 * 64, False)):
        velocity = np.repeat([0.0, 400.0, 0.0], [1024, rows, 1024])
        late_s = 2e-6 * np.random.default_rng(1).standard_normal(velocity.size)
        found = _jitter_s(np.cumsum(velocity) * PERIOD_S + velocity * late_s, velocity, 1e-6, PERIOD_S)
        assert found == (pytest.approx(2e-6, rel=0.2) if told else 0.0)


def test_a_count_that_flickers_at_rest_is_no_jitter() -> None:
    """Moves without any constant feed, dwells between them on the edge of a count."""
    rng, count = np.random.default_rng(2), 6.3e-4
    speed = np.concatenate(
        [np.concatenate([np.zeros(700), 30.0 * np.sin(np.linspace(0.0, np.pi, 300))]) for _ in range(4)]
    )
    position = np.cumsum(speed) * PERIOD_S + 0.5 * count
    motor = count * np.round((position + 0.05 * count * rng.standard_normal(speed.size)) / count)
    assert _jitter_s(motor, speed, count / np.sqrt(12.0), PERIOD_S) == 0.0


def test_noise_without_jitter_has_none() -> None:
    motor = position(1e-5, 0.0)
    assert white_noise(motor) == pytest.approx(1e-5, rel=0.05)
    assert _jitter_s(motor, VELOCITY, white_noise(motor), PERIOD_S) == 0.0


@pytest.mark.parametrize("motor", [np.zeros(5000), np.zeros(3)])
def test_a_motor_at_rest_tells_no_jitter(motor: np.ndarray) -> None:
    assert _jitter_s(motor, np.zeros(motor.size), 1e-6, PERIOD_S) == 0.0


def test_a_ramp_of_the_motor_is_no_jitter() -> None:
    """Acceleration in steps of a slow position loop has fourth differences of its own."""
    velocity = np.repeat(np.linspace(0.0, 40.0, 2000), 4)
    motor = np.cumsum(velocity) * PERIOD_S
    assert _jitter_s(motor, velocity, 1e-9, PERIOD_S) == 0.0


def test_a_torque_without_noise_has_that_of_its_digits_and_one_of_zero_is_refused() -> None:
    quiet = recorded(bench(), torque_noise_n_m=0.0)
    measured = take(quiet, bench())
    assert measured.noise.torque > 0.0
    prepare_dataset([measured], bench())
    zero = replace(quiet, columns={**quiet.columns, "torque_n_m": 0.0 * quiet["torque_n_m"]})
    zero.columns["torque_command_n_m"] = zero["torque_n_m"]
    with pytest.raises(InputError, match="torque: given 0 throughout"):
        prepare_dataset([take(zero, bench())], bench())


@pytest.mark.parametrize("step", [0.05, 0.2])
def test_a_torque_in_counts_has_at_least_their_noise(step: float) -> None:
    quiet = recorded(bench(), torque_noise_n_m=0.0)
    counts = step * np.round(quiet["torque_n_m"] / step)
    measured = take(
        replace(quiet, columns={**quiet.columns, "torque_n_m": counts, "torque_command_n_m": counts}), bench()
    )
    assert measured.noise.torque >= 0.99 * step / np.sqrt(12.0)


def test_a_binary_command_has_no_noise_of_counts() -> None:
    signs = np.sign(np.random.default_rng(2).standard_normal(4000))
    assert _rounding(signs) == 0.0
    assert _rounding(np.round(np.cumsum(signs))) == pytest.approx(1.0 / np.sqrt(12.0))


@pytest.mark.parametrize("late_rows", [0, 3])
def test_the_noise_of_a_torque_leaves_out_delay_lag_and_gain(late_rows: int) -> None:
    rng = np.random.default_rng(4)
    command = np.cumsum(rng.normal(0.0, 0.1, 8000))
    command -= np.linspace(0.0, command[-1], command.size)
    answer = lfilter([0.3], [1.0, -0.7], 0.95 * np.r_[np.full(late_rows, command[0]), command][: command.size])
    noise = _of_drive(command, answer + rng.normal(0.0, 0.02, command.size))
    assert noise == pytest.approx(0.02, rel=0.05)


def test_rest_is_seen_beside_the_noise_of_the_encoder() -> None:
    """At 1 kHz the noise moves the motor by 40 mrad/s from row to row, the axis rests below 2 mrad/s."""
    owner = bench()
    quiet = take(recorded(owner), owner)
    rng = np.random.default_rng(5)
    noisy = replace(
        quiet,
        motor=quiet.motor + rng.normal(0.0, 3e-5, quiet.motor.size),
        noise=replace(quiet.noise, motor=3e-5),
    )
    still, seen = resting(quiet, 0.02), resting(noisy, 0.002)
    assert 0.0 < np.mean(still) < 1.0
    assert np.mean(seen[still]) > 0.9
    fast = np.abs(np.gradient(quiet.motor)) > 0.05 * quiet.period_s
    assert not seen[fast].any()


def test_a_part_that_begins_as_the_axis_starts_begins_at_rest() -> None:
    """A parabola through all its first rows would give it a speed, and the law a torque that it has not."""
    owner = bench()
    run = recorded(owner)
    moved = np.flatnonzero(np.diff(run["motor_position_rad"]))
    begins = np.flatnonzero(np.diff(moved) > 50)  # rests of 50 ms and longer
    first = int(moved[begins[0] + 1]) - 6
    part = replace(
        run,
        columns={name: values[first:] for name, values in run.columns.items()},
        start_s=run.start_s + first * run.period_s,
    )
    assert take(part, owner).start.velocity_m_s == pytest.approx(0.0, abs=1e-4)
