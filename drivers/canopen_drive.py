"""A CiA 402 drive as the loop sees it: set up by SDO and read back, then one RPDO and one TPDO a cycle.

RPDO1 carries controlword and target of the mode, TPDO1 statusword, position and torque; both packed by `struct`. What
is wrong shows in `DriveSample.condition`. A condition that forbids motion sets the goal to QUICK_STOP and stays until
`reset_fault`; `check` raises it with its text.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from drivers.base import Condition, ConfigurationError, DriveFault, DriveGoal, DriveSample
from drivers.bus import BusState
from drivers.canopen_master import NMT_PRE_OPERATIONAL, CanopenMaster
from drivers.canopen_setup import EDS_FOLDER, DeviceSetup
from drivers.cia402 import ENABLE_OPERATION, STATE_BY_STATUS, DriveState, Mode, next_controlword
from drivers.emergency import Emergency, decode_emergency
from drivers.pdo import EVENT_DRIVEN, EVERY_SYNC, Entry, layout, saturate

_TARGET: Final = {
    Mode.CYCLIC_SYNC_TORQUE: Entry(0x6071, 0, 16, True),
    Mode.CYCLIC_SYNC_VELOCITY: Entry(0x60FF, 0, 32, True),
    Mode.CYCLIC_SYNC_POSITION: Entry(0x607A, 0, 32, True),
    Mode.HOMING: Entry(0x607A, 0, 32, True),
}
_CONTROLWORD: Final = Entry(0x6040, 0, 16)
_FEEDBACK: Final = (Entry(0x6041, 0, 16), Entry(0x6064, 0, 32, True), Entry(0x6077, 0, 16, True))
# Conditions under which the loop must not go on moving the axis.
TRIPPING: Final = (
    Condition.STALE | Condition.HEARTBEAT_LOST | Condition.EMERGENCY | Condition.FAULT | Condition.DISABLED
    | Condition.BUS_OFF | Condition.NOT_OPERATIONAL
)  # fmt: skip
_OPERATIONAL: Final = 5
# Bound once: looking a member up in its enumeration costs the loop.
_OK, _ENABLED_STATE, _ENABLED = Condition.OK, DriveState.OPERATION_ENABLED, DriveGoal.ENABLED


@dataclass(frozen=True, slots=True)
class HomingSettings:
    """Objects 0x6098, 0x6099, 0x609A, 0x607C."""

    method: int                # CiA 402: 33 and 34 index pulse, 37 where it stands, ...
    speed_rad_s: float
    acceleration_rad_s2: float
    offset_rad: float = 0.0    # the position that the reference is to have


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """How the drive is to run. Rotary: rad and N m; linear drives: m and N."""

    node_id: int = 5
    mode: Mode = Mode.CYCLIC_SYNC_TORQUE
    period_s: float = 0.001
    eds: Path = EDS_FOLDER / "servo_drive.eds"
    serial_number: int | None = None       # None: any of the described type
    heartbeat_s: float = 0.02              # the drive's; it counts as lost after three
    missed_answers_allowed: int = 3        # SYNCs in a row without a TPDO before the data count as stale
    max_torque_n_m: float | None = None    # 0x6072; None: as the drive has it
    quick_stop_rad_s2: float | None = None  # 0x6085; None: as the drive has it
    command_transmission: int = EVENT_DRIVEN  # RPDO: acts at once (255) or at the next SYNC (1)
    homing: HomingSettings | None = None   # for Mode.HOMING; None: as the drive has it


@dataclass(frozen=True, slots=True)
class DriveInfo:
    """What the drive said about itself. torque_resolution_n_m is one per mille of the rated torque (CiA 402)."""

    counts_per_rev: float
    rated_torque_n_m: float
    torque_constant_n_m_a: float
    torque_resolution_n_m: float


class CanopenDrive:
    """One drive on a master's bus; implements `drivers.base.Drive`."""

    def __init__(self, master: CanopenMaster, settings: DriveSettings) -> None:
        self._master, self.settings = master, settings
        self.goal = DriveGoal.DISABLED
        self.info = DriveInfo(0.0, 0.0, 0.0, 0.0)
        self.tripped = Condition.OK          # what tripped the drive, until reset_fault
        self.emergencies: list[Emergency] = []  # newest last
        self.controlword_bits = 0            # mode-specific bits (homing start), or-ed in while enabled
        self.malformed_frames = 0
        node_id = settings.node_id
        self._health, self._send = master.health, master.port.send
        self._name = f"drive node {node_id}"
        self._rpdo_id, self._tpdo_id = 0x200 + node_id, 0x180 + node_id
        self._unpack = layout(_FEEDBACK).unpack
        self._take_mode(settings.mode)
        self._rad_per_count = self._n_m_per_mille = self._target_per_unit = 0.0
        self._statusword = 0
        self._raw_counts = 0   # as the drive counts, wrapping
        self._counts = 0       # unwrapped
        self._torque = 0
        self._answered = self._set_up_at = 0  # number of the SYNC answered last
        self._sample_time_s = 0.0
        self._controlword = 0
        self._was_enabled = self._reset_requested = False
        self._latched = 0  # Condition bits; an int, for a flag's truth is tested in Python code
        self._heartbeat_deadline_s = math.inf  # until the first heartbeat
        master.port.listen(self._tpdo_id, self._on_tpdo)
        master.port.listen(0x080 + node_id, self._on_emergency)
        master.port.listen(0x700 + node_id, self._on_heartbeat)

    # -- before the loop --------------------------------------------------------------------------------------------

    def _take_mode(self, mode: Mode) -> None:
        self._pack = layout([_CONTROLWORD, _TARGET[mode]]).pack
        self._target_bits = _TARGET[mode].bits
        self._holds_position = _TARGET[mode].index == _TARGET[Mode.CYCLIC_SYNC_POSITION].index

    def set_up(self, settings: DriveSettings | None = None) -> None:
        """Identity, modes, units, mode, limits, watchdogs, PDOs; blocking, switches the power stage off.

        With other settings: the same node in another mode, as from homing to CST; `master.start` again afterwards.
        Raises ResponseTimeout, IdentityError or ConfigurationError; nothing moves in either case.
        """
        settings, master = settings or self.settings, self._master
        self.settings = settings
        self._take_mode(settings.mode)
        with DeviceSetup(master.network, settings.node_id, settings.eds) as device:
            master.nmt(NMT_PRE_OPERATIONAL, settings.node_id)
            device.check_identity(402, settings.serial_number)
            if not device.read(0x6502) >> (settings.mode - 1) & 1:
                raise ConfigurationError(
                    "the drive does not have this mode", where=f"{self._name}, object 0x6502", given=settings.mode.name,
                    advice="Choose another mode in the bench description.",
                )  # fmt: skip
            device.disable_pdos()
            device.write_only(0x6040, 0, 0)
            device.write_only(0x6060, 0, Mode.NONE)  # a mode left over must not enable on an old target
            self._read_units(device)
            device.write(0x6060, 0, settings.mode, read_back=(0x6061, 0))
            if settings.max_torque_n_m is not None:
                device.write(0x6072, 0, round(settings.max_torque_n_m / self._n_m_per_mille))
            if settings.quick_stop_rad_s2 is not None:
                device.write(0x6085, 0, round(settings.quick_stop_rad_s2 / self._rad_per_count))
            device.write(0x605A, 0, 2)   # quick stop: ramp, then SWITCH ON DISABLED
            device.write(0x605E, 0, 2)   # fault reaction: the same ramp, then FAULT
            device.write(0x6007, 0, 1)   # master lost: fault
            device.write(0x1029, 1, 1)   # and stay operational, so that the master sees it
            device.set_interpolation_time(settings.period_s)
            device.write(0x1006, 0, round(settings.period_s * 1e6))
            device.write(0x1016, 1, master.node_id << 16 | round(3000 * master.heartbeat_s))
            device.write(0x1017, 0, round(1000 * settings.heartbeat_s))
            if settings.mode is Mode.HOMING and settings.homing is not None:
                self._write_homing(device, settings.homing)
            device.map_pdo(0x1400, (_CONTROLWORD, _TARGET[settings.mode]), settings.command_transmission,
                           self._rpdo_id)  # fmt: skip
            device.map_pdo(0x1800, _FEEDBACK, EVERY_SYNC, self._tpdo_id)
            self._raw_counts = self._counts = device.read(0x6064)
            self._statusword = device.read(0x6041)
        self._answered = self._set_up_at = master.syncs
        self._latched, self.tripped = 0, Condition.OK
        self.goal = DriveGoal.DISABLED
        self._was_enabled = False
        self._heartbeat_deadline_s = math.inf

    def _write_homing(self, device: DeviceSetup, homing: HomingSettings) -> None:
        device.write(0x6098, 0, homing.method)
        speed = round(homing.speed_rad_s / self._rad_per_count)
        device.write(0x6099, 1, speed)
        device.write(0x6099, 2, speed)
        device.write(0x609A, 0, round(homing.acceleration_rad_s2 / self._rad_per_count))
        device.write(0x607C, 0, round(homing.offset_rad / self._rad_per_count))

    def _read_units(self, device: DeviceSetup) -> None:
        counts_per_rev = device.read(0x608F, 1) / device.read(0x608F, 2)
        rated_torque_n_m = device.read(0x6076) / 1000
        rated_current_a = device.read(0x6075) / 1000
        if min(counts_per_rev, rated_torque_n_m, rated_current_a) <= 0:
            raise ConfigurationError(
                "encoder resolution, rated torque and rated current must be positive",
                where=f"{self._name}, objects 0x608F, 0x6076, 0x6075",
                given=f"{counts_per_rev} counts/rev, {rated_torque_n_m} N m, {rated_current_a} A",
                advice="Set them with the drive's commissioning tool.",
            )  # fmt: skip
        self.info = DriveInfo(
            counts_per_rev, rated_torque_n_m, rated_torque_n_m / rated_current_a, rated_torque_n_m / 1000
        )
        self._rad_per_count = 2 * math.pi / counts_per_rev
        self._n_m_per_mille = rated_torque_n_m / 1000
        torque_mode = self.settings.mode is Mode.CYCLIC_SYNC_TORQUE
        self._target_per_unit = 1 / (self._n_m_per_mille if torque_mode else self._rad_per_count)

    # -- frames -----------------------------------------------------------------------------------------------------

    def _on_tpdo(self, can_id: int, data: bytes, now_s: float) -> None:
        if len(data) != 8:
            self.malformed_frames += 1
            return
        self._statusword, raw, self._torque = self._unpack(data)
        self._counts += ((raw - self._raw_counts + 0x80000000) & 0xFFFFFFFF) - 0x80000000
        self._raw_counts = raw
        self._answered = self._master.syncs
        self._sample_time_s = self._master.sync_time_s

    def _on_emergency(self, can_id: int, data: bytes, now_s: float) -> None:
        emergency = decode_emergency(data, now_s)
        self.emergencies.append(emergency)
        if emergency.active:
            self._latched |= Condition.EMERGENCY

    def _on_heartbeat(self, can_id: int, data: bytes, now_s: float) -> None:
        self._heartbeat_deadline_s = now_s + 3 * self.settings.heartbeat_s
        if len(data) == 1 and data[0] & 0x7F != _OPERATIONAL and self._answered != self._set_up_at:
            self._latched |= Condition.NOT_OPERATIONAL  # boot-up (0) included: it lost its configuration

    # -- in the loop ------------------------------------------------------------------------------------------------

    def read(self, now_s: float) -> DriveSample:
        """The sample of the latest answered SYNC, and what is wrong. Never raises, never waits."""
        age = self._master.syncs - self._answered
        statusword = self._statusword
        state = STATE_BY_STATUS[statusword & 0x7F]
        enabled = state is _ENABLED_STATE
        if age or not enabled or self._latched or self._health.state or now_s > self._heartbeat_deadline_s:
            condition = self._diagnose(age, state, now_s)
        else:
            condition = _OK
            self._was_enabled = True
        return DriveSample(self._sample_time_s, age, state, self._counts * self._rad_per_count,
                           self._torque * self._n_m_per_mille, statusword, condition, enabled)  # fmt: skip

    def _diagnose(self, age: int, state: DriveState, now_s: float) -> Condition:
        condition = Condition(self._latched)
        if age:
            condition |= Condition.LATE
        if age > self.settings.missed_answers_allowed:
            condition |= Condition.STALE
        if now_s > self._heartbeat_deadline_s:
            condition |= Condition.HEARTBEAT_LOST
        if state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
            condition |= Condition.FAULT
        if self._was_enabled and self.goal is DriveGoal.ENABLED and state is not DriveState.OPERATION_ENABLED:
            condition |= Condition.DISABLED
        bus = self._health.state
        if bus is BusState.PASSIVE:
            condition |= Condition.BUS_PASSIVE
        elif bus is BusState.OFF:
            condition |= Condition.BUS_OFF
        trips = condition & TRIPPING
        if trips:
            self.tripped |= trips
            if self.goal is DriveGoal.ENABLED:
                self.goal = DriveGoal.QUICK_STOP
        return condition

    def command(self, now_s: float, setpoint: float) -> None:
        """Send controlword and set-point: N m (CST), rad/s (CSV), rad (CSP).

        Until the drive reports OPERATION ENABLED the target is where it stands (CSP) or zero: enabling never jumps.
        """
        state = STATE_BY_STATUS[self._statusword & 0x7F]
        if state is _ENABLED_STATE and self.goal is _ENABLED:
            controlword = ENABLE_OPERATION | self.controlword_bits
            target = round(setpoint * self._target_per_unit)
            if self._holds_position:  # the drive counts modulo 2^32
                target = ((target + 0x80000000) & 0xFFFFFFFF) - 0x80000000
            else:
                target = saturate(target, self._target_bits)
        else:
            self._was_enabled = False
            controlword = next_controlword(
                state, enable=self.goal is DriveGoal.ENABLED, quick_stop=self.goal is DriveGoal.QUICK_STOP,
                reset_fault=self._reset_requested, previous=self._controlword,
            )  # fmt: skip
            if controlword & 0x80:
                self._reset_requested = False
            target = self._raw_counts if self._holds_position else 0
        self._controlword = controlword
        self._send(self._rpdo_id, self._pack(controlword, target), now_s)

    def reset_fault(self) -> None:
        """Forget what tripped the drive and give one rising edge of the fault-reset bit; the goal becomes DISABLED."""
        self.goal = DriveGoal.DISABLED
        self._latched, self.tripped = 0, Condition.OK
        self._reset_requested = True
        self._was_enabled = False

    def check(self) -> None:
        """Raise DriveFault if something tripped the drive since the last `reset_fault`."""
        if not self.tripped:
            return
        active = [emergency.text for emergency in self.emergencies if emergency.active]
        names = " | ".join(str(flag.name) for flag in Condition if flag in self.tripped)
        raise DriveFault(
            f"tripped: {names}", where=self._name, given=active[-1] if active else self._health.last_error,
            advice="Remove the cause, then reset the fault.",
        )
