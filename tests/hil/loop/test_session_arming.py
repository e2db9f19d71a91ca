"""Arming in virtual time: what must not arm, set-points before it, latched faults, dead-man times in the drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_runs import MOVE, MOVING, bench_with
from faulty_bench import FaultyBench

from drivers.bus import BusState
from drivers.cia402 import DriveState
from drivers.modelled_bus import Fault, FaultKind
from drivers.port import DriveGoal
from hil.errors import HilError
from hil.loop.devices import Rig
from hil.loop.run import run_profile
from hil.loop.session import Session
from hil.loop.stall import command_deadline_s
from hil.loop.supervision import Ending

RPDO, DRIVE_TPDO = 0x205, 0x185
ARMING = 3  # a tick before the drive is enabled


@pytest.fixture
def at(tmp_path: Path) -> FaultyBench:
    return FaultyBench(tmp_path)


# -- arming -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_a_passive_bus_while_arming_does_not_hide_a_drive_that_switches_off(at: FaultyBench, mode: str) -> None:
    def passive(rig: Rig) -> None:
        rig.master.health.state = BusState.PASSIVE

    def off(rig: Rig) -> None:
        rig.nodes.drive.values[0x6007_00] = 2  # power off without a fault
        rig.nodes.drive.communication_lost(0.001 * MOVING)

    ran = at.run(bench_with(drive={"mode": mode}), lambda rig, _: {1: lambda: passive(rig), MOVING: lambda: off(rig)})
    assert ran.outcome.ending is Ending.DRIVE_FAULT
    assert "DISABLED" in ran.outcome.reason
    states = ran.recording["drive_state"]
    left = int(np.argmax(states != DriveState.OPERATION_ENABLED))
    assert DriveState.OPERATION_ENABLED not in states[left:]


@pytest.mark.parametrize("moved_m", [0.002, -0.002])
def test_an_axis_that_moves_while_the_drive_is_armed_is_not_started(at: FaultyBench, moved_m: float) -> None:
    bench = bench_with(drive={"mode": "cst", "following_error_m": 0.001})

    def push(rig: Rig) -> None:
        plant = rig.nodes.plant
        plant.reset(moved_m)
        rig.nodes.drive._measure(round(plant.motor_position_rad * rig.nodes.drive._counts_per_rad))

    with pytest.raises(HilError, match=rf"the axis stands at {moved_m:.3f}.*begin at 0.000000 m: it moved"):
        at.run(bench, lambda rig, _: {ARMING: lambda: push(rig)})
    assert at.rig.nodes.drive.state is DriveState.SWITCH_ON_DISABLED
    assert not (at.folder / "run.parquet").exists()  # not one row


def test_a_stale_sample_does_not_arm(at: FaultyBench) -> None:
    """A drive that was enabled at the end of its set-up and gives no answer to the first SYNCs."""

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        rig.drive._statusword = 0x0237
        at.bus.inject(Fault(FaultKind.DROP, DRIVE_TPDO, count=2))
        return {}

    with pytest.raises(HilError, match="DISABLED"):  # the first answer says that it is not enabled any more
        at.run(bench_with(), events)
    assert not (at.folder / "run.parquet").exists()


def test_a_drive_that_stays_enabled_in_its_set_up_is_refused(at: FaultyBench) -> None:
    with Rig(bench_with(), bus=at.bus) as rig:
        drive = rig.nodes.drive
        rig.set_up()
        drive._set_state(DriveState.OPERATION_ENABLED)
        drive._take_controlword = lambda now_s: None
        drive.dictionary.on_write(0x6060, lambda index, subindex, value: None)  # takes any mode in any state
        with pytest.raises(HilError, match=r"power stage is still on.*OPERATION_ENABLED"):
            rig.set_up()


def test_a_fault_while_arming_is_not_armed_over(at: FaultyBench) -> None:
    """An EMCY that leaves the drive enabled: the run does not begin."""
    with pytest.raises(HilError, match="EMERGENCY"):
        at.run(bench_with(), lambda rig, _: {ARMING: lambda: rig.nodes.drive.emergency(0x4310, 0x09, 0.003)})
    assert not (at.folder / "run.parquet").exists()  # not one row
    assert at.rig.nodes.drive.state is DriveState.SWITCH_ON_DISABLED


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_targets_are_the_actual_values_until_the_drive_is_enabled(at: FaultyBench, mode: str) -> None:
    heard: list[tuple[int, int]] = []

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        drive = rig.nodes.drive
        drive.values[0x6071_00] = drive.values[0x60FF_00] = drive.values[0x607A_00] = 30_000  # left over

        def listen(can_id: int, data: bytes, now_s: float) -> None:
            if drive.state is not DriveState.OPERATION_ENABLED:
                counts = int.from_bytes(data[2:], "little", signed=True)
                heard.append((counts, drive.values[0x6064_00] if mode == "csp" else 0))

        drive.port.listen(RPDO, listen)
        return {}

    at.run(bench_with(drive={"mode": mode}), events)
    assert len(heard) > 3
    assert all(abs(sent - actual) <= 1 for sent, actual in heard)


def test_quick_stop_keeps_to_the_torque_limit(at: FaultyBench) -> None:
    limit_n_m = 0.5
    torques: list[float] = []

    def events(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        def stop() -> None:
            rig.nodes.drive.values[0x6072_00] = round(limit_n_m * rig.nodes.drive._mille_per_n_m)
            session.ask_stop()
            session.ask_stop()

        watch = {MOVING + k: lambda: torques.append(rig.nodes.plant.torque_n_m) and 0.0 for k in range(3, 200)}
        return watch | {MOVING: stop}

    ran = at.run(bench_with(simulation={"sensors": {"torque_noise_n_m": 0.0}}), events)
    assert DriveState.QUICK_STOP_ACTIVE in ran.recording["drive_state"]
    assert 0.9 * limit_n_m < np.abs(torques).max() < 1.01 * limit_n_m


def test_dead_man_times_and_stop_reactions_are_in_the_drive(at: FaultyBench) -> None:
    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        number = rig.nodes.drive.dictionary.number
        assert number(0x1400, 5) == math.floor(1e3 * command_deadline_s(bench_with()))
        assert number(0x1016, 1) == 1 << 16 | 60
        assert number(0x1017) == 20
        assert number(0x1006) == 1000
        assert [number(index) for index in (0x605A, 0x605E, 0x6007)] == [2, 2, 1]
        assert number(0x1600) == 2
        assert [number(0x1600, k) for k in (1, 2)] == [0x60400010, 0x60710010]
        return {}

    # as another tool left them: coast at quick stop, nothing at a lost master
    bench = bench_with()
    defaults = {0x605A: 0, 0x605E: 0, 0x6007: 0}
    with Rig(bench, bus=at.bus) as rig:
        rig.nodes.drive.values.update({index << 8: value for index, value in defaults.items()})
        rig.set_up()
        events(rig, None)


# -- faults stay latched ----------------------------------------------------------------------------------------------


def test_a_latched_fault_is_reset_only_on_demand(at: FaultyBench) -> None:
    bench = bench_with()
    with Rig(bench, bus=at.bus) as rig:
        rig.nodes.drive.trip(0x4310, 0x08, 0.0, lasting=True)
        for _ in range(2):
            with pytest.raises(HilError, match="FAULT"):
                run_profile(bench, MOVE, at.folder, "run", virtual=True, rig=rig)
        with pytest.raises(HilError, match="the fault remains after its reset"):
            run_profile(bench, MOVE, at.folder, "run", virtual=True, rig=rig, reset_fault=True)
        rig.nodes.drive.clear_cause()
        with pytest.raises(HilError, match="FAULT"):
            run_profile(bench, MOVE, at.folder, "run", virtual=True, rig=rig)
        assert run_profile(bench, MOVE, at.folder, "run", virtual=True, rig=rig, reset_fault=True).complete


def test_a_reset_without_a_fault_does_not_reset_a_later_one(at: FaultyBench) -> None:
    def reset(rig: Rig) -> None:
        rig.drive.reset_fault()
        rig.drive.goal = DriveGoal.ENABLED

    def trip(rig: Rig) -> None:
        rig.nodes.drive.trip(0x2310, 0x03, 0.001 * MOVING)

    ran = at.run(bench_with(), lambda rig, _: {MOVING - 50: lambda: reset(rig), MOVING: lambda: trip(rig)})
    assert ran.outcome.ending is Ending.DRIVE_FAULT
    assert ran.rig.nodes.drive.state is DriveState.FAULT


def test_an_old_answer_does_not_confirm_that_power_is_off(at: FaultyBench) -> None:
    """The bus fails after "enable operation" was sent: the last answer says SWITCHED ON, the drive is enabled."""

    states: list[DriveState] = []

    def fail(rig: Rig, session: Session) -> None:
        at.lose(DRIVE_TPDO)
        at.lose(RPDO)
        session.ask_stop()

    with pytest.raises(HilError, match="interrupted while the drive was armed"):
        at.run(
            bench_with(),
            lambda rig, session: {
                ARMING + 1: lambda: fail(rig, session),
                ARMING + 2: lambda: states.append(rig.nodes.drive.state),
            },
        )
    assert states == [DriveState.OPERATION_ENABLED]
    assert at.rig.nodes.drive.state in (DriveState.SWITCH_ON_DISABLED, DriveState.FAULT)
