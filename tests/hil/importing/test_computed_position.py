"""A set-point in counts is told from encoders by its rest."""

from __future__ import annotations

import numpy as np
import pytest

from hil.importing.computed_position import computed_one

RANDOM = np.random.default_rng(4)
ROWS = 6000
MOVE = 0.5 - 0.5 * np.cos(np.clip((np.arange(ROWS) % 2000 - 500) / 1000.0, 0.0, 1.0) * np.pi)
WAY = 20.0 * np.where(np.arange(ROWS) % 4000 < 2000, MOVE, 1.0 - MOVE)
FINE, COARSE = 2.0 * np.pi / 2**16, 0.05


def counted(values: np.ndarray, step: float, noise: float = 0.0) -> np.ndarray:
    return np.round((values + RANDOM.normal(0.0, noise, ROWS)) / step) * step


@pytest.mark.parametrize("step", [1.0, FINE])
def test_a_set_point_stands_still_where_an_encoder_of_its_step_does_not(step: float) -> None:
    size = step / FINE
    positions = {"beta": counted(size * WAY, step, step), "alpha": counted(size * np.roll(WAY, -4), step)}
    assert computed_one(positions, list(positions)).names == ["alpha"]


def test_a_coarse_encoder_stands_still_too_and_is_no_set_point() -> None:
    positions = {"beta": counted(WAY, FINE, FINE), "alpha": counted(np.roll(WAY, 2), COARSE)}
    assert "alpha" not in computed_one(positions, list(positions)).names


def test_of_two_quiet_encoders_none_is_a_set_point() -> None:
    positions = {"beta": counted(WAY, FINE), "alpha": counted(np.roll(WAY, 2), FINE)}
    assert computed_one(positions, list(positions)).names == []
