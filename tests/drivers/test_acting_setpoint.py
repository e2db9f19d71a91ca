"""The demand of the drive (0x6074, 0x606B, 0x6062) is compared with the set-points sent."""

from __future__ import annotations

import math
import struct

import pytest
from drive_rig import Mass, running, servo

from drivers.acting_setpoint import ActingSetpoint
from drivers.canopen_drive import CanopenDrive, DriveSettings
from drivers.canopen_master import CanopenMaster
from drivers.cia402 import DriveState, OperationMode
from drivers.inprocess import InProcessBus
from drivers.modelled_bus import Fault, FaultKind
from drivers.port import Condition, DriveFault, DriveGoal
from drivers.sim.cia402_device import STATUS
from drivers.sim.drive_node import SimulatedDrive

RPDO = 0x205
CST, CSV, CSP = (
    OperationMode.CYCLIC_SYNC_TORQUE,
    OperationMode.CYCLIC_SYNC_VELOCITY,
    OperationMode.CYCLIC_SYNC_POSITION,
)


def watch(
    mode: OperationMode, sent: list[int], counts_per_rev: float = 60_000.0, limit: float = 1000.0
) -> ActingSetpoint:
    acting = ActingSetpoint(mode, 6, counts_per_rev, limit)
    acting.sent.extend(sent)
    return acting


def frame(mode: OperationMode, demand: int) -> bytes:
    return struct.pack("<h" if mode is CST else "<i", demand)


@pytest.mark.parametrize(
    ("mode", "sent", "alike", "different"),
    [
        (CST, [100, 200], (90, 150, 210), (89, 211)),  # 1 % of the rated torque beside the commanded ones
        (CSV, [50_000], (49_000, 51_000), (48_999, 51_001)),  # 1 rpm
        (CSP, [700, 800], (640, 860), (639, 861)),  # a thousandth of a revolution
        (CSP, [2**31 - 10], (-(2**31) + 49,), (-(2**31) + 51,)),  # 0x6062 wraps
    ],
)
def test_tolerance_in_each_mode(
    mode: OperationMode, sent: list[int], alike: tuple[int, ...], different: tuple[int, ...]
) -> None:
    assert not any(watch(mode, sent).differs(frame(mode, demand)) for demand in alike)
    assert all(watch(mode, sent).differs(frame(mode, demand)) for demand in different)


def test_a_torque_beyond_the_limit_of_the_drive_acts_as_the_limit() -> None:
    assert not watch(CST, [1500], limit=1000.0).differs(frame(CST, 1000))
    assert watch(CST, [1500], limit=1000.0).differs(frame(CST, 900))


def test_before_the_first_set_point_any_demand_may_act() -> None:
    acting = watch(CST, [])
    assert not acting.differs(frame(CST, 500))
    assert acting.text == ""


def test_set_points_older_than_the_cycles_do_not_count() -> None:
    acting = watch(CST, [-500, 0, 100, 200, 300, 400, 500])
    assert acting.differs(frame(CST, -500))
    assert acting.text == "the set-point -500 acts, commanded were 0 to 500"


@pytest.mark.parametrize("mode", [CST, CSV, CSP])
def test_a_demand_is_told_with_its_sign(mode: OperationMode) -> None:
    acting = watch(mode, [1000])
    assert acting.differs(frame(mode, -9000))
    assert acting.text == "the set-point -9000 acts, commanded were 1000 to 1000"


@pytest.mark.parametrize("mode", [CSV, CSP])
def test_a_coarse_encoder_may_round_by_two_counts(mode: OperationMode) -> None:
    assert [watch(mode, [0], counts_per_rev=100.0).differs(frame(mode, demand)) for demand in (-2, 2)] == [False] * 2
    assert [watch(mode, [0], counts_per_rev=100.0).differs(frame(mode, demand)) for demand in (-3, 3)] == [True] * 2


