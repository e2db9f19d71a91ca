"""Each rule of supervision stops the axis in virtual time, with its name and within its bound."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from bench_runs import MOVE, MOVING, Ran, bench_with, run

from drivers.cia402 import DriveState
from drivers.inprocess import InProcessBus
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from drivers.port import Condition
from hil.identification.residual_thresholds import learn
from hil.loop.clock import VirtualClock, next_due
from hil.loop.devices import Rig
from hil.loop.session import STOP_SEGMENT, Session
from hil.loop.supervision import Ending
from hil.motion.trajectory import plan

RATIO = 0.01 / (2.0 * math.pi)
Change = Callable[[float, float], float]  # value, value when the fault began -> reading


def altered(device: str, change: Change) -> Callable[[Rig, Session], dict]:
    """Script that changes the positions an encoder gives from MOVING on."""

    def script(rig: Rig, _: Session) -> dict:
        read = getattr(rig, device).read
        name = "motor_position_rad" if device == "drive" else "position_m"
        start: list[float] = []

        def faulty(now_s: float) -> Any:
            sample = read(now_s)
            value = getattr(sample, name)
            start.append(value)
            return sample._replace(**{name: change(value, start[0])})

        return {MOVING: lambda: setattr(getattr(rig, device), "read", faulty)}

    return script


def quick(ran: Ran) -> bool:
    return DriveState.QUICK_STOP_ACTIVE in ran.recording["drive_state"]


def off(ran: Ran) -> bool:
    return ran.rig.nodes.drive.state not in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)


FROZEN: Change = lambda value, start: start  # noqa: E731
REVERSED: Change = lambda value, start: 2.0 * start - value  # noqa: E731
SCALED: Change = lambda value, start: start + 0.5 * (value - start)  # noqa: E731
NAN: Change = lambda value, start: math.nan  # noqa: E731


@pytest.mark.parametrize("feedback", ["motor", "table"])
@pytest.mark.parametrize(
    ("device", "change", "reason"),
    [
        ("encoder", FROZEN, "table encoder is frozen"),
        ("drive", FROZEN, "motor encoder is frozen"),
        ("encoder", lambda value, start: value + 0.05, "table encoder jumped"),
        ("drive", lambda value, start: value + 0.05 / RATIO, "motor encoder jumped"),
        ("encoder", SCALED, "differ by more than the transmission"),
    ],
)
def test_encoders_are_compared(tmp_path: Path, feedback: str, device: str, change: Change, reason: str) -> None:
    bench = bench_with(control={"position_feedback": feedback}, drive={"following_error_m": 0.01, "supervision": {
        "encoder_difference_m": 0.001, "frozen_m": 0.0003}})  # fmt: skip
    ran = run(tmp_path, bench, script=altered(device, change))
    assert ran.outcome.ending is Ending.ENCODER_FAULT
    assert reason in ran.outcome.reason
    assert off(ran)
    assert quick(ran) == (device == "drive" or feedback == "table")


def test_table_encoder_that_counts_backwards(tmp_path: Path) -> None:
    def script(rig: Rig, _: Session) -> dict:
        read = rig.encoder.read

        def backwards(now_s: float) -> Any:
            sample = read(now_s)
            return sample._replace(position_m=-sample.position_m)

        return {1: lambda: setattr(rig.encoder, "read", backwards)}

    ran = run(tmp_path, script=script)
    assert ran.outcome.ending is Ending.ENCODER_FAULT
    assert "table encoder counts against" in ran.outcome.reason
    assert ran.recording["position_command_m"].max() < 0.002


@pytest.mark.parametrize("device", ["drive", "encoder"])
def test_nan_stops_at_once(tmp_path: Path, device: str) -> None:
    ran = run(tmp_path, script=altered(device, NAN))
    assert ran.outcome.ending is Ending.NOT_FINITE
    assert quick(ran)
    assert off(ran)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_following_error_of_both_signs(tmp_path: Path, sign: float) -> None:
    push = {"effect": "external_force", "parameters": {"force_n": sign * 9000.0, "start_s": 0.4, "end_s": 0.6}}
    ran = run(tmp_path, bench_with(simulation={"effects": [push]}, drive={"following_error_m": 0.0005}))
    assert ran.outcome.ending is Ending.FOLLOWING_ERROR


def test_following_error_grows_with_speed_if_the_bench_says_so(tmp_path: Path) -> None:
    usual = run(tmp_path / "usual").recording
    error_m = np.abs(usual["position_command_m"] - RATIO * usual["motor_position_rad"])
    worst = int(np.argmax(error_m))
    speed_m_s = abs(usual["velocity_command_m_s"][worst])
    given = {"encoder_difference_m": 0.003, "frozen_m": 0.0003, "velocity_m_s": 1.0}
    tight = {"following_error_m": 0.95 * error_m[worst], "supervision": given}
    assert run(tmp_path / "a", bench_with(drive=tight)).outcome.ending is Ending.FOLLOWING_ERROR
    scaled = tight | {"supervision": given | {"following_error_s": 0.1 * error_m[worst] / speed_m_s}}
    assert run(tmp_path / "b", bench_with(drive=scaled)).outcome.ending is Ending.COMPLETE


def test_lower_end_of_the_travel(tmp_path: Path) -> None:
    profile = MOVE.model_copy(deep=True)
    data = profile.model_dump()
    data["segments"][1]["to_m"] = -0.05
    ran = run(tmp_path, bench_with(drive={"travel_m": [-0.03, 0.36]}), profile=type(MOVE).model_validate(data))
    assert ran.outcome.ending is Ending.TRAVEL_LIMIT
    assert -0.036 < ran.recording["table_position_m"].min() < -0.03


@pytest.mark.parametrize(
    ("given", "ending"),
    [
        ({"velocity_m_s": 0.05}, Ending.VELOCITY),
        ({"torque": 1.0}, Ending.TORQUE),
        ({"continuous_torque": 0.1, "thermal_time_s": 0.5}, Ending.TORQUE),
        ({"residual": {"motor_m": 1e-9, "table_m": 1e-9, "torque": 1e-3}}, Ending.RESIDUAL),
    ],
)
def test_bounds_of_the_bench(tmp_path: Path, given: dict[str, Any], ending: Ending) -> None:
    ran = run(tmp_path, bench_with(drive={"supervision": given}))
    assert ran.outcome.ending is ending
    assert off(ran)
    assert run(tmp_path / "without").outcome.ending is Ending.COMPLETE


def test_residual_names_the_load(tmp_path: Path) -> None:
    recording = run(tmp_path / "good").recording
    thresholds = learn([recording], RATIO).model_dump()
    drive = {"following_error_m": 0.01, "supervision": {"residual": thresholds}}
    assert run(tmp_path / "again", bench_with(drive=drive, simulation={"seed": 5})).outcome.ending is Ending.COMPLETE
    push = {"effect": "external_force", "parameters": {"force_n": -2000.0, "start_s": 0.4, "end_s": 0.6}}
    ran = run(tmp_path / "load", bench_with(drive=drive, simulation={"effects": [push]}))
    assert ran.outcome.ending is Ending.RESIDUAL
    assert "suspect: load" in ran.outcome.reason


def test_residual_names_the_encoder(tmp_path: Path) -> None:
    thresholds = learn([run(tmp_path / "good").recording], RATIO).model_dump()
    bench = bench_with(drive={"supervision": {"residual": thresholds}})
    ran = run(tmp_path / "bad", bench, script=altered("encoder", SCALED))
    assert ran.outcome.ending is Ending.RESIDUAL
    assert "suspect: encoder" in ran.outcome.reason


@pytest.mark.parametrize("stall_ticks", [2, 8])
def test_a_stall_leaves_a_gap_and_no_burst(tmp_path: Path, stall_ticks: int) -> None:
    sent: list[float] = []

    bus = InProcessBus()
    bus.port().listen(0x080, lambda can_id, data, now_s: sent.append(now_s))
    ran = run(tmp_path, bus=bus, script=lambda *_: {MOVING: lambda: stall_ticks * 1e-3})
    recording = ran.recording
    assert ran.outcome.ending is Ending.COMPLETE
    assert ran.outcome.skipped == stall_ticks
    assert np.min(np.diff(sent)) > 0.99e-3
    stored = pq.read_table(tmp_path / "run.parquet")
    ticks = np.round(stored["time_s"].to_numpy() / 1e-3).astype(int)
    assert sorted(set(np.diff(ticks))) == [1, stall_ticks + 1]
    trajectory = plan(MOVE, 1e-3, 0.0)
    assert np.array_equal(stored["position_command_m"].to_numpy(), trajectory.position_m[ticks])
    assert f"{stall_ticks} rows are missing in 1 place at" in recording.metadata["clock_notes"][0]
    usual = run(tmp_path / "usual").recording
    assert np.abs(recording["torque_command_n_m"]).max() < np.abs(usual["torque_command_n_m"]).max() + 2.0
    assert np.abs(recording["table_position_m"] - recording["twin_table_position_m"]).max() < 1e-3


def test_a_stall_after_the_last_row_leaves_no_gap(tmp_path: Path) -> None:
    def ticks_of(folder: Path, script: Any = None) -> tuple[Ran, list[int]]:
        sent: list[float] = []
        bus = InProcessBus()
        bus.port().listen(0x080, lambda can_id, data, now_s: sent.append(now_s))
        return run(folder, bus=bus, script=script), [round(time_s / 1e-3) for time_s in sent]

    last = ticks_of(tmp_path / "usual")[1][-1]
    ran, ticks = ticks_of(tmp_path / "stalled", lambda *_: {last: lambda: 8e-3})
    assert ticks[-1] >= last + 8
    assert (ran.outcome.skipped, ran.outcome.ending) == (0, Ending.COMPLETE)


def test_ticks_too_late_are_passed_to_the_next_one_in_time() -> None:
    class Stalled(VirtualClock):
        def wait(self, tick: int) -> float:
            return {10: 0.0029, 13: 0.0006}.get(tick, 0.0)

    assert next_due(Stalled(), 10, 1e-3, 0.0029) == (14, 0.004, 4)  # late since tick 10, though 14 is in time
    assert next_due(Stalled(), 11, 1e-3, 0.0) == (11, 0.0, 0)


def test_a_loop_that_is_always_late_acts_at_its_limit() -> None:
    class AlwaysLate(VirtualClock):
        def wait(self, tick: int) -> float:
            return 0.0009

    assert next_due(AlwaysLate(), 10, 1e-3, 0.0009, 0.003) == (14, pytest.approx(0.0049), 4)


def test_third_ctrl_c_ends_the_loop(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, script=lambda _, session: {MOVING + k: session.ask_stop for k in range(3)})


@pytest.mark.parametrize("feedback", ["motor", "table"])
@pytest.mark.parametrize("condition", [Condition.HEARTBEAT_LOST, Condition.BUS_OFF, Condition.LINE_LOST])
def test_conditions_of_the_table_encoder(tmp_path: Path, feedback: str, condition: Condition) -> None:
    def script(rig: Rig, _: Session) -> dict:
        read = rig.encoder.read

        def faulty(now_s: float) -> Any:
            sample = read(now_s)
            return sample._replace(condition=sample.condition | condition)

        return {MOVING: lambda: setattr(rig.encoder, "read", faulty)}

    ran = run(tmp_path, bench_with(control={"position_feedback": feedback}), script=script)
    assert ran.outcome.ending is Ending.ENCODER_FAULT
    assert ran.recording["segment"][-1] == STOP_SEGMENT
    assert quick(ran) == (feedback == "table")


def test_encoder_heartbeat_lost_on_the_bus(tmp_path: Path) -> None:
    bus = ModelledBus()
    lost = Fault(FaultKind.DROP, 0x706, count=100_000)
    ran = run(tmp_path, bus=bus, script=lambda *_: {MOVING: lambda: bus.inject(lost)})
    assert ran.outcome.ending is Ending.ENCODER_FAULT
    assert "HEARTBEAT_LOST" in ran.outcome.reason
