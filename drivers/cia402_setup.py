"""Configure a CiA 402 drive by SDO before the loop, with read-back, and read its units and ratings."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

from drivers.acting_setpoint import DEMAND
from drivers.canopen_master import CONSUMED_HEARTBEATS, NMT_PRE_OPERATIONAL, CanopenMaster
from drivers.cia402 import POWERED, OperationMode, state_of
from drivers.heartbeat_trial import FAULTS, reset_fault, watches_master
from drivers.object_index import ObjectIndex as Index
from drivers.pdo import EVENT_DRIVEN, EVERY_SYNC, Entry
from drivers.port import ConfigurationError
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup

TARGET: Final = {
    OperationMode.CYCLIC_SYNC_TORQUE: Entry(Index.TARGET_TORQUE, 0, 16, True),
    OperationMode.CYCLIC_SYNC_VELOCITY: Entry(Index.TARGET_VELOCITY, 0, 32, True),
    OperationMode.CYCLIC_SYNC_POSITION: Entry(Index.TARGET_POSITION, 0, 32, True),
    OperationMode.HOMING: Entry(Index.TARGET_POSITION, 0, 32, True),
}
RPDO_EVENT_TIMER: Final = 5  # sub-index of 0x1400
_DEADLINE_PERIODS: Final = 3  # shortest deadline: one set-point lost, one late
_OFF_LIMIT_S: Final = 1.0  # a stop ramp under way ends within it, from 0.6 m/s at 1 m/s^2
CONTROLWORD: Final = Entry(Index.CONTROLWORD, 0, 16)
FEEDBACK: Final = (
    Entry(Index.STATUSWORD, 0, 16),
    Entry(Index.POSITION_ACTUAL, 0, 32, True),
    Entry(Index.TORQUE_ACTUAL, 0, 16, True),
)


@dataclass(frozen=True, slots=True)
class HomingSettings:
    """Objects 0x6098, 0x6099, 0x609A, 0x607C."""

    method: int  # CiA 402: 33 and 34 index pulse, 37 where it stands, ...
    speed_rad_s: float
    acceleration_rad_s2: float
    offset_rad: float = 0.0  # the position that the reference is to have


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """Settings of the drive. Rotary: rad and N m; linear drives: m and N."""

    node_id: int = 5
    mode: OperationMode = OperationMode.CYCLIC_SYNC_TORQUE
    period_s: float = 0.001
    eds: Path = EDS_FOLDER / "servo_drive.eds"
    serial_number: int | None = None  # None: any of the described type
    heartbeat_s: float = 0.02  # the drive's; it counts as lost after three
    missed_answers_allowed: int = 3  # SYNCs in a row without a TPDO before the data count as stale
    rated_torque_n_m: float | None = None  # checked against 0x6076; None: not checked
    max_torque_n_m: float | None = None  # 0x6072; None: as the drive has it
    quick_stop_rad_s2: float | None = None  # 0x6085; None: as the drive has it
    command_deadline_s: float = 0.05  # without an RPDO for longer, the drive stops by itself (0x1400:5); in whole ms
    command_transmission: int = EVENT_DRIVEN  # RPDO: acts at once (255) or at the next SYNC (1)
    watch_setpoint: bool = True  # the demand of the mode in a second TPDO, if the EDS has it
    homing: HomingSettings | None = None  # for OperationMode.HOMING; None: as the drive has it
    travel_per_rev: float = 2 * math.pi  # rad per revolution; linear drives: m per "revolution" of 0x608F


@dataclass(frozen=True, slots=True)
class DriveInfo:
    """Units and ratings read from the drive. torque_resolution_n_m is one per mille of the rated torque (CiA 402)."""

    rad_per_count: float
    rated_torque_n_m: float
    torque_constant_n_m_a: float
    torque_resolution_n_m: float
    quick_stop_rad_s2: float  # 0x6085 as the drive has it after the set-up
    supervises_commands: bool  # it has a deadline of the RPDO (0x1400:5)
    max_torque_n_m: float  # 0x6072, to which the drive limits its torque
    watches_master: bool = False  # it reported that the heartbeat of the master ended, when it was tried
    reports_demand: bool = False  # the set-point that acts is in a second TPDO


NO_INFO: Final = DriveInfo(0.0, 0.0, 0.0, 0.0, math.inf, False, math.inf)


class DriveAnswer(NamedTuple):
    """The drive at the end of the set-up; counts as object 0x6064 holds them."""

    info: DriveInfo
    counts: int
    statusword: int


def set_up_drive(master: CanopenMaster, settings: DriveSettings) -> DriveAnswer:
    """Configure the drive, power stage off. Raises ResponseTimeout, IdentityError or ConfigurationError."""
    node_id = settings.node_id
    with DeviceSetup(master.network, node_id, settings.eds) as device:
        master.nmt(NMT_PRE_OPERATIONAL, node_id)
        device.check_identity(402, settings.serial_number)
        if not device.read(Index.SUPPORTED_MODES) >> (settings.mode - 1) & 1:
            raise ConfigurationError(
                "the drive does not have this mode", where=f"drive node {node_id}, object 0x6502",
                given=settings.mode.name, advice="Choose another mode in the bench description.",
            )  # fmt: skip
        device.disable_pdos()
        device.write_only(Index.CONTROLWORD, 0, 0)
        device.write_only(
            Index.MODE_OF_OPERATION, 0, OperationMode.NONE
        )  # a mode left over must not enable on an old target
        info = _read_info(device, settings)
        device.write(Index.MODE_OF_OPERATION, 0, settings.mode, read_back=(Index.MODE_DISPLAY, 0))
        if settings.max_torque_n_m is not None:
            device.write(Index.MAX_TORQUE, 0, round(settings.max_torque_n_m / info.torque_resolution_n_m))
        if settings.quick_stop_rad_s2 is not None:
            device.write(Index.QUICK_STOP_DECELERATION, 0, round(settings.quick_stop_rad_s2 / info.rad_per_count))
        if settings.mode is OperationMode.HOMING and settings.homing is not None:
            _write_homing(device, settings.homing, info.rad_per_count)
        info = replace(info, watches_master=watches_master(device, master))
        info = _write_watchdogs(device, master, settings, info)
        if device.has(Index.MAX_TORQUE):
            info = replace(info, max_torque_n_m=device.read(Index.MAX_TORQUE) * info.torque_resolution_n_m)
        commands = (CONTROLWORD, TARGET[settings.mode])
        device.map_pdo(Index.RPDO_COMMUNICATION, commands, settings.command_transmission, 0x200 + node_id)
        device.map_pdo(Index.TPDO_COMMUNICATION, FEEDBACK, EVERY_SYNC, 0x180 + node_id)
        demand = DEMAND.get(settings.mode) if settings.watch_setpoint else None
        if demand is not None and device.has(demand.index) and device.has(Index.TPDO_COMMUNICATION + 1, 1):
            device.map_pdo(Index.TPDO_COMMUNICATION + 1, [demand], EVERY_SYNC, 0x280 + node_id)
            info = replace(info, reports_demand=True)
        statusword = device.read(Index.STATUSWORD)
        if state_of(statusword) in POWERED:
            raise ConfigurationError(
                "the power stage is still on after \"disable voltage\"",
                where=f"drive node {node_id}, object 0x6041", given=f"{state_of(statusword).name}, 0x{statusword:04X}",
                advice="Switch the drive off at the mains, and find out why it does not follow its controlword.",
            )  # fmt: skip
        return DriveAnswer(info, device.read(Index.POSITION_ACTUAL), statusword)


def _read_info(device: DeviceSetup, settings: DriveSettings) -> DriveInfo:
    counts_per_rev = device.read(Index.POSITION_ENCODER_RESOLUTION, 1) / max(
        device.read(Index.POSITION_ENCODER_RESOLUTION, 2), 1
    )
    rated_torque_n_m = device.read(Index.RATED_TORQUE) / 1000
    rated_current_a = device.read(Index.RATED_CURRENT) / 1000
    if min(counts_per_rev, rated_torque_n_m, rated_current_a) <= 0:
        raise ConfigurationError(
            "encoder resolution, rated torque and rated current must be positive",
            where=f"drive node {device.node_id}, objects 0x608F, 0x6076, 0x6075",
            given=f"{counts_per_rev} counts/rev, {rated_torque_n_m} N m, {rated_current_a} A",
            advice="Set them with the drive's commissioning tool.",
        )  # fmt: skip
    described_n_m = settings.rated_torque_n_m
    if described_n_m is not None and abs(rated_torque_n_m - described_n_m) > 0.001 * described_n_m:
        raise ConfigurationError(
            "another rated torque than described",
            where=f"drive node {device.node_id}, object 0x6076",
            given=f"{rated_torque_n_m} N m",
            allowed=f"{described_n_m} N m",
            advice="Correct drive.rated_torque_n_m in the bench file, or the drive.",
        )
    return DriveInfo(
        rad_per_count=settings.travel_per_rev / counts_per_rev,
        rated_torque_n_m=rated_torque_n_m,
        torque_constant_n_m_a=rated_torque_n_m / rated_current_a,
        torque_resolution_n_m=rated_torque_n_m / 1000,
        quick_stop_rad_s2=math.inf,
        supervises_commands=False,
        max_torque_n_m=math.inf,
    )


def _write_homing(device: DeviceSetup, homing: HomingSettings, rad_per_count: float) -> None:
    speed = round(homing.speed_rad_s / rad_per_count)
    device.write(Index.HOMING_METHOD, 0, homing.method)
    device.write(Index.HOMING_SPEEDS, 1, speed)
    device.write(Index.HOMING_SPEEDS, 2, speed)
    device.write(Index.HOMING_ACCELERATION, 0, round(homing.acceleration_rad_s2 / rad_per_count))
    device.write(Index.HOME_OFFSET, 0, round(homing.offset_rad / rad_per_count))


def _write_watchdogs(device: DeviceSetup, master: CanopenMaster, settings: DriveSettings, info: DriveInfo) -> DriveInfo:
    """Stop reactions, cycle times, deadline of the RPDO and heartbeats both ways; what the drive has of them."""
    device.write(Index.QUICK_STOP_OPTION, 0, 2)  # quick stop: ramp, then SWITCH ON DISABLED
    device.write(Index.FAULT_REACTION_OPTION, 0, 2)  # fault reaction: the same ramp, then FAULT
    device.write(Index.ABORT_CONNECTION_OPTION, 0, 1)  # master lost: fault
    device.write(Index.ERROR_BEHAVIOUR, 1, 1)  # and stay operational, so that the master sees it
    device.set_interpolation_time(settings.period_s)
    device.write(Index.COMMUNICATION_CYCLE_PERIOD, 0, round(settings.period_s * 1e6))
    consumed_ms = round(1000 * CONSUMED_HEARTBEATS * master.heartbeat_s)
    device.write(Index.CONSUMER_HEARTBEAT_TIME, 1, master.node_id << 16 | consumed_ms)
    device.write(Index.PRODUCER_HEARTBEAT_TIME, 0, round(1000 * settings.heartbeat_s))
    # CiA 301: the event timer of an RPDO is a deadline in ms; without it only the client notices a lost command path
    supervised = device.has(Index.RPDO_COMMUNICATION, RPDO_EVENT_TIMER)
    if supervised:
        deadline_s = max(settings.command_deadline_s, _DEADLINE_PERIODS * settings.period_s)
        device.write(Index.RPDO_COMMUNICATION, RPDO_EVENT_TIMER, max(1, math.floor(round(1000 * deadline_s, 6))))
    deceleration = device.read(Index.QUICK_STOP_DECELERATION) * info.rad_per_count
    return replace(info, quick_stop_rad_s2=deceleration, supervises_commands=supervised)


def switch_off(master: CanopenMaster, settings: DriveSettings, now_s: float) -> Iterator[int]:
    """Command "disable voltage" by SDO and yield the statusword as often as it is asked for, for _OFF_LIMIT_S.

    The node is in NMT pre-operational for it: without PDOs, so that no set-point acts. Raises DriverError.
    """
    network = master.network
    network.time_s = now_s
    with DeviceSetup(network, settings.node_id, settings.eds) as device:
        master.nmt(NMT_PRE_OPERATIONAL, settings.node_id)
        device.write_only(Index.CONTROLWORD, 0, 0)
        while network.time_s < now_s + _OFF_LIMIT_S:
            yield device.read(Index.STATUSWORD)
            network.pump()


def clear_fault(master: CanopenMaster, settings: DriveSettings) -> None:
    """Reset a latched fault by SDO, power stage off. Raises DriverError if the fault remains."""
    with DeviceSetup(master.network, settings.node_id, settings.eds) as device:
        master.nmt(NMT_PRE_OPERATIONAL, settings.node_id)
        reset_fault(device)
        state = state_of(device.read(Index.STATUSWORD))
    if state in FAULTS:
        raise ConfigurationError(
            "the fault remains after its reset", where=f"drive node {settings.node_id}, object 0x6041",
            given=state.name, advice="Remove its cause; the drive's error code is object 0x603F.",
        )  # fmt: skip
