"""Configure a CiA 402 drive by SDO before the loop, with read-back, and read its units and ratings.

A drive must take its mode, its PDOs and the limits of the bench, and must notice a lost master in one way or another.
Other settings it may refuse or not have; the run tells which it keeps as they are. States and modes take their time.
"""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

from drivers.acting_setpoint import DEMAND
from drivers.canopen_master import CONSUMED_HEARTBEATS, NMT_PRE_OPERATIONAL, CanopenMaster
from drivers.cia402 import POWERED, OperationMode, state_of
from drivers.cia402_arming import mode_name
from drivers.cia402_watchdogs import write_reactions, write_timing, write_watchdogs
from drivers.emcy import error_text
from drivers.fault_reset import FAULTS, RESET_LIMIT_S, reset_fault
from drivers.heartbeat_trial import watches_master
from drivers.object_index import ObjectIndex as Index
from drivers.pdo import EVENT_DRIVEN, EVERY_SYNC, Entry
from drivers.port import ConfigurationError
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup, SettingRefused

TARGET: Final = {
    OperationMode.CYCLIC_SYNC_TORQUE: Entry(Index.TARGET_TORQUE, 0, 16, True),
    OperationMode.CYCLIC_SYNC_VELOCITY: Entry(Index.TARGET_VELOCITY, 0, 32, True),
    OperationMode.CYCLIC_SYNC_POSITION: Entry(Index.TARGET_POSITION, 0, 32, True),
    OperationMode.HOMING: Entry(Index.TARGET_POSITION, 0, 32, True),
}
_DEADLINE_PERIODS: Final = 3  # shortest deadline: one set-point lost, one late
_OFF_LIMIT_S: Final = 1.0  # a stop ramp under way ends within it, from 0.6 m/s at 1 m/s^2
_MODE_LIMIT_S: Final = 1.0  # until the mode display follows: some drives change it in a slow task
CONTROLWORD: Final = Entry(Index.CONTROLWORD, 0, 16)
FEEDBACK: Final = (
    Entry(Index.STATUSWORD, 0, 16),
    Entry(Index.POSITION_ACTUAL, 0, 32, True),
    Entry(Index.TORQUE_ACTUAL, 0, 16, True),
)


def commands(mode: OperationMode) -> tuple[Entry, Entry]:
    """Return the process data that the drive gets; it answers with FEEDBACK."""
    return CONTROLWORD, TARGET[mode]


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
    """Units and ratings read from the drive. torque_resolution_n_m is one per mille of the rated torque (CiA 402).
    heartbeat_s: that the drive sends, inf: none. notes: settings that it keeps as they are."""

    rad_per_count: float
    rated_torque_n_m: float
    torque_constant_n_m_a: float
    torque_resolution_n_m: float
    quick_stop_rad_s2: float  # 0x6085 as the drive has it after the set-up, 0: not known
    supervises_commands: bool  # it has a deadline of the RPDO (0x1400:5)
    max_torque_n_m: float  # 0x6072, to which the drive limits its torque
    watches_master: bool = False  # it reported that the heartbeat of the master ended, when it was tried
    reports_demand: bool = False  # the set-point that acts is in a second TPDO
    heartbeat_s: float = math.inf
    notes: tuple[str, ...] = ()


NO_INFO: Final = DriveInfo(0.0, 0.0, 0.0, 0.0, math.inf, False, math.inf)


class DriveAnswer(NamedTuple):
    """The drive at the end of the set-up; counts as object 0x6064 holds them.

    mode_shown: 0x6061 shows the mode; else it must before a set-point acts. error_code: 0x603F of a drive in FAULT."""

    info: DriveInfo
    counts: int
    statusword: int
    mode_shown: bool
    error_code: int


