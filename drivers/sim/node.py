"""Simulated servo drive on a CANopen bus: CiA 402 states, CST, CSV, CSP, homing, quick stop, faults; a plant behind it.

The node keeps no time of its own: each SYNC moves the plant by one period with the torque in force since the SYNC before,
then the positions and torques of that instant go out. A torque that arrives by an event-driven RPDO after SYNC k thus
acts from SYNC k to k + 1, one by a synchronous RPDO (type 1) from SYNC k + 1 on, as CiA 301 says.
"""

from __future__ import annotations

import math
from pathlib import Path

from drivers.base import PlantLike, ServoLike, ServoTarget
from drivers.bus import CanPort
from drivers.cia402 import Controlword, DriveState, Mode, Statusword
from drivers.sim.device import EDS_FOLDER, NmtState, SimulatedDevice
from drivers.sim.dictionary import key_of
from drivers.sim.power_stage import REMOTE, STATUS, next_state
from drivers.sim.sdo_server import AbortCode, SdoAbort

_CONTROLWORD, _STATUSWORD = key_of(0x6040), key_of(0x6041)
_MODE, _MODE_DISPLAY = key_of(0x6060), key_of(0x6061)
_POSITION, _VELOCITY, _TORQUE = key_of(0x6064), key_of(0x606C), key_of(0x6077)
_TARGET_TORQUE, _TARGET_POSITION, _TARGET_VELOCITY = key_of(0x6071), key_of(0x607A), key_of(0x60FF)
_ERROR_CODE = key_of(0x603F)

_SERVO_MODES = (Mode.HOMING, Mode.CYCLIC_SYNC_POSITION, Mode.CYCLIC_SYNC_VELOCITY)
_AT_REST_RAD_S = 0.05  # a stop ramp has ended


