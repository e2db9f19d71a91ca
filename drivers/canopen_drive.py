"""Driver of a CiA 402 drive: configured by SDO with read-back, then one RPDO and one TPDO per cycle.

RPDO1 carries controlword and target of the mode, TPDO1 statusword, position and torque; both packed by `struct`.
Faults are bits of `DriveSample.condition`. A condition of TRIPPING sets the goal to QUICK_STOP and is kept until
`reset_fault`; `check` raises it as DriveFault.
"""

from dataclasses import replace
from typing import Final

from drivers.acting_setpoint import MORE_CYCLES, ActingSetpoint
from drivers.canopen_master import CanopenMaster
from drivers.canopen_node import CanopenNode, condition_names
from drivers.cia402 import (
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    POWERED,
    STATE_BY_STATUS,
    DriveState,
    OperationMode,
    next_controlword,
)
from drivers.cia402_arming import Arming
from drivers.cia402_setup import (
    FEEDBACK,
    NO_INFO,
    TARGET,
    DriveInfo,
    DriveSettings,
    HomingSettings,
    clear_fault,
    commands,
    set_up_drive,
    switch_off,
)
from drivers.emcy import Emergency, error_text
from drivers.pdo import layout, saturate
from drivers.port import Condition, Drive, DriveFault, DriveGoal, DriveSample
from drivers.stop_watch import StopAnswer, StopVerdict, StopWatch

__all__ = ["TRIPPING", "CanopenDrive", "DriveInfo", "DriveSettings", "HomingSettings"]

# Conditions that stop the axis.
TRIPPING: Final = (
    Condition.STALE | Condition.HEARTBEAT_LOST | Condition.EMERGENCY | Condition.FAULT | Condition.DISABLED
    | Condition.BUS_OFF | Condition.NOT_OPERATIONAL | Condition.UNANSWERED | Condition.OTHER_SETPOINT
    | Condition.RUNAWAY
)  # fmt: skip
# Bound once: a look-up of an enumeration member takes time in the loop.
_OK, _ENABLED_STATE, _ENABLED = Condition.OK, DriveState.OPERATION_ENABLED, DriveGoal.ENABLED
_new = tuple.__new__  # makes a named tuple without the call of its Python constructor


