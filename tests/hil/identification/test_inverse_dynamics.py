"""The inverse-dynamics fit finds known parameters."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hil.errors import InputError
from hil.identification.inverse_dynamics import fit_inverse_dynamics
from hil.recording.recording import Recording


def swinging(rows: int = 20_000, period_s: float = 1e-3, noise_n: float = 0.0, one_way: bool = False) -> Recording:
    """A mass of 80 kg with 150 N s/m, 12 N, 2 N offset, moved by two sines (and a drift if `one_way`)."""
    t: NDArray[np.float64] = np.linspace(0.0, (rows - 1) * period_s, rows)
    w1, w2 = 2 * np.pi * 0.4, 2 * np.pi * 1.1
    drift = 5.0 if one_way else 0.0
    position = 0.1 * np.sin(w1 * t) + 0.02 * np.sin(w2 * t) + drift * t
    velocity = 0.1 * w1 * np.cos(w1 * t) + 0.02 * w2 * np.cos(w2 * t) + drift
    acceleration = -0.1 * w1**2 * np.sin(w1 * t) - 0.02 * w2**2 * np.sin(w2 * t)
    force = 80 * acceleration + 150 * velocity + 12 * np.sign(velocity) + 2
    force += noise_n * np.random.default_rng(3).normal(size=rows)
    return Recording("swinging", {"time_s": t, "motor_position_m": position, "force_n": force}, period_s)


def test_known_parameters_are_found() -> None:
    fit = fit_inverse_dynamics(swinging(), cut_at_end=49)
    assert fit.inertia == pytest.approx(80, rel=1e-3)
    assert fit.viscous == pytest.approx(150, rel=1e-3)
    assert fit.coulomb == pytest.approx(12, rel=1e-3)
    assert fit.offset == pytest.approx(2, rel=1e-3)


def test_standard_errors_cover_the_error_under_noise() -> None:
    fit = fit_inverse_dynamics(swinging(noise_n=5.0), cut_at_end=49)
    for value, error, truth in (
        (fit.inertia, fit.inertia_std_error, 80),
        (fit.viscous, fit.viscous_std_error, 150),
        (fit.coulomb, fit.coulomb_std_error, 12),
        (fit.offset, fit.offset_std_error, 2),
    ):
        assert 0 < error < 0.05 * truth
        assert abs(value - truth) < 4 * error


@pytest.mark.parametrize(
    ("recording", "message"),
    [
        (swinging(rows=500), "given 500 rows, allowed 1049 or more"),
        (swinging(period_s=0.01), "given a period of 0.01 s, allowed less than 0.005 s"),
        (swinging(one_way=True), "motion in one direction"),
    ],
)
def test_an_unfit_recording_is_refused(recording: Recording, message: str) -> None:
    with pytest.raises(InputError, match=f"swinging: .*{message}"):
        fit_inverse_dynamics(recording)
