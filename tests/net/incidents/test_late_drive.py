"""A drive with a dead time of several periods is not taken for a lag."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnose import diagnose
from hil.recording.recording import Recording

pytestmark = pytest.mark.net

PERIOD_S, STEPS, DEAD_TICKS = 1e-3, 10, 3
MASS_KG, COULOMB_N, VISCOUS_N_S_M = 45.0, 80.0, 120.0
GANTRY = Bench.model_validate(
    {
        "schema_version": 1,
        "name": "gantry",
        "axis": {
            "model": "one_mass",
            "mass_kg": 43.0,
            "coulomb_force_n": 84.0,
            "viscous_force_n_s_m": 130.0,
        },
        "control": "unknown",
        "encoders": {"motor": {"resolution_m": 1e-6}, "table": None},
    }
)


def late_drive() -> Recording:
    """A stage whose drive has a dead time of three periods; the noise of its encoder is in the force command."""
    rng, step_s = np.random.default_rng(5), PERIOD_S / STEPS
    time_s = np.arange(6000) * PERIOD_S
    wanted = 0.1 * (1.0 - np.cos(2.0 * math.pi * time_s / 3.0))
    feed = np.gradient(wanted, PERIOD_S)
    position = speed = integral = filtered = before = 0.0
    waiting, rows = [0.0] * DEAD_TICKS, []
    for place, ahead in zip(wanted, feed, strict=True):
        read = round((position + rng.normal(0.0, 3e-7)) / 1e-6) * 1e-6
        filtered += 0.5 * ((read - before) / PERIOD_S - filtered)
        before = read
        error = 25.0 * (place - read) + ahead - filtered
        integral += 54000.0 * PERIOD_S * error
        waiting.append(4500.0 * error + integral)
        force = waiting.pop(0)
        rows.append((read, waiting[-1], force + rng.normal(0.0, 3.0)))
        for _ in range(STEPS):
            speed += (force - VISCOUS_N_S_M * speed) / MASS_KG * step_s
            speed = math.copysign(max(abs(speed) - COULOMB_N / MASS_KG * step_s, 0.0), speed)
            position += speed * step_s
    columns = dict(zip(("motor_position_m", "force_command_n", "force_n"), np.array(rows).T, strict=True))
    return Recording(name="gantry", period_s=PERIOD_S, columns=columns)


def test_a_dead_time_of_several_periods_is_not_taken_for_a_lag() -> None:
    """A fit from a fraction of a period ends at the first of the minima, one at each period."""
    (found,) = diagnose([late_drive()], [], GANTRY).result.missing
    # this slow motion does not tell whether the force or only its record is late
    assert {found.effect, *found.equivalents} == {"transport_delay", "channel_time_skew"}
    assert found.parameters["delay_s"].value == pytest.approx(DEAD_TICKS * PERIOD_S, abs=2e-4)
    lag = next(one for one in found.rivals if one.effect == "current_loop_lag")
    assert "in its place" in lag.evidence