class SimulatedDrive(SimulatedDevice):
    """The drive node. `servo`: loops inside the drive; without them only CST is accepted and stops are coasting.

    Positions in increments of 0x608F, torques in 1/1000 of `rated_torque_n_m` (0x6076, mN m): it sets the resolution of
    set-point and measurement. Linear axes: metres for radians, newtons for newton metres, metres per "revolution" 2 pi.
    """

    def __init__(
        self,
        port: CanPort,
        plant: PlantLike,
        *,
        node_id: int = 5,
        servo: ServoLike | None = None,
        period_s: float = 0.001,
        rated_torque_n_m: float = 4.0,
        counts_per_rev: int = 1 << 20,
        eds: Path = EDS_FOLDER / "servo_drive.eds",
    ) -> None:
        self.plant, self._servo, self.period_s = plant, servo, period_s
        self._rated_torque_mn_m, self._counts_per_rev = round(rated_torque_n_m * 1000), counts_per_rev
        self.state = DriveState.NOT_READY_TO_SWITCH_ON
        self._controlword = 0
        super().__init__(port, eds, node_id)
        self.dictionary.on_write(0x6040, self._on_controlword_sdo)
        self.dictionary.on_write(0x6060, self._on_mode)
        self.dictionary.on_write(0x60C2, self._on_interpolation_time)
        self._power_up()

    def _power_up(self) -> None:
        values = self.values
        values[key_of(0x6076)] = self._rated_torque_mn_m
        values[key_of(0x608F, 1)] = self._counts_per_rev
        self._n_m_per_mille = self._rated_torque_mn_m / 1e6
        self._mille_per_n_m = 1e6 / self._rated_torque_mn_m
        self._counts_per_rad = self._counts_per_rev / (2 * math.pi)
        self._torque_n_m = 0.0        # command in force in CST, set when an RPDO arrives
        self._offset_counts = 0       # position = encoder counts - offset, set by homing
        self._counts = round(self.plant.motor_position_rad * self._counts_per_rad)
        self._ramp_rad_s = 0.0        # velocity reference of stop ramps
        self._homing_cycles = -1      # -1: not started
        self._fault_present = False
        self._set_state(DriveState.SWITCH_ON_DISABLED)
        self._measure(self._counts)

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self._power_up()

    # -- states -----------------------------------------------------------------------------------------------------

    def _set_state(self, state: DriveState) -> None:
        if state is DriveState.OPERATION_ENABLED and self._servo is not None:
            self._servo.reset(self.plant.motor_position_rad)
        self.state = state
        self._refresh_drive()

    def _refresh_drive(self) -> None:
        """What follows from state and mode, worked out once here and not every cycle."""
        mode = self.values[_MODE]
        enabled = self.state is DriveState.OPERATION_ENABLED
        self._direct = enabled and mode == Mode.CYCLIC_SYNC_TORQUE
        self._idle = not enabled and self.state not in (
            DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)  # fmt: skip
        if not self._direct:
            self._torque_n_m = 0.0
        cyclic = enabled and mode != Mode.HOMING
        self._status(0, follows=cyclic)

    def _status(self, extra: int, *, follows: bool = False) -> None:
        self.values[_STATUSWORD] = STATUS[self.state] | REMOTE | extra | (Statusword.FOLLOWS_COMMAND * follows)

    def process_rpdo(self, now_s: float) -> None:
        if self.values[_CONTROLWORD] != self._controlword or self.state is DriveState.SWITCHED_ON:
            self._take_controlword(now_s)
        if self._direct:
            torque_n_m = self.values[_TARGET_TORQUE] * self._n_m_per_mille
            limit_n_m = self.values[_MAX_TORQUE] * self._n_m_per_mille
            self._torque_n_m = max(-limit_n_m, min(limit_n_m, torque_n_m))

    def _take_controlword(self, now_s: float) -> None:
        controlword, previous = self.dictionary.number(0x6040), self._controlword
        self._controlword = controlword
        state = next_state(self.state, controlword, previous, cause_gone=not self._fault_present)
        if state is not self.state:
            if self.state is DriveState.FAULT:
                self.values[_ERROR_CODE] = 0
                self.emergency(0, 0, now_s)
            if state is DriveState.QUICK_STOP_ACTIVE:
                self._start_ramp()
            self._set_state(state)
        if controlword & ~previous & Controlword.HOMING_START:
            self._homing_cycles = 0
        elif not controlword & Controlword.HOMING_START:
            self._homing_cycles = -1

    def trip(self, code: int, register: int, now_s: float, *, lasting: bool = False) -> None:
        """A fault inside the drive: EMCY, stop ramp, FAULT (transitions 13, 14). lasting: a reset does not clear it
        until `clear_cause`."""
        self._fault_present = lasting
        self.values[_ERROR_CODE] = code
        self.emergency(code, register, now_s)
        self._react(DriveState.FAULT_REACTION_ACTIVE)

    def clear_cause(self) -> None:
        """The cause of a lasting fault is gone."""
        self._fault_present = False

    def communication_lost(self, now_s: float) -> None:
        """Abort connection option code 0x6007: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop."""
        option = self.dictionary.number(0x6007)
        if option == 1:
            self.values[_ERROR_CODE] = self.dictionary.number(0x1003, 1)
            self._react(DriveState.FAULT_REACTION_ACTIVE)
        elif option == 2 and self.state is not DriveState.FAULT:
            self._set_state(DriveState.SWITCH_ON_DISABLED)
        elif option == 3 and self.state is DriveState.OPERATION_ENABLED:
            self._react(DriveState.QUICK_STOP_ACTIVE)

    def _react(self, reaction: DriveState) -> None:
        powered = self.state in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
        self._start_ramp()
        self._set_state(reaction if powered or reaction is DriveState.QUICK_STOP_ACTIVE else DriveState.FAULT)

    def _start_ramp(self) -> None:
        self._ramp_rad_s = self.values[_VELOCITY] / self._counts_per_rad

    # -- SDO hooks --------------------------------------------------------------------------------------------------

    def _on_controlword_sdo(self, index: int, subindex: int, value: int) -> None:
        self.values[_CONTROLWORD] = value
        self._take_controlword(self._last_s)

    def _on_mode(self, index: int, subindex: int, value: int) -> None:
        known = value in (Mode.NONE, Mode.CYCLIC_SYNC_TORQUE) or (self._servo and value in _SERVO_MODES)
        if not known:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        if self.state is DriveState.OPERATION_ENABLED:
            raise SdoAbort(AbortCode.NOT_IN_THIS_STATE)
        self.values[_MODE] = self.values[_MODE_DISPLAY] = value
        self._refresh_drive()

    def _on_interpolation_time(self, index: int, subindex: int, value: int) -> None:
        value_, exponent = (value, self.dictionary.number(0x60C2, 2)) if subindex == 1 else (
            self.dictionary.number(0x60C2, 1), value)  # fmt: skip
        if value_ == 0:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        self.period_s = value_ * 10.0**exponent

    # -- in the loop ------------------------------------------------------------------------------------------------

    def process_sync(self, now_s: float) -> None:
        plant, values = self.plant, self.values
        torque_n_m = self._torque_n_m if self._direct or self._idle else self._internal_torque()
        plant.advance(torque_n_m, self.period_s)
        self._measure(round(plant.motor_position_rad * self._counts_per_rad))
        torque = round(plant.torque_n_m * self._mille_per_n_m)
        values[_TORQUE] = torque if -32768 <= torque <= 32767 else max(-32768, min(32767, torque))

    def _measure(self, counts: int) -> None:
        """Position with the wrap-around of an INTEGER32, velocity as its difference."""
        self.values[_VELOCITY] = round((counts - self._counts) / self.period_s)
        self._counts = counts
        self.values[_POSITION] = ((counts - self._offset_counts + 0x80000000) & 0xFFFFFFFF) - 0x80000000

    def _internal_torque(self) -> float:
        """Torque of the loops inside the drive: CSV, CSP, homing, stop ramps."""
        raise NotImplementedError


_MAX_TORQUE = key_of(0x6072)
__all__ = ["NmtState", "SimulatedDrive"]
