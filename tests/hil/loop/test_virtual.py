"""Virtual time in one compiled call gives bit for bit what the bus gives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_runs import bench_with, run

from hil.errors import HilError
from hil.loop import virtual
from hil.loop.devices import Rig
from hil.loop.session import STOP_SEGMENT, Session
from hil.loop.simulated_bench import load_simulated
from hil.loop.supervision import Ending

PUSH = {"effect": "external_force", "parameters": {"force_n": -9000.0, "start_s": 0.4, "end_s": 0.6}}
CASES: dict[str, tuple[dict[str, Any], Ending]] = {
    "reference": ({}, Ending.COMPLETE),
    "table feedback": ({"control": {"position_feedback": "table"}}, Ending.COMPLETE),
    "torque beyond the drive's greatest": (
        {"control": {"torque_limit_n_m": 1000.0}, "drive": {"rated_torque_n_m": 0.7, "following_error_m": 0.1}},
        Ending.COMPLETE,
    ),
    "noisy sensors": ({"simulation": {"sensors": {"table_noise_m": 1e-6, "motor_noise_rad": 1e-5}}}, Ending.COMPLETE),
    "travel limit": ({"drive": {"travel_m": (-0.01, 0.03)}}, Ending.TRAVEL_LIMIT),
    "blocked": ({"simulation": {"effects": [PUSH]}, "drive": {"following_error_m": 0.001}}, Ending.FOLLOWING_ERROR),
    "velocity": ({"drive": {"supervision": {"velocity_m_s": 0.06}}}, Ending.VELOCITY),
    "torque": ({"drive": {"supervision": {"torque": 1.0}}}, Ending.TORQUE),
    "drive's own loops": ({"drive": {"mode": "csv"}}, Ending.COMPLETE),
}


@pytest.mark.parametrize("name", CASES)
def test_same_bits_as_over_the_bus(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual, "SNAPSHOT_TICKS", 150)  # several in a run of 800 ticks
    changes, ending = CASES[name]
    bench = bench_with(**changes)
    framed = run(tmp_path / "framed", bench)
    compiled = run(tmp_path / "compiled", bench, compiled=True)
    assert framed.outcome.ending is compiled.outcome.ending is ending
    assert framed.outcome.rows == compiled.outcome.rows
    for channel in framed.recording.columns:
        assert np.array_equal(framed.recording[channel], compiled.recording[channel]), channel


def test_seven_dof_bench(tmp_path: Path) -> None:
    bench = load_simulated("reference_7dof")
    framed, compiled = run(tmp_path / "framed", bench), run(tmp_path / "compiled", bench, compiled=True)
    assert framed.outcome.ending is Ending.COMPLETE
    for channel in framed.recording.columns:
        assert np.array_equal(framed.recording[channel], compiled.recording[channel]), channel


def test_stop_asked_while_arming_moves_nothing(tmp_path: Path) -> None:
    with pytest.raises(HilError, match="nothing moved"):
        run(tmp_path, compiled=True, script=lambda _, session: {2: session.ask_stop})


def test_a_stop_asked_between_two_blocks_begins_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual, "SNAPSHOT_TICKS", 150)

    def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        recorder = session._recorder
        record = recorder.record_block

        def record_and_ask(block: Any) -> None:
            record(block)
            session.ask_stop()

        monkeypatch.setattr(recorder, "record_block", record_and_ask)
        return {}

    ran = run(tmp_path, compiled=True, script=script)
    assert ran.outcome.ending is Ending.INTERRUPTED
    assert int(np.argmax(ran.recording["segment"] == STOP_SEGMENT)) in (150, 151)
