"""What recordings show at once: the plain model, before anything slow is loaded."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

from own_recordings import CLEAN

import hil
from hil.drafting.first_look import first_look

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


def test_a_first_look_waits_for_no_compiled_kernel_and_no_plots() -> None:
    code = (
        f"import sys, hil; from hil.explanation import first_look; first_look([hil.read_recording({str(CLEAN)!r})]);"
        f"print([name for name in {SLOW} if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
