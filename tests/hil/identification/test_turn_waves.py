"""Waves of a torque over a turn of the motor, by the raw channels alone."""

from __future__ import annotations

import numpy as np
import pytest

from hil.identification.turn_waves import turn_waves

PERIOD_S = 1e-3
INERTIA, VISCOUS, COULOMB = 2e-3, 4e-3, 0.05


def motion(rng: np.random.Generator, turns: float) -> np.ndarray:
    """Position (n,) [rad] of moves to and fro over so many turns, with the steps of an encoder."""
    time = np.arange(20_000) * PERIOD_S
    angle = np.pi * turns * (1.0 - np.cos(2.0 * np.pi * 0.17 * time)) + 0.3 * np.sin(2.0 * np.pi * 1.3 * time)
    return np.asarray(np.round((angle + rng.normal(0.0, 1e-5, angle.size)) / 1e-5) * 1e-5)


def torque_of(angle: np.ndarray, rng: np.random.Generator, waves: dict[int, float]) -> np.ndarray:
    """Torque (n,) of inertia, friction and waves (amplitude by order), with noise."""
    smooth = np.convolve(np.pad(angle, 10, mode="edge"), np.ones(21) / 21, mode="valid")
    speed = np.gradient(smooth, PERIOD_S)
    acceleration = np.gradient(speed, PERIOD_S)
    plain = INERTIA * acceleration + VISCOUS * speed + COULOMB * np.sign(speed)
    cogging = sum(size * np.sin(order * angle + order) for order, size in waves.items())
    return np.asarray(plain + cogging + rng.normal(0.0, 0.01, angle.size))


@pytest.mark.parametrize("orders", [{24: 0.05}, {6: 0.03, 72: 0.08}])
def test_waves_have_their_orders_and_sizes(orders: dict[int, float]) -> None:
    rng = np.random.default_rng(3)
    angle = motion(rng, 3.0)
    found = turn_waves([(angle, torque_of(angle, rng, orders))], PERIOD_S)
    assert {wave.order for wave in found} == set(orders)
    for wave in found:
        assert wave.amplitude == pytest.approx(orders[wave.order], rel=0.1)
    assert [wave.amplitude for wave in found] == sorted((wave.amplitude for wave in found), reverse=True)


@pytest.mark.parametrize("seed", range(8))
def test_inertia_and_friction_are_no_waves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = motion(rng, 3.0)
    assert turn_waves([(angle, torque_of(angle, rng, {}))], PERIOD_S) == []


def test_half_a_turn_tells_no_wave() -> None:
    rng = np.random.default_rng(5)
    angle = motion(rng, 0.4)
    assert turn_waves([(angle, torque_of(angle, rng, {24: 0.1}))], PERIOD_S) == []


def test_a_motor_that_is_held_from_place_to_place_tells_its_cogging() -> None:
    """A map at standstill: no inertia, but the torque that holds each place of a turn, forth and back."""
    rng, period_s = np.random.default_rng(7), 0.01
    places = np.linspace(0.0, 2.0 * np.pi, 1500)
    angle = np.repeat(np.concatenate([places, places[::-1]]), 8)
    way = np.repeat([1.0, -1.0], angle.size // 2)
    held = 0.18 * np.sin(72 * angle) + 0.04 * np.sin(18 * angle + 1.0) + 0.05 * way
    found = turn_waves(
        [(angle + rng.normal(0.0, 1e-4, angle.size), held + rng.normal(0.0, 0.01, angle.size))], period_s
    )
    assert [wave.order for wave in found] == [72, 18]
    assert [wave.amplitude for wave in found] == pytest.approx([0.18, 0.04], rel=0.1)
