"""Zones of other friction and lines of fixed frequency, estimated from the torque against the motion."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from concealed_run import concealed_run
from diagnosis_runs import bench

from hil.diagnosis.search.disturbance import (
    Disturbance,
    force_windows,
    lines_hz,
    other_orders,
    scale_periods,
    waves,
    zones,
)
from hil.identification.measured import take

OWNER = bench()


@pytest.mark.parametrize("level", [0.5, -0.3])
@pytest.mark.parametrize("of", ["friction", "torque"])
def test_the_zone_is_estimated_from_what_varies_in_it(level: float, of: str) -> None:
    run = take(concealed_run(OWNER, {}), OWNER)
    x = OWNER.axis.ratio_m_rad * run.motor
    velocity = np.gradient(run.motor, run.period_s)
    more = np.where((x > 0.22) & (x < 0.30), level, 0.0)
    noise = np.random.default_rng(1).normal(0.0, 0.1, x.size)
    weight = -2.0 * np.sign(velocity) if of == "friction" else run.torque
    torque = 0.2 + more * weight + noise  # the constant force is neither
    begin_m, end_m, found = zones(
        [run], [Disturbance(torque, velocity, np.abs(velocity) > 1.0)], OWNER.axis.ratio_m_rad, [weight]
    )[0]
    assert (begin_m, end_m) == pytest.approx((0.22, 0.30), abs=3e-3)
    assert abs(found) <= abs(level)
    assert found * level > 0.0


def test_each_of_several_windows_of_a_force_is_where_a_search_may_begin() -> None:
    run = take(concealed_run(OWNER, {}), OWNER)
    time_s, sliding = np.arange(run.motor.size) * run.period_s, np.ones(run.motor.size, dtype=bool)
    pushed = [(0.2, 0.35), (0.6, 0.7)]
    whole_s = time_s[-1]
    torque = np.random.default_rng(4).normal(0.0, 0.1, time_s.size)
    for begin, end in pushed:
        torque[(time_s >= begin * whole_s) & (time_s < end * whole_s)] -= 0.3
    found = force_windows(run, Disturbance(torque, np.ones(time_s.size), sliding))
    for (begin, end), (first_s, last_s, level) in zip(pushed, found, strict=False):
        assert (first_s, last_s) == pytest.approx((begin * whole_s, end * whole_s), abs=0.02 * whole_s)
        assert level == pytest.approx(-0.3, abs=0.1)
    still = Disturbance(torque, np.zeros(time_s.size), np.zeros(time_s.size, dtype=bool))
    assert len(force_windows(run, still)) == 1


@pytest.mark.parametrize("seed", range(20))
def test_windows_of_a_force_are_apart(seed: int) -> None:
    run = take(concealed_run(OWNER, {}), OWNER)
    random = np.random.default_rng(seed)
    torque = np.cumsum(random.normal(0.0, 0.02, run.motor.size))
    sliding = random.uniform(size=torque.size) < 0.9
    found = sorted(force_windows(run, Disturbance(torque, np.ones(torque.size), sliding)))
    assert all(end_s <= start_s for (_, end_s, _), (start_s, _, _) in pairwise(found))


def test_lines_are_those_of_the_disturbance_over_time() -> None:
    run = take(concealed_run(OWNER, {}), OWNER)
    time_s = np.arange(run.motor.size) * run.period_s
    velocity = np.gradient(run.motor, run.period_s)
    torque = 1.1 * np.sign(velocity) + 0.3 * np.sin(2.0 * np.pi * 8.3 * time_s) + 0.1 * np.sin(40.0 * time_s)
    found = lines_hz(run, Disturbance(torque, velocity, np.abs(velocity) > 1e-3))
    assert found[0] == pytest.approx(8.3, abs=0.3 / time_s[-1])
    assert not lines_hz(run, Disturbance(torque, velocity, np.zeros(velocity.size, dtype=bool)))


def test_a_short_period_of_the_second_encoder_is_found_beside_long_errors_that_are_stronger() -> None:
    x = np.linspace(0.0, 0.02, 40001)
    run: Any = SimpleNamespace(table_m=x)
    long = sum(20e-6 * np.sin(2.0 * np.pi * (n + 0.37) * x / np.ptp(x)) for n in range(1, 7))
    found = scale_periods([run], [long + 3e-6 * np.sin(2.0 * np.pi * x / 20e-6)])
    assert found[0] == pytest.approx(20e-6, rel=1e-3)


def test_a_ripple_finer_than_160_per_turn_is_found_within_less_than_a_turn() -> None:
    t = np.arange(20_000) * 2e-3
    angle = 1.2 * np.sin(0.9 * t)  # rad: an output shaft behind a gear of 100
    velocity = np.gradient(angle, 2e-3)
    noise = np.random.default_rng(3).normal(0.0, 1.0, t.size)
    ripple = Disturbance(np.sin(200.0 * angle) + noise, velocity, np.abs(velocity) > 0.05)
    run = SimpleNamespace(motor=angle, period_s=2e-3)
    order = other_orders([run], [ripple], 1.0)[0]
    assert order == pytest.approx(200.0, abs=0.7)
    still = Disturbance(noise, np.zeros(t.size), np.zeros(t.size, dtype=bool))
    assert other_orders([run], [still], 1.0) == []


def test_a_ripple_finer_than_160_per_turn_is_found_where_a_fast_axis_is_slow() -> None:
    velocity = np.repeat([1.0, 30.0, -1.2, -30.0], 5000)  # rad/s: most rows pass the ripple faster than a row
    angle = np.cumsum(velocity) * 1e-3
    noise = np.random.default_rng(3).normal(0.0, 1.0, angle.size)
    ripple = Disturbance(np.sin(200.0 * angle) * (np.abs(velocity) < 2.0) + noise, velocity, np.ones(angle.size, bool))
    run = SimpleNamespace(motor=angle, period_s=1e-3)
    assert 200.0 in other_orders([run], [ripple], 1.0)


def test_a_ripple_of_what_turns_slower_than_the_motor_is_found() -> None:
    t = np.arange(20_000) * 2e-3
    angle = 150.0 * np.sin(0.6 * t)  # rad: some 48 turns of the motor
    velocity = np.gradient(angle, 2e-3)
    noise = np.random.default_rng(3).normal(0.0, 1.0, t.size)
    ripple = Disturbance(0.5 * np.sin(0.505 * angle) + noise, velocity, np.abs(velocity) > 0.05)
    run = SimpleNamespace(motor=angle, period_s=2e-3)
    assert other_orders([run], [ripple], 1.0)[-1] == pytest.approx(0.505, abs=0.01)


def test_a_ripple_of_a_linear_motor_is_found_by_its_torque() -> None:
    """Its sign turns with each acceleration: over the position alone its wave is split in two."""
    t = np.arange(20_000) * 1e-3
    x, bend = 0.12 * np.sin(3.0 * t) + 0.05 * np.sin(7.1 * t), -1.08 * np.sin(3.0 * t) - 2.52 * np.sin(7.1 * t)
    noise = np.random.default_rng(3).normal(0.0, 0.02, t.size)
    velocity = np.gradient(x, t)
    ripple = Disturbance(0.024 * bend * np.cos(2.0 * np.pi * 62.5 * x) + noise, velocity, np.abs(velocity) > 0.02)
    run: Any = SimpleNamespace(motor=x)
    assert waves([run], [ripple], 1.0, 2, [bend])[0] == pytest.approx(62.5, rel=0.01)
    assert all(abs(one / 62.5 - 1.0) > 0.01 for one in waves([run], [ripple], 1.0))
