"""The first axis of a KUKA robot, with an encoder on the link side that is read late."""

from __future__ import annotations

import numpy as np
import pytest
from measured_recordings import shared

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.diagnose import diagnose
from hil.recording.recording import Recording

pytestmark = pytest.mark.net


def kuka() -> tuple[Recording, Bench]:
    """Motion of the robot's first axis at the motor, with the encoder on the link side, and a bench without a law."""
    path = shared("kuka/axis1_a.csv")
    names = path.read_text().splitlines()[0].split(",")
    table = dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))
    columns = {
        "time_s": table["time_s"],
        "motor_position_rad": np.deg2rad(table["motor_position_deg"]),
        "table_position_m": np.deg2rad(table["secondary_position_deg"]),
        "torque_n_m": table["motor_torque_n_m"],
    }
    rotary = load_bench("rotary")
    axis = rotary.axis.model_copy(
        update={"inertia_kg_m2": 7.9, "coulomb_torque_n_m": 1.55, "viscous_torque_n_m_s_rad": 7.0}
    )
    encoders = rotary.encoders.model_copy(
        update={
            "motor": rotary.encoders.motor.model_copy(update={"counts_per_rev": 2785974}),
            "table": load_bench("reference").encoders.table,
        }
    )
    return Recording("axis1", columns, 0.004), rotary.model_copy(update={"axis": axis, "encoders": encoders})


def test_the_late_encoder_of_a_robot_axis_is_found_and_nothing_else() -> None:
    """What is left is 30 times the noise of the encoders: no name for it."""
    recording, owner = kuka()
    result = diagnose([recording], [], owner).result
    (finding,) = result.missing
    assert (finding.effect, finding.variant) == ("channel_time_skew", "table_position")
    assert finding.parameters["delay_s"].value == pytest.approx(3.07e-3, abs=0.1e-3)
    motor = result.fit["motor_position_rad"]
    assert motor.train.before_rms <= motor.train.owner_rms
    assert max(motor.train.before_rms, motor.train.owner_rms or 0.0) < 1e-4  # it was 6e39 rad
    assert "Not explained: residuals above the noise" in result.statement
    left = result.torque_left
    assert left is not None
    assert max(left.final, left.plain) < 0.5  # of the torque of the whole move
    assert left.owner < left.plain  # the bench as given; the refit to the motion leaves 1 % more than the plain model
    assert (left.final < left.plain) != any("more than plain least squares" in note for note in result.notes)
