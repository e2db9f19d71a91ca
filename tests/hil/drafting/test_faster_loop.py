"""The control law of rows that are ticks of its loop is drafted, unless its torque is not held from row to row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import write

from hil.bench.bench_file import Bench, load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_

ROWS_HZ, SECONDS = 1000, 8
INERTIA_KG_M2, VISCOUS_N_M_S_RAD, COULOMB_N_M = 2e-3, 0.01, 0.4
POSITION_GAIN_1_S, VELOCITY_GAIN_N_M_S_RAD, INTEGRAL_TIME_S = 40.0, 0.5, 0.02


def servo(ticks: int) -> dict[str, np.ndarray]:
    """An axis under a P and PI cascade of `ticks` per recorded row; each torque acts until the next tick."""
    step_s = 1.0 / (ROWS_HZ * ticks)
    t = step_s * np.arange(ROWS_HZ * ticks * SECONDS)
    wanted = 20.0 * np.sin(2.0 * np.pi * 0.4 * t) + 4.0 * np.sin(2.0 * np.pi * 1.9 * t)
    angle, torque = np.zeros(t.size), np.zeros(t.size)
    position, speed, integral, before = 0.0, 0.0, 0.0, 0.0
    for row, target in enumerate(wanted):
        error = POSITION_GAIN_1_S * (target - position) - (position - before) / step_s
        before = position
        integral += error * step_s / INTEGRAL_TIME_S
        angle[row], torque[row] = position, VELOCITY_GAIN_N_M_S_RAD * (error + integral)
        friction = VISCOUS_N_M_S_RAD * speed + COULOMB_N_M * np.tanh(speed / 1e-2)
        acceleration = (torque[row] - friction) / INERTIA_KG_M2
        position += step_s * (speed + 0.5 * step_s * acceleration)
        speed += step_s * acceleration
    noise = np.random.default_rng(2).normal(0.0, 1e-3, t.size)
    table = {"time_s": t, "position_set_rad": wanted, "motor_angle_rad": angle, "torque_Nm": torque + noise}
    return {name: values[::ticks] for name, values in table.items()}


def drafted(folder: Path, table: dict[str, np.ndarray]) -> tuple[Bench, str]:
    import_(write(folder / "log.csv", table), None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    return load_bench(folder / "axis.yaml"), (folder / "axis.yaml").read_text()


@pytest.mark.parametrize(("ticks", "known"), [pytest.param(1, True, marks=pytest.mark.long), (2, False)])
def test_a_law_whose_torque_is_not_held_between_rows_is_not_simulated(tmp_path: Path, ticks: int, known: bool) -> None:
    bench, text = drafted(tmp_path, servo(ticks))
    assert bench.law_known is known
    assert ("a faster loop, or recorded late" in text) is not known
    if known:
        assert bench.gains.position_gain_1_s == pytest.approx(POSITION_GAIN_1_S, rel=0.02)
    else:
        gain = text.partition("position_gain_1_s ")[2].partition(",")[0]
        assert float(gain) == pytest.approx(POSITION_GAIN_1_S, rel=0.05)


@pytest.mark.parametrize("both", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_law_of_a_late_torque_is_that_of_its_command(tmp_path: Path, both: bool) -> None:
    """Without the command the lateness is in the bench, and the gains are told beside it."""
    table = servo(1)
    late = np.concatenate([table["torque_Nm"][:1], table["torque_Nm"][:-1]])
    more = {"torque_set_Nm": table.pop("torque_Nm"), "torque_actual_Nm": late} if both else {"torque_Nm": late}
    bench, text = drafted(tmp_path, table | more)
    assert bench.law_known is both
    if both:
        assert bench.gains.position_gain_1_s == pytest.approx(POSITION_GAIN_1_S, rel=0.02)
    else:
        assert bench.torque_delay_s == pytest.approx(-1.0 / ROWS_HZ, rel=0.02)
        assert "a faster loop, or recorded late" in text
