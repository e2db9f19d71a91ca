"""Our drive client against the simulated drive, in every mode."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from drive_rig import Mass, Rig, in_process
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.canopen_drive import TRIPPING, CanopenDrive, DriveSettings, HomingSettings
from drivers.canopen_master import CanopenMaster
from drivers.cia402 import DriveState, HomingPhase, OperationMode
from drivers.homing import HomingRun
from drivers.inprocess import InProcessBus
from drivers.port import Condition, ConfigurationError, DriveGoal
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.servo import DriveServo, Servo

R = 0.01 / (2 * math.pi)


def soft_servo() -> DriveServo:
    """Gains for the test mass of 0.01 kg m2."""
    return DriveServo(Servo(velocity_gain_n_m_s_rad=1.0, velocity_integral_time_s=0.02, position_every=1), R)


def test_enable_and_cycle_torque(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.set_up()
    assert rig.cycle().state is DriveState.SWITCH_ON_DISABLED
    rig.enable()
    samples = [rig.cycle(2.0) for _ in range(100)]
    assert all(sample.condition is Condition.OK and sample.age_cycles == 0 for sample in samples)
    # 2 N m on 0.01 kg m2 over 99 periods, the torque of tick k acting from k to k + 1
    assert samples[-1].torque_n_m == 2.0
    assert samples[-1].motor_position_rad == pytest.approx(0.5 * 200 * 0.099**2, abs=2e-5)
    assert rig.encoder_sample.position_m == pytest.approx(samples[-1].motor_position_rad * R, abs=0.5e-6)
    assert [samples[k].time_s for k in (0, 99)] == pytest.approx([samples[0].time_s, samples[0].time_s + 0.099])


def test_torque_of_this_tick_acts_until_the_next_and_is_measured_then(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.set_up()
    rig.enable()
    commands = [1.0, -2.0, 0.5, 0.0, 3.0]
    measured = [rig.cycle(command).torque_n_m for command in commands]
    assert measured[1:] == commands[:-1]


def test_synchronous_rpdo_acts_one_sync_later() -> None:
    rig = in_process(settings=DriveSettings(command_transmission=1))
    rig.set_up()
    rig.enable()
    rig.cycle()
    commands = [1.0, -2.0, 0.5, 0.0, 3.0]
    measured = [rig.cycle(command).torque_n_m for command in commands]
    assert measured[2:] == commands[:-2]


def test_enabling_never_jumps_whatever_is_commanded() -> None:
    for mode in (
        OperationMode.CYCLIC_SYNC_TORQUE,
        OperationMode.CYCLIC_SYNC_VELOCITY,
        OperationMode.CYCLIC_SYNC_POSITION,
    ):
        rig = in_process(settings=DriveSettings(mode=mode), servo=soft_servo(), plant=Mass(motor_position_rad=5.0))
        rig.set_up()
        rig.drive.goal = DriveGoal.ENABLED
        while not rig.cycle(100.0).enabled:  # a stale or wild set-point while the drive is still off
            assert rig.plant.motor_position_rad == 5.0
            assert rig.node.values[0x6071_00] == 0
            assert rig.node.values[0x60FF_00] == 0
        # the cycle above sent the first real set-point; what was in the drive before it was no motion
        assert rig.plant.motor_position_rad == pytest.approx(5.0, abs=1e-5)


def test_set_up_refuses_to_leave_an_enabled_power_stage() -> None:
    rig = in_process()
    rig.set_up()
    rig.enable()
    rig.drive.set_up()
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED


def test_disable_and_enable_again() -> None:
    rig = in_process()
    rig.set_up()
    rig.enable()
    rig.drive.goal = DriveGoal.DISABLED
    samples = [rig.cycle(1.0) for _ in range(5)]
    assert samples[-1].state is DriveState.READY_TO_SWITCH_ON
    assert samples[-1].torque_n_m == 0.0
    assert rig.drive.tripped is Condition.OK
    assert rig.enable().enabled


def test_csv_follows_velocity_in_drive() -> None:
    rig = in_process(settings=DriveSettings(mode=OperationMode.CYCLIC_SYNC_VELOCITY), servo=soft_servo())
    rig.set_up()
    rig.enable()
    for _ in range(300):
        rig.cycle(20.0)
    assert rig.plant.velocity_rad_s == pytest.approx(20.0, rel=1e-3)


def test_csp_follows_position_in_drive_across_the_counter_wrap() -> None:
    start_rad = ((1 << 31) - 50_000) * 2 * math.pi / (1 << 20)  # 50 000 counts below the wrap of an INTEGER32
    rig = in_process(settings=DriveSettings(mode=OperationMode.CYCLIC_SYNC_POSITION), servo=soft_servo(),
                     plant=Mass(motor_position_rad=start_rad))  # fmt: skip
    rig.set_up()
    sample = rig.enable()
    for k in range(800):
        sample = rig.cycle(start_rad + min(k, 400) * 0.002)
    assert sample.condition is Condition.OK
    assert sample.motor_position_rad == pytest.approx(start_rad + 0.8, abs=1e-4)
    assert rig.node.values[0x6064_00] < 0  # it did wrap on the wire


def test_csv_with_a_slower_sync_runs_the_inner_loop_every_millisecond() -> None:
    settings_ = DriveSettings(mode=OperationMode.CYCLIC_SYNC_VELOCITY, period_s=0.004)
    rig = in_process(settings=settings_, servo=soft_servo())
    rig.set_up()
    assert rig.node.period_s == 0.004
    rig.enable()
    for _ in range(100):
        rig.cycle(10.0)
    assert rig.plant.velocity_rad_s == pytest.approx(10.0, rel=1e-3)


def test_following_error_trips_the_drive() -> None:
    rig = in_process(settings=DriveSettings(mode=OperationMode.CYCLIC_SYNC_POSITION), servo=soft_servo())
    rig.node.values[0x6065_00] = 20_000
    rig.set_up()
    rig.enable()
    for _ in range(200):
        sample = rig.cycle(3.0)
    assert sample.state is DriveState.FAULT
    assert rig.node.values[0x603F_00] == 0x8611
    assert "following error" in rig.drive.emergencies[-1].text


def test_quick_stop_brakes_on_its_ramp_and_switches_off() -> None:
    velocity = DriveSettings(mode=OperationMode.CYCLIC_SYNC_VELOCITY, quick_stop_rad_s2=200.0)
    rig = in_process(settings=velocity, servo=soft_servo())
    rig.set_up()
    rig.enable()
    for _ in range(300):
        rig.cycle(20.0)
    rig.drive.goal = DriveGoal.QUICK_STOP
    states, speeds = [], []
    for _ in range(400):
        states.append(rig.cycle(20.0).state)
        speeds.append(rig.plant.velocity_rad_s)
    assert DriveState.QUICK_STOP_ACTIVE in states
    assert states[-1] is DriveState.SWITCH_ON_DISABLED
    assert speeds[50] == pytest.approx(20.0 - 200.0 * 0.049, abs=0.6)  # half-way down the ramp of 0.1 s
    assert abs(speeds[-1]) < 0.5
    assert rig.drive.tripped is Condition.OK


def test_fault_is_reset_by_one_edge_and_only_when_its_cause_is_gone() -> None:
    rig = in_process()
    rig.set_up()
    rig.enable()
    rig.node.trip(0x4310, 0x08, rig.now_s, lasting=True)
    for _ in range(5):
        sample = rig.cycle()
    assert sample.state is DriveState.FAULT
    assert sample.condition & Condition.FAULT
    assert rig.drive.goal is DriveGoal.QUICK_STOP
    rig.drive.reset_fault()
    for _ in range(5):
        sample = rig.cycle()
    assert sample.state is DriveState.FAULT
    rig.node.clear_cause()
    rig.drive.reset_fault()
    for _ in range(5):
        sample = rig.cycle()
    assert sample.state is DriveState.READY_TO_SWITCH_ON
    assert sample.condition is Condition.OK
    assert not rig.drive.emergencies[-1].active
    assert rig.enable().enabled


@pytest.mark.parametrize(("method", "index"), [(34, 3), (33, 2), (37, None)])
def test_homing_ends_on_the_index_pulse_at_rest(method: int, index: int | None) -> None:
    start_rad = 2.3 * 2 * math.pi
    homing = HomingSettings(method, speed_rad_s=10.0, acceleration_rad_s2=300.0, offset_rad=1.0)
    rig = in_process(settings=DriveSettings(mode=OperationMode.HOMING, homing=homing), servo=soft_servo(),
                     plant=Mass(motor_position_rad=start_rad))  # fmt: skip
    rig.set_up()
    rig.enable()
    run = HomingRun(rig.drive, standstill_rad_s=0.05)
    while run.phase not in (HomingPhase.DONE, HomingPhase.FAILED):
        assert rig.tick < 3000
        run.step(rig.cycle())
    assert run.phase is HomingPhase.DONE
    assert abs(rig.plant.velocity_rad_s) < 0.1
    reference_rad = start_rad if index is None else index * 2 * math.pi
    assert rig.drive.read(rig.now_s).motor_position_rad - 1.0 == pytest.approx(
        rig.plant.motor_position_rad - reference_rad, abs=1e-4
    )
    rig.drive.set_up(replace(rig.settings, mode=OperationMode.CYCLIC_SYNC_TORQUE))
    rig.master.start(rig.now_s)
    assert rig.enable().condition is Condition.OK
    assert rig.cycle(0.5).motor_position_rad - 1.0 == pytest.approx(
        rig.plant.motor_position_rad - reference_rad, abs=1e-3
    )


@settings(max_examples=50)
@given(st.floats(-3.9, 3.9), st.floats(-1e4, 1e4))
def test_units_survive_the_wire(torque_n_m: float, start_rad: float) -> None:
    rig = in_process(plant=Mass(motor_position_rad=start_rad))
    rig.set_up()
    sample = rig.enable()
    assert sample.motor_position_rad == pytest.approx(start_rad, abs=math.pi / (1 << 20) * 1.01)
    rig.cycle(torque_n_m)
    assert rig.cycle().torque_n_m == pytest.approx(torque_n_m, abs=rig.drive.info.torque_resolution_n_m / 2 + 1e-9)


def test_torque_beyond_the_limit_is_limited_not_wrapped() -> None:
    rig = in_process(settings=DriveSettings(max_torque_n_m=6.0))
    rig.set_up()
    rig.enable()
    for command in (1e6, -1e6):
        rig.cycle(command)
        assert rig.cycle().torque_n_m == math.copysign(6.0, command)


@pytest.mark.parametrize("mille", [32767, 32768, -32768, -32769])
def test_targets_around_the_range_of_their_object_are_limited(mille: int) -> None:
    rig = in_process()
    rig.set_up()
    rig.enable()
    resolution_n_m = rig.drive.info.torque_resolution_n_m
    rig.cycle(mille * resolution_n_m)
    assert rig.node.values[0x6071_00] == max(-32768, min(mille, 32767))


def test_what_stops_the_axis() -> None:
    """A damaged or late frame does not."""
    assert set(TRIPPING) == {
        Condition.STALE,
        Condition.HEARTBEAT_LOST,
        Condition.EMERGENCY,
        Condition.FAULT,
        Condition.DISABLED,
        Condition.BUS_OFF,
        Condition.NOT_OPERATIONAL,
        Condition.UNANSWERED,
        Condition.OTHER_SETPOINT,
        Condition.RUNAWAY,
    }


def test_the_drive_says_what_it_is() -> None:
    rig = in_process()
    rig.set_up()
    info = rig.drive.info
    assert (info.rad_per_count, info.rated_torque_n_m) == (2 * math.pi / (1 << 20), 4.0)
    assert info.torque_constant_n_m_a == pytest.approx(0.8)


def test_a_linear_drive_counts_metres() -> None:
    bus = InProcessBus()
    port, plant = bus.port(), Mass(motor_position_rad=0.25)  # m, N and kg
    node = SimulatedDrive(bus.port(), plant, counts_per_rev=1_000_000, travel_per_rev=1.0, rated_torque_n_m=100.0)
    master = CanopenMaster(port)
    drive = CanopenDrive(master, DriveSettings(travel_per_rev=1.0))
    drive.set_up()
    assert drive.info.rad_per_count == 1e-6
    master.start(0.0)
    master.sync(0.0)
    assert drive.read(0.0).motor_position_rad == pytest.approx(0.25)
    assert node.values[0x6064_00] == 250_000


def test_a_value_too_large_for_its_object_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"0x6072:00 \(Max torque\): the value does not fit.*given: 250000"):
        in_process(settings=DriveSettings(max_torque_n_m=1000.0)).set_up()


def test_the_loop_may_run_in_any_time_base() -> None:
    rig = in_process()
    rig.tick = 5_000_000  # the set-up ran near 0 s, the loop begins at 5000 s
    rig.set_up()
    conditions = {rig.cycle().condition for _ in range(100)}
    assert conditions == {Condition.OK}
    rig.set_up()
    rig.tick = 7  # and again, backwards
    rig.master.start(rig.now_s)
    assert {rig.cycle().condition for _ in range(200)} == {Condition.OK}