def set_up_drive(master: CanopenMaster, settings: DriveSettings) -> DriveAnswer:
    """Configure the drive, power stage off. Raises ResponseTimeout, IdentityError or ConfigurationError."""
    node_id = settings.node_id
    with DeviceSetup(master.network, node_id, settings.eds) as device:
        device.wait_answer()
        device.check_identity(402, settings.serial_number)
        device.check_types((*commands(settings.mode), *FEEDBACK))
        if device.has(Index.CONSUMER_HEARTBEAT_TIME, 1):  # the set-up sends none
            with contextlib.suppress(SettingRefused):
                device.write_only(Index.CONSUMER_HEARTBEAT_TIME, 1, 0)
        modes = device.peek(Index.SUPPORTED_MODES)
        if modes is not None and not modes >> (settings.mode - 1) & 1:
            raise ConfigurationError(
                "the drive does not have this mode", where=f"drive node {node_id}, object 0x6502",
                given=settings.mode.name, advice="Choose another mode in the bench description.",
            )  # fmt: skip
        device.write_only(Index.CONTROLWORD, 0, 0)
        _await_off(device)  # before anything that a drive refuses while it is enabled
        device.disable_pdos()
        info = _read_info(device, settings)
        mode_shown = _write_mode(device, settings.mode)
        if settings.max_torque_n_m is not None:
            device.write(Index.MAX_TORQUE, 0, round(settings.max_torque_n_m / info.torque_resolution_n_m))
        if settings.quick_stop_rad_s2 is not None:
            device.write(Index.QUICK_STOP_DECELERATION, 0, round(settings.quick_stop_rad_s2 / info.rad_per_count))
        if settings.mode is OperationMode.HOMING and settings.homing is not None:
            _write_homing(device, settings.homing, info.rad_per_count)
        watched = watches_master(device, master)
        write_reactions(device)
        write_timing(device, settings.period_s, settings.mode)
        watchdogs = write_watchdogs(
            device, master.node_id, CONSUMED_HEARTBEATS * master.heartbeat_s, settings.heartbeat_s,
            max(settings.command_deadline_s, _DEADLINE_PERIODS * settings.period_s))  # fmt: skip
        deceleration = (device.peek(Index.QUICK_STOP_DECELERATION) or 0) * info.rad_per_count
        info = replace(info, quick_stop_rad_s2=deceleration, heartbeat_s=watchdogs.heartbeat_s,
                       supervises_commands=watchdogs.supervises_commands,
                       watches_master=watchdogs.supervises_commands if watched is None else watched)  # fmt: skip
        max_torque = device.peek(Index.MAX_TORQUE)
        if max_torque is not None:
            info = replace(info, max_torque_n_m=max_torque * info.torque_resolution_n_m)
        device.map_pdo(
            Index.RPDO_COMMUNICATION, commands(settings.mode), settings.command_transmission, 0x200 + node_id
        )
        device.map_pdo(Index.TPDO_COMMUNICATION, FEEDBACK, EVERY_SYNC, 0x180 + node_id)
        demand = DEMAND.get(settings.mode) if settings.watch_setpoint else None
        if demand is not None and device.has(demand.index) and device.has(Index.TPDO_COMMUNICATION + 1, 1):
            with contextlib.suppress(SettingRefused):
                device.map_pdo(Index.TPDO_COMMUNICATION + 1, [demand], EVERY_SYNC, 0x280 + node_id)
                info = replace(info, reports_demand=True)
        statusword = _await_off(device)
        error_code = (device.peek(Index.ERROR_CODE) or 0) if state_of(statusword) in FAULTS else 0
        if device.kept:
            info = replace(info, notes=(f"drive node {node_id} keeps its own settings: {', '.join(device.kept)}",))
        return DriveAnswer(info, device.read(Index.POSITION_ACTUAL), statusword, mode_shown, error_code)


def _await_off(device: DeviceSetup) -> int:
    """Statusword, when the power stage is off. Raises ConfigurationError if it stays on."""
    statusword = device.wait(Index.STATUSWORD, lambda word: state_of(word) not in POWERED, _OFF_LIMIT_S)
    if state_of(statusword) in POWERED:
        raise ConfigurationError(
            "the power stage is still on after \"disable voltage\"",
            where=f"drive node {device.node_id}, object 0x6041",
            given=f"{state_of(statusword).name}, 0x{statusword:04X}, waited {_OFF_LIMIT_S:g} s",
            advice="Switch the drive off at the mains, and find out why it does not follow its controlword.",
        )  # fmt: skip
    return statusword


def _write_mode(device: DeviceSetup, mode: OperationMode) -> bool:
    """Write the mode; True if its display follows, False if the drive holds it and may show it when it is enabled."""
    device.write_only(Index.MODE_OF_OPERATION, 0, mode)
    shown = device.wait(Index.MODE_DISPLAY, lambda value: value == mode, _MODE_LIMIT_S)
    if shown == mode:
        return True
    held = device.peek(Index.MODE_OF_OPERATION)
    if held != mode:
        raise ConfigurationError(
            "the drive does not take the mode", where=f"drive node {device.node_id}, objects 0x6060 and 0x6061",
            given=mode_name(mode), allowed=f"the drive holds {mode_name(held)} and displays {mode_name(shown)}, "
            f"waited {_MODE_LIMIT_S:g} s", advice="Choose a mode that the drive has, or free it in its settings.",
        )  # fmt: skip
    for target in (Index.TARGET_TORQUE, Index.TARGET_VELOCITY):  # should it enable in the mode it shows
        if device.has(target):
            with contextlib.suppress(SettingRefused):
                device.write_only(target, 0, 0)
    return False


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
        device.wait_answer()
        statusword = reset_fault(device)
        if state_of(statusword) in FAULTS:
            code = device.peek(Index.ERROR_CODE)
            raise ConfigurationError(
                "the fault remains after its reset", where=f"drive node {settings.node_id}, object 0x6041",
                given=f"{state_of(statusword).name}, error code (object 0x603F) "
                f"{'unknown' if code is None else error_text(code)}, waited {RESET_LIMIT_S:g} s",
                advice="Remove its cause.",
            )  # fmt: skip
