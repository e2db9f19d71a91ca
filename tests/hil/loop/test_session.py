"""The loop in virtual time: complete runs, and a defined stop whatever fails."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bench_runs import MOVE, MOVING, Ran, bench_with, run

from drivers.cia402 import DriveState
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from hil.errors import StillPowered
from hil.loop.devices import Rig
from hil.loop.session import STOP_SEGMENT, Session
from hil.loop.supervision import Ending
from hil.motion.trajectory import plan
from hil.recording.recording import read_recording

SYNC, DRIVE_TPDO, ENCODER_TPDO, DRIVE_HEARTBEAT = 0x080, 0x185, 0x186, 0x705
MANY = 100_000


def at_rest(ran: Ran) -> bool:
    """True if the motor stands at the end: below 0.5 rad/s, 1 % of the speed of the move, over the last 20 ms."""
    return bool(np.ptp(ran.recording["motor_position_rad"][-20:]) < 0.01)


def speed_rad_s(rig: Rig) -> float:
    """Speed of the motor over the next millisecond, without torque."""
    plant = rig.nodes.plant
    before_rad = plant.motor_position_rad
    plant.advance(0.0, 0.001)
    return abs(plant.motor_position_rad - before_rad) / 0.001


def test_complete_run_follows_set_points_and_twin(tmp_path: Path) -> None:
    ran = run(tmp_path)
    recording = ran.recording
    trajectory = plan(MOVE, 1e-3, 0.0)
    assert ran.outcome.ending is Ending.COMPLETE
    assert np.array_equal(recording["position_command_m"], trajectory.position_m)
    assert np.array_equal(recording["time_s"], np.arange(len(trajectory)) * 1e-3)
    assert abs(recording["table_position_m"][-1] - 0.05) < 5e-6
    assert np.abs(recording["table_position_m"] - recording["twin_table_position_m"]).max() < 2e-6
    assert np.std(recording["torque_n_m"] - recording["twin_torque_n_m"]) < 0.015  # noise is 0.01
    assert set(recording["drive_state"]) == {DriveState.OPERATION_ENABLED}
    assert set(recording["drive_error_code"]) == {0}
    assert ran.rig.nodes.drive.state is DriveState.READY_TO_SWITCH_ON


def test_torque_of_a_row_is_measured_over_the_period_after_it(tmp_path: Path) -> None:
    recording = run(tmp_path, bench_with(simulation={"sensors": {"torque_noise_n_m": 0.0}})).recording
    resolution_n_m = 4.0 / 1000
    deviation = recording["torque_n_m"] - recording["torque_command_n_m"]
    assert np.abs(deviation).max() <= 0.5001 * resolution_n_m


def test_enabling_does_not_move_the_motor(tmp_path: Path) -> None:
    recording = run(tmp_path).recording
    assert np.abs(recording["torque_command_n_m"][:50]).max() < 0.01
    assert np.ptp(recording["motor_position_rad"][:50]) < 1e-5


@pytest.mark.parametrize("mode", ["csv", "csp"])
def test_loops_inside_the_drive(tmp_path: Path, mode: str) -> None:
    ran = run(tmp_path, bench_with(drive={"mode": mode}))
    recording = ran.recording
    assert ran.outcome.ending is Ending.COMPLETE
    assert "torque_command_n_m" not in recording.columns
    assert ("velocity_reference_m_s" in recording.columns) == (mode == "csv")
    error = recording["position_command_m"] - recording["table_position_m"]
    assert np.abs(error).max() < 0.5e-3
    assert abs(error[-1]) < 20e-6


def test_the_set_points_are_in_memory_before_the_drive_is_armed(tmp_path: Path) -> None:
    rows: list[int] = []

    def script(rig: Rig, session: Session) -> dict:
        return {1: lambda: rows.append(len(session._cycle.setpoints))}  # the drive is switched on at the fifth tick

    run(tmp_path, script=script)
    assert rows == [len(plan(MOVE, 1e-3, 0.0))]


def test_seed_decides_the_recording(tmp_path: Path) -> None:
    first, again, other = (run(tmp_path, bench_with(simulation={"seed": seed})).recording for seed in (7, 7, 8))
    for name in first.columns:
        assert np.array_equal(first[name], again[name]), name
    assert not np.array_equal(first["torque_n_m"], other["torque_n_m"])


# -- faults -----------------------------------------------------------------------------------------------------------


def test_emergency_of_the_drive(tmp_path: Path) -> None:
    ran = run(tmp_path, script=lambda rig, _: {MOVING: lambda: rig.nodes.drive.trip(0x2310, 0x03, 0.001 * MOVING)})
    assert ran.outcome.ending is Ending.DRIVE_FAULT
    assert "over-current" in ran.outcome.reason
    assert ran.recording["drive_error_code"][-1] == 0x2310
    assert ran.recording["drive_state"][-1] == DriveState.FAULT
    assert at_rest(ran)


@pytest.mark.parametrize(
    ("can_id", "count", "ending"),
    [
        (DRIVE_TPDO, 2, Ending.COMPLETE),
        (DRIVE_TPDO, 10, Ending.DRIVE_FAULT),
        (ENCODER_TPDO, 2, Ending.COMPLETE),
        (ENCODER_TPDO, MANY, Ending.ENCODER_FAULT),
        (DRIVE_HEARTBEAT, 2, Ending.COMPLETE),
        (DRIVE_HEARTBEAT, MANY, Ending.DRIVE_FAULT),
    ],
)
def test_frames_lost_on_the_bus(tmp_path: Path, can_id: int, count: int, ending: Ending) -> None:
    bus = ModelledBus()
    ran = run(
        tmp_path, bus=bus, script=lambda *_: {MOVING: lambda: bus.inject(Fault(FaultKind.DROP, can_id, count=count))}
    )
    assert ran.outcome.ending is ending
    assert at_rest(ran)
    assert ran.rig.nodes.drive.state not in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)


def test_bus_off_leaves_the_drive_to_its_watchdog(tmp_path: Path) -> None:
    bus, rigs = ModelledBus(), []

    def script(rig: Rig, _: Session) -> dict:
        rigs.append(rig)
        return {MOVING: lambda: bus.inject(Fault(FaultKind.BUS_OFF, SYNC))}

    with pytest.raises(StillPowered, match=r"does not answer.*reported last OPERATION_ENABLED.*at the mains.*BUS_OFF"):
        run(tmp_path, bus=bus, script=script)  # nothing tells that the drive has stopped
    assert read_recording(tmp_path / "run.parquet").metadata["ended"] == "StillPowered"
    assert rigs[0].nodes.drive.state is DriveState.FAULT  # no command reached it: its watchdogs stopped it
    assert speed_rad_s(rigs[0]) < 0.5


def test_master_that_dies_leaves_the_drive_to_its_watchdog(tmp_path: Path) -> None:
    def die() -> None:
        raise SystemExit("killed")

    with pytest.raises(SystemExit):
        run(tmp_path, script=lambda *_: {MOVING: die})
    recording = read_recording(tmp_path / "run.parquet")
    assert recording.metadata["ended"] == "SystemExit"


@pytest.mark.parametrize("feedback", ["motor", "table"])
def test_blind_linear_encoder(tmp_path: Path, feedback: str) -> None:
    bench = bench_with(control={"position_feedback": feedback})
    ran = run(tmp_path, bench, script=lambda rig, _: {MOVING: lambda: rig.nodes.encoder.raise_alarm(0.4)})
    assert ran.outcome.ending is Ending.ENCODER_FAULT
    assert "ALARM" in ran.outcome.reason
    assert at_rest(ran)
    under_control = DriveState.QUICK_STOP_ACTIVE not in ran.recording["drive_state"]
    assert under_control == (feedback == "motor")  # without its feedback the loop cannot stop the axis itself


def test_blocked_axis_stops_by_following_error_then_by_the_drive(tmp_path: Path) -> None:
    wall = {"effect": "external_force", "parameters": {"force_n": -9000.0, "start_s": 0.4, "end_s": 0.6}}
    ran = run(tmp_path, bench_with(simulation={"effects": [wall]}, drive={"following_error_m": 0.001}))
    assert ran.outcome.ending is Ending.FOLLOWING_ERROR
    assert ran.recording["segment"][-1] == STOP_SEGMENT
    assert DriveState.QUICK_STOP_ACTIVE in ran.recording["drive_state"]
    assert ran.rig.nodes.drive.state not in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)


def test_travel_limit(tmp_path: Path) -> None:
    ran = run(tmp_path, bench_with(drive={"travel_m": [-0.01, 0.03]}))
    assert ran.outcome.ending is Ending.TRAVEL_LIMIT
    assert at_rest(ran)
    stopping_m = 0.1**2 / (2 * 2.2) + 0.1 * 2.2 / 100.0
    assert 0.03 < ran.recording["table_position_m"].max() < 0.03 + 1.1 * stopping_m


def test_loop_too_late(tmp_path: Path) -> None:
    ran = run(tmp_path, script=lambda *_: {MOVING: lambda: 0.06})
    assert ran.outcome.ending is Ending.OVERRUN
    assert at_rest(ran)


def test_ctrl_c_stops_within_the_limits_and_leaves_a_recording(tmp_path: Path) -> None:
    ran = run(tmp_path, script=lambda *_: {MOVING: lambda: os.kill(os.getpid(), signal.SIGINT)})
    recording = ran.recording
    assert ran.outcome.ending is Ending.INTERRUPTED
    assert at_rest(ran)
    assert np.abs(np.diff(recording["velocity_command_m_s"])).max() <= 2.2e-3 * (1 + 1e-9)
    assert np.abs(np.diff(recording["position_command_m"])).max() <= 0.1e-3 * (1 + 1e-6)
    assert recording["velocity_command_m_s"][-1] == 0.0
    assert len(recording) < len(plan(MOVE, 1e-3, 0.0))
    assert DriveState.QUICK_STOP_ACTIVE not in recording["drive_state"]


@pytest.fixture
def _hang_ups_as_before() -> Iterator[None]:
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # as in a terminal, also under nohup
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("_hang_ups_as_before")
def test_hang_ups_of_kernel_and_shell_are_one_request(tmp_path: Path) -> None:
    hang_up = lambda: os.kill(os.getpid(), signal.SIGHUP)  # noqa: E731
    ran = run(tmp_path, script=lambda *_: dict.fromkeys((MOVING, MOVING + 5, MOVING + 9), hang_up))
    assert ran.outcome.ending is Ending.INTERRUPTED
    assert DriveState.QUICK_STOP_ACTIVE not in ran.recording["drive_state"]
    assert at_rest(ran)


@pytest.mark.usefixtures("_hang_ups_as_before")
def test_a_run_under_nohup_goes_on(tmp_path: Path) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    ran = run(tmp_path, script=lambda *_: {MOVING: lambda: os.kill(os.getpid(), signal.SIGHUP)})
    assert ran.outcome.ending is Ending.COMPLETE


def test_second_ctrl_c_is_a_quick_stop(tmp_path: Path) -> None:
    ran = run(tmp_path, script=lambda _, session: {MOVING: session.ask_stop, MOVING + 5: session.ask_stop})
    assert ran.outcome.ending is Ending.INTERRUPTED
    assert DriveState.QUICK_STOP_ACTIVE in ran.recording["drive_state"]
    assert at_rest(ran)


def test_exception_in_the_loop_stops_the_drive_and_closes_the_recording(tmp_path: Path) -> None:
    rigs = []

    def fail() -> None:
        raise ZeroDivisionError("a bug")

    def script(rig: Rig, _: Session) -> dict:
        rigs.append(rig)
        return {MOVING: fail}

    with pytest.raises(ZeroDivisionError):
        run(tmp_path, script=script)
    recording = read_recording(tmp_path / "run.parquet")
    assert recording.metadata["ended"] == "ZeroDivisionError"
    assert len(recording) > MOVING - 20
    assert rigs[0].nodes.drive.state is DriveState.SWITCH_ON_DISABLED
    plant = rigs[0].nodes.plant
    before_rad = plant.motor_position_rad
    plant.advance(0.0, 0.001)
    assert abs(plant.motor_position_rad - before_rad) < 1e-4  # 0.1 rad/s
