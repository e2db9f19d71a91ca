"""A draft tells when the torque is recorded against the motion, in a bench file that is valid at any rate of rows."""

from __future__ import annotations

import numpy as np
import pytest
from foreign_axis import axis

from hil.bench.control_section import MOST_TORQUE_DELAY_S
from hil.drafting.drafted_bench import DraftedBench, drafted
from hil.quantities import digits
from hil.recording.recording import Recording

AXIS = axis(rows=8000)


def imported(period_s: float, angle: np.ndarray, torque: np.ndarray) -> DraftedBench:
    """Draft of a file with the angle and the torque of a motor."""
    columns = {"motor_position_rad": angle, "torque_n_m": torque}
    return drafted([Recording("log", columns, period_s, {"source": "log.csv"})])


@pytest.mark.parametrize("late_rows", [1, 4, 7])
def test_a_torque_that_is_recorded_late_is_in_the_bench(late_rows: int) -> None:
    period_s = float(AXIS["t"][1] - AXIS["t"][0])
    torque = np.roll(AXIS["torque"], late_rows)
    torque[:late_rows] = torque[late_rows]
    late, prompt = (imported(period_s, AXIS["angle"], one) for one in (torque, AXIS["torque"]))
    begun_s = -0.5 * period_s if prompt.bench.torque_delay_s is None else prompt.bench.torque_delay_s
    assert late.bench.torque_delay_s == pytest.approx(begun_s - late_rows * period_s, abs=0.1 * period_s)
    assert late.bench.axis.inertia_kg_m2 == pytest.approx(prompt.bench.axis.inertia_kg_m2, rel=0.02)
    assert f"torque is recorded {digits(-1e3 * late.bench.torque_delay_s)} ms after it acts" in late.text


def test_samples_of_one_instant_act_half_a_row_before_they_are_held() -> None:
    """Rows of 4 ms, in which least squares tell both apart."""
    every = 4
    period_s = every * float(AXIS["t"][1] - AXIS["t"][0])
    angle, torque = (AXIS[name][::every] for name in ("angle", "torque"))
    assert imported(period_s, angle, torque).bench.torque_delay_s == pytest.approx(-0.5 * period_s, abs=0.1 * period_s)


@pytest.mark.parametrize("late_rows", [-2, -1, 1, 2])
def test_slow_rows_with_a_late_torque_make_a_valid_bench(late_rows: int) -> None:
    time_s = 0.3 * np.arange(3000)
    angle = 40.0 * np.sin(0.21 * time_s) + 15.0 * np.sin(0.53 * time_s)
    speed = 8.4 * np.cos(0.21 * time_s) + 7.95 * np.cos(0.53 * time_s)
    acceleration = -1.764 * np.sin(0.21 * time_s) - 4.2135 * np.sin(0.53 * time_s)
    torque = np.roll(0.2 * acceleration + 0.02 * speed + 0.4 * np.sign(speed), late_rows)
    torque += 0.002 * np.random.default_rng(4).normal(size=torque.size)
    delay_s = imported(0.3, angle, torque).bench.torque_delay_s  # beyond what a bench takes it would be refused
    expected_s = -0.3 * (late_rows + 0.5)  # samples of one instant act half a row before they are held
    assert delay_s == (pytest.approx(expected_s, abs=0.01) if abs(expected_s) < MOST_TORQUE_DELAY_S else None)
