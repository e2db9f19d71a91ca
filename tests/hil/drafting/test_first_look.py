"""What recordings show at once: the plain model, before anything slow is loaded."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from own_recordings import CLEAN

import hil
from hil.drafting.first_look import first_look
from hil.quantities import ROTARY_LEAD_M
from hil.recording.recording import Recording

SLOW = ("numba", "scipy.signal", "scipy.stats", "scipy.optimize", "scipy.integrate", "matplotlib")


def test_the_plain_model_tells_inertia_friction_and_the_second_encoder() -> None:
    recording = hil.read_recording(CLEAN)
    moves, plain, second = first_look([recording])
    bench = hil.load_bench("reference")
    inertia = (335.0 + 384.0) * bench.axis.ratio_m_rad**2
    assert moves.startswith(f"{len(recording)} rows")
    told = float(plain.split("inertia at the motor ")[1].split()[0])
    assert abs(told / inertia - 1.0) < 0.05
    assert f"Coulomb friction {bench.axis.coulomb_torque_n_m:.1f}" in plain  # type: ignore[union-attr]
    assert second.startswith("Second encoder: 0.0100 m")


def test_what_cannot_be_told_is_said_with_its_reason() -> None:
    recording = hil.read_recording(CLEAN)
    without = replace(
        recording, columns={name: one for name, one in recording.columns.items() if not name.startswith("torque")}
    )
    assert first_look([without])[1].startswith("No torque is recorded")
    alone = replace(without, columns={name: one for name, one in without.columns.items() if "table" not in name})
    assert "without torque no mass" in first_look([alone])[0]


@pytest.mark.parametrize("load_turns", [False, True])
def test_cogging_is_told_and_gravity_is_none(load_turns: bool) -> None:
    """The plain model has the gravity of an arm. If the angle of a turn is not known, no wave is told."""
    rng, time = np.random.default_rng(2), 1e-3 * np.arange(20_000)
    angle = 9.0 * (1.0 - np.cos(1.1 * time)) + 0.4 * np.sin(8.0 * time)
    speed, acceleration = 9.9 * np.sin(1.1 * time) + 3.2 * np.cos(8.0 * time), np.zeros(time.size)
    acceleration = 10.89 * np.cos(1.1 * time) - 25.6 * np.sin(8.0 * time)
    torque = 0.02 * acceleration + 0.03 * speed + 0.2 * np.sign(speed) + 0.15 * np.sin(24.0 * angle)
    torque += (0.5 * np.sin(angle) if load_turns else 0.0) + rng.normal(0.0, 0.02, time.size)
    columns = {"time_s": time, "motor_position_rad": angle, "torque_n_m": torque}
    recording = Recording("arm", columns, 1e-3, {"lead_m": ROTARY_LEAD_M if load_turns else 0.01})
    (wave,) = (line for line in first_look([recording]) if line.startswith("Over a turn"))
    assert wave.startswith("Over a turn of the motor the torque repeats 24 times with 0.1")
    assert "," not in wave.split(" N m")[0]
    assert not any("Over a turn" in line for line in first_look([recording], turns_told=False))


def test_a_first_look_waits_for_no_compiled_kernel_and_no_plots() -> None:
    code = (
        f"import sys, hil; from hil.explanation import first_look; first_look([hil.read_recording({str(CLEAN)!r})]);"
        f"print([name for name in {SLOW} if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