def test_the_last_of_the_cycles_allowed_counts_and_no_older_one() -> None:
    _, rig = running()
    cycles = rig.drive.settings.missed_answers_allowed + 3
    for age, differs in ((cycles, False), (cycles + 1, True)):
        for torque in (0.5, *[0.0] * (age - 1)):
            rig.cycle(torque)
        assert rig.drive._acting.differs(frame(CST, round(0.5 * rig.drive._target_per_unit))) is differs


def test_lost_commands_are_seen_in_the_demand_and_three_are_not() -> None:
    bus, rig = running()
    for torque in (0.2, 0.4, 0.6):
        rig.cycle(torque)
    bus.inject(Fault(FaultKind.DROP, RPDO, count=3))
    assert all(rig.cycle(0.6 + 0.2 * k).condition is Condition.OK for k in range(8))
    bus.inject(Fault(FaultKind.DROP, RPDO, count=1000))
    cycles = next(k for k in range(20) if rig.cycle(1.8 - 0.2 * k).condition)
    assert cycles <= rig.drive.settings.missed_answers_allowed + 4
    assert rig.drive.tripped is Condition.OTHER_SETPOINT
    assert rig.drive.goal is DriveGoal.QUICK_STOP
    with pytest.raises(DriveFault, match=r"OTHER_SETPOINT; given: the set-point \d+ acts, commanded were"):
        rig.drive.check()
    rig.drive.reset_fault()
    rig.drive.check()


@pytest.mark.parametrize(("state", "goal", "compared"), [
    (DriveState.OPERATION_ENABLED, DriveGoal.ENABLED, True),
    (DriveState.OPERATION_ENABLED, DriveGoal.QUICK_STOP, False),
    (DriveState.OPERATION_ENABLED, DriveGoal.DISABLED, False),
    (DriveState.QUICK_STOP_ACTIVE, DriveGoal.ENABLED, False),
    (DriveState.SWITCHED_ON, DriveGoal.ENABLED, False),
])  # fmt: skip
def test_a_demand_is_compared_only_while_set_points_count(state: DriveState, goal: DriveGoal, compared: bool) -> None:
    """While the drive stops or arms, its demand is that of its own ramp."""
    _, rig = running()
    rig.drive._statusword = STATUS[state]
    rig.drive.goal = goal
    rig.node.port.send(0x285, frame(CST, 900), rig.now_s)
    rig.master.poll(rig.now_s + 0.001)
    assert bool(rig.drive._latched & Condition.OTHER_SETPOINT) == compared


def test_without_the_watch_no_second_tpdo_is_sent() -> None:
    _, rig = running(settings=DriveSettings(watch_setpoint=False))
    assert not rig.drive.info.reports_demand
    assert rig.node.values[0x1801_01] >> 31
    assert rig.drive.malformed_frames == 0


def test_a_demand_of_another_length_is_malformed() -> None:
    _, rig = running()
    rig.node.port.send(0x285, b"\0\0\0\0", rig.now_s)
    assert rig.cycle().condition is Condition.OK
    assert rig.drive.malformed_frames == 1


@pytest.mark.parametrize("travel_per_rev", [2 * math.pi, 0.02])
def test_the_tolerance_of_a_position_is_a_share_of_the_revolution(travel_per_rev: float) -> None:
    bus = InProcessBus()
    port, master = bus.port(), CanopenMaster(bus.port())
    SimulatedDrive(bus.port(), Mass(), servo=servo(), counts_per_rev=1_000_000, travel_per_rev=travel_per_rev)
    drive = CanopenDrive(master, DriveSettings(mode=CSP, travel_per_rev=travel_per_rev))
    drive.set_up()
    master.start(0.0)
    drive.goal = DriveGoal.ENABLED
    for tick in range(30):
        master.sync(tick * 0.001)
        master.poll(tick * 0.001)
        sample = drive.read(tick * 0.001)
        drive.command(tick * 0.001, 0.0)
    assert sample.enabled
    for counts, differs in ((1000, False), (1001, True)):
        port.send(0x285, struct.pack("<i", counts), 0.03)
        master.poll(0.03)
        assert bool(drive.read(0.03).condition & Condition.OTHER_SETPOINT) is differs
