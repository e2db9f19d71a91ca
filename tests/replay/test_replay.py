"""A recorded run fed back through the controller gives the same bits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_runs import MOVING, bench_with, run

from hil.control import cascade


def differing(recorded: np.ndarray, replayed: np.ndarray) -> str:
    """Describe a difference for a reader: which rows, and by how much."""
    rows = np.flatnonzero(recorded != replayed)
    if not rows.size:
        return ""
    first = rows[0]
    return (
        f"{rows.size} of {recorded.size} rows differ, the first is {first}: recorded {recorded[first]!r}, "
        f"replayed {replayed[first]!r}"
    )


@pytest.mark.parametrize(
    "control_section",
    [
        {},
        {"position_feedback": "table"},
        {"velocity_estimate": "two_sample_mean"},
        {"velocity_filter_time_constant_s": 0.0008},
        {"torque_limit_n_m": 2.0},
        {"velocity_integral_time_ms": None},
    ],
    ids=["reference", "table feedback", "two-sample mean", "filter", "limited", "P only"],
)
def test_replay_is_bit_identical(tmp_path: Path, control_section: dict[str, Any]) -> None:
    bench = bench_with(control=control_section)
    recording = run(tmp_path, bench).recording
    motor, table = recording["motor_position_rad"], recording["table_position_m"]
    torque, reference = cascade.replay(
        bench.gains,
        cascade.init(motor[0], period_s=bench.gains.period_s),
        recording["position_command_m"],
        recording["velocity_command_m_s"],
        motor,
        table,
    )
    assert recording["torque_command_n_m"].std() > 0.1
    assert differing(recording["torque_command_n_m"], torque) == ""
    assert differing(recording["velocity_reference_m_s"], reference) == ""


def test_replay_holds_through_a_fault(tmp_path: Path) -> None:
    bench = bench_with()
    ran = run(tmp_path, bench, script=lambda rig, _: {MOVING: lambda: rig.nodes.drive.trip(0x2310, 0x03, 0.4)})
    recording = ran.recording
    motor = recording["motor_position_rad"]
    torque, _ = cascade.replay(
        bench.gains,
        cascade.init(motor[0], period_s=bench.gains.period_s),
        recording["position_command_m"],
        recording["velocity_command_m_s"],
        motor,
        recording["table_position_m"],
    )
    assert differing(recording["torque_command_n_m"], torque) == ""


def test_live_twin_is_the_offline_twin(tmp_path: Path) -> None:
    bench = bench_with()
    recording = run(tmp_path, bench).recording
    offline = bench.twin().simulate(recording["position_command_m"], recording["velocity_command_m_s"])
    assert np.abs(recording["twin_table_position_m"] - offline.table_position_m).max() < 1e-12
    assert np.abs(recording["twin_torque_n_m"] - offline.torque).max() < 1e-9