class CanopenDrive(CanopenNode, Drive):
    """CiA 402 drive on the bus of a master."""

    settings: DriveSettings

    def __init__(self, master: CanopenMaster, settings: DriveSettings) -> None:
        super().__init__(master, settings, "drive")
        self._wanted = settings  # those in force: self.settings
        self.goal = DriveGoal.DISABLED
        self.info = NO_INFO
        self.tripped = Condition.OK  # what tripped the drive, until reset_fault
        self.controlword_bits = 0  # mode-specific bits (homing start), or-ed in while enabled
        self._send, self._rpdo_id = master.port.send, 0x200 + settings.node_id
        self._unpack = layout(FEEDBACK).unpack
        self._acting: ActingSetpoint | None = None
        self._arming = Arming(master.port, settings.node_id)
        self._error_code = 0  # object 0x603F at the set-up
        master.port.listen(0x280 + settings.node_id, self._on_demand)
        self._take_mode(settings.mode)
        self._rad_per_count = self._n_m_per_mille = self._target_per_unit = 0.0
        self._statusword = 0
        self._raw_counts = 0  # as read from the drive, wraps
        self._counts = 0  # unwrapped
        self._torque = 0
        self._controlword = 0
        self._was_enabled = self._reset_requested = False
        self._speed_counts_s = 0.0  # between the last two answers
        self.stop_margin = 0.0  # speed [rad/s] that a sound stop may reach beyond that at its begin
        self._stop = StopWatch(settings.period_s, settings.missed_answers_allowed)

    # -- before the loop --------------------------------------------------------------------------------------------

    def _take_mode(self, mode: OperationMode) -> None:
        self._pack = layout(commands(mode)).pack
        self._target_bits = TARGET[mode].bits
        self._holds_position = TARGET[mode].index == TARGET[OperationMode.CYCLIC_SYNC_POSITION].index

    def set_up(self, settings: DriveSettings | None = None) -> None:
        """Check identity and units, set mode, limits, watchdogs and PDOs; blocking, switches the power stage off.

        With other settings: the same node in another mode, as from homing to CST; `master.start` again afterwards.
        Raises ResponseTimeout, IdentityError or ConfigurationError; nothing moves in either case.
        """
        self._wanted = wanted = settings or self._wanted
        self._take_mode(wanted.mode)
        answer = set_up_drive(self._master, wanted)
        self.info = info = answer.info
        self.settings = replace(wanted, heartbeat_s=info.heartbeat_s)
        self.notes, self._error_code = info.notes, answer.error_code
        self._arming.begin(wanted.mode, mode_shown=answer.mode_shown)
        self._rad_per_count = info.rad_per_count
        self._n_m_per_mille = info.torque_resolution_n_m
        in_torque = self.settings.mode is OperationMode.CYCLIC_SYNC_TORQUE
        self._target_per_unit = 1 / (info.torque_resolution_n_m if in_torque else info.rad_per_count)
        self._acting = None
        if info.reports_demand:
            cycles, counts_per_rev = self.settings.missed_answers_allowed + MORE_CYCLES, 1 / info.rad_per_count
            torque_limit = info.max_torque_n_m / info.torque_resolution_n_m
            self._acting = ActingSetpoint(
                self.settings.mode, cycles, self.settings.travel_per_rev * counts_per_rev, torque_limit
            )
        self._raw_counts = self._counts = answer.counts
        self._statusword = answer.statusword
        self._begin()
        self.tripped = Condition.OK
        self.goal = DriveGoal.DISABLED
        self._was_enabled = self._reset_requested = False
        self._stop = StopWatch(self.settings.period_s, self.settings.missed_answers_allowed)

    def clear_fault(self) -> None:
        clear_fault(self._master, self.settings)

    # -- frames -----------------------------------------------------------------------------------------------------

    def _on_tpdo(self, can_id: int, data: bytes, now_s: float) -> None:
        if len(data) != 8:
            self.malformed_frames += 1
            return
        self._statusword, raw, self._torque = self._unpack(data)
        moved = ((raw - self._raw_counts + 0x80000000) & 0xFFFFFFFF) - 0x80000000
        self._counts += moved
        self._raw_counts = raw
        before_s = self._sample_time_s
        self._take_answer(now_s)
        if self._sample_time_s > before_s:
            self._speed_counts_s = moved / (self._sample_time_s - before_s)

    def _on_demand(self, can_id: int, data: bytes, now_s: float) -> None:
        acting = self._acting
        if acting is None:
            return
        if len(data) != acting.size:
            self.malformed_frames += 1
            return
        enabled = STATE_BY_STATUS[self._statusword & 0x7F] is _ENABLED_STATE and self.goal is _ENABLED
        if enabled and acting.differs(data):
            self._latched |= Condition.OTHER_SETPOINT

    def _latch(self, emergency: Emergency) -> None:
        if emergency.active:
            self._latched |= Condition.EMERGENCY

    # -- in the loop ------------------------------------------------------------------------------------------------

    def read(self, now_s: float) -> DriveSample:
        """Return the sample of the latest answered SYNC and its fault bits. Never raises, never waits."""
        age = self._master.syncs - self._answered
        statusword = self._statusword
        state = STATE_BY_STATUS[statusword & 0x7F]
        enabled = state is _ENABLED_STATE and self._arming.mode_shown
        if age or not enabled or self._latched or self._health.state or now_s > self._heartbeat_deadline_s:
            condition = self._diagnose(age, state, now_s)
        else:
            condition = _OK
            self._was_enabled = True
        return _new(DriveSample, (self._sample_time_s, age, state, self._counts * self._rad_per_count,
                                  self._torque * self._n_m_per_mille, statusword, condition, enabled,
                                  enabled or state in POWERED))  # fmt: skip

    def _diagnose(self, age: int, state: DriveState, now_s: float) -> Condition:
        condition = self._node_condition(age, now_s)
        if self._answered == self._set_up_at:  # it may take some time to become operational, and is not enabled
            condition &= ~Condition.STALE
        if state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
            condition |= Condition.FAULT
        if self.goal is DriveGoal.ENABLED:
            if state is DriveState.OPERATION_ENABLED:
                self._was_enabled = True  # whatever else is wrong
            elif self._was_enabled:
                condition |= Condition.DISABLED
        trips = condition & TRIPPING
        if trips:
            self.tripped |= trips
            if self.goal is DriveGoal.ENABLED:
                self.goal = DriveGoal.QUICK_STOP
        return condition

    def command(self, now_s: float, setpoint: float) -> None:
        """Send controlword and set-point: N m (CST), rad/s (CSV), rad (CSP).

        Until the drive reports OPERATION ENABLED and its mode the target is the present position (CSP) or zero. After a
        stop command without effect the master is cut off and nothing is sent.
        """
        state = STATE_BY_STATUS[self._statusword & 0x7F]
        if state is _ENABLED_STATE and self.goal is _ENABLED and self._arming.mode_shown:
            controlword = ENABLE_OPERATION | self.controlword_bits
            target = round(setpoint * self._target_per_unit)
            if not -32768 <= target <= 32767:  # fits every target object otherwise
                target = self._fit(target)
            self._stop.reset()
        else:
            self._await_stop(state, now_s)
            if self.goal is DriveGoal.ENABLED:
                self._arming.step(state, now_s)
            else:
                self._arming.stop()
            if self._master.silent:
                return
            self._was_enabled = False
            controlword = DISABLE_VOLTAGE if self._latched & Condition.RUNAWAY else next_controlword(
                state, enable=self.goal is DriveGoal.ENABLED, quick_stop=self.goal is DriveGoal.QUICK_STOP,
                reset_fault=self._reset_requested, previous=self._controlword,
            )  # fmt: skip
            if controlword & 0x80 or state not in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
                self._reset_requested = False
            target = self._raw_counts if self._holds_position else 0
        self._controlword = controlword
        if self._acting is not None:
            self._acting.sent.append(target)
        self._send(self._rpdo_id, self._pack(controlword, target), now_s)

    def _await_stop(self, state: DriveState, now_s: float) -> None:
        """Give up a stop: "disable voltage" where it accelerates the motor, and silence of the master where the drive
        stays enabled, or under power for longer than its ramp takes. An answer that does not come counts as the state
        before it."""
        if self.goal is DriveGoal.ENABLED or state not in POWERED:
            self._stop.reset()
            return
        count, fresh = self._rad_per_count / self.settings.period_s, self._master.syncs == self._answered
        speed = abs(self._speed_counts_s) * self._rad_per_count
        answer = StopAnswer(speed, count, enabled=state is _ENABLED_STATE, fresh=fresh)
        slowest_s = self._arming.disarm_s if self.goal is DriveGoal.DISABLED else 0.0  # at rest
        verdict = self._stop.step(answer, self.info.quick_stop_rad_s2, self.stop_margin, slowest_s)
        if verdict is StopVerdict.ACCELERATES:
            self._latched |= Condition.RUNAWAY
        elif verdict is StopVerdict.LATE and not self._master.silent:
            self._master.cut_off(now_s)
            self._latched |= Condition.UNANSWERED

    def confirm_off(self, now_s: float) -> bool:
        for statusword in switch_off(self._master, self.settings, now_s):
            self._statusword = statusword
            if STATE_BY_STATUS[statusword & 0x7F] not in POWERED:
                return True
        return False

    def _fit(self, target: int) -> int:
        """Wrap a position to INTEGER32; limit a torque or velocity to its range."""
        if self._holds_position:
            return ((target + 0x80000000) & 0xFFFFFFFF) - 0x80000000
        return saturate(target, self._target_bits)

    def reset_fault(self) -> None:
        """Clear the latched fault; send one rising edge of its reset bit to a drive in FAULT. Goal: DISABLED."""
        self.goal = DriveGoal.DISABLED
        self._latched, self.tripped, self._error_code = 0, Condition.OK, 0
        if self._acting is not None:
            self._acting.text = ""
        # without a fault nothing is requested, which could reset a later one
        state = STATE_BY_STATUS[self._statusword & 0x7F]
        self._reset_requested = state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
        self._was_enabled = False

    @property
    def error_code(self) -> int:
        """CiA 301 code of the last EMCY, else of the fault that the set-up found; 0 without one."""
        return self.emergencies[-1].code if self.emergencies else self._error_code

    @property
    def status(self) -> str:
        """CiA 402 state and statusword; with what hinders a drive that is to be enabled."""
        text = f"{STATE_BY_STATUS[self._statusword & 0x7F].name}, statusword 0x{self._statusword:04X}"
        if self.goal is not DriveGoal.ENABLED:
            return text
        answers = self._answered != self._set_up_at
        return text + self._arming.hindrances(self._statusword, self._controlword, answers=answers)

    def _cause(self) -> str:
        """Text of the last EMCY, else of the error code that the set-up found, else of the bus."""
        if self._error_code and not any(emergency.active for emergency in self.emergencies):
            return f"error code (object 0x603F) {error_text(self._error_code)}"
        return super()._cause()

    def check(self) -> None:
        """Raise DriveFault if something tripped the drive since the last `reset_fault`."""
        if not self.tripped:
            return
        texts = [self._cause()] if self.tripped & ~Condition.OTHER_SETPOINT else []
        texts += [self._acting.text] if self._acting is not None and self._acting.text else []
        raise DriveFault(
            f"tripped: {condition_names(self.tripped)}",
            where=self.name,
            given="; ".join(texts),
            advice="Remove the cause, then reset the fault.",
        )
