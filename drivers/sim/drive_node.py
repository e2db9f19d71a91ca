"""Simulated servo drive on CANopen: CiA 402 states, CST, CSV, CSP, homing, quick stop, faults. It moves a plant.

The node reads no clock: each SYNC moves the plant by one period with the torque in force since the SYNC before, then
the node sends the positions and torques of that instant. Where SYNCs are missing, late or sent in a burst, the plant
moves by the time that passed, also at a `tick` between them. A torque that arrives by an event-driven RPDO after
SYNC k thus acts from SYNC k to k + 1, one by a synchronous RPDO (type 1) from SYNC k + 1 on, as CiA 301 requires.
"""

import math
from pathlib import Path

from drivers.bus import CanPort
from drivers.cia402 import Controlword, DriveState, OperationMode, Statusword
from drivers.object_index import ObjectIndex as Index
from drivers.port import PlantLike, ServoLike, ServoTarget
from drivers.sim.can_node import EDS_FOLDER, SimulatedDevice
from drivers.sim.cia402_device import REMOTE, STATUS, interpolation_time_s, next_state
from drivers.sim.drive_loops import DriveLoops, Homing, HomingMethod, new_homing, step_homing
from drivers.sim.object_dictionary import key_of
from drivers.sim.sdo_server import AbortCode, SdoAbort

_CONTROLWORD, _STATUSWORD = key_of(Index.CONTROLWORD), key_of(Index.STATUSWORD)
_MODE, _MODE_DISPLAY = key_of(Index.MODE_OF_OPERATION), key_of(Index.MODE_DISPLAY)
_POSITION, _VELOCITY = key_of(Index.POSITION_ACTUAL), key_of(Index.VELOCITY_ACTUAL)
_TORQUE = key_of(Index.TORQUE_ACTUAL)
_MAX_TORQUE = key_of(Index.MAX_TORQUE)
_TARGET_TORQUE, _TARGET_VELOCITY = key_of(Index.TARGET_TORQUE), key_of(Index.TARGET_VELOCITY)
_TARGET_POSITION, _TORQUE_DEMAND = key_of(Index.TARGET_POSITION), key_of(Index.TORQUE_DEMAND)
_VELOCITY_DEMAND, _POSITION_DEMAND = key_of(Index.VELOCITY_DEMAND), key_of(Index.POSITION_DEMAND)
_ERROR_CODE, _QUICK_STOP_DECELERATION = key_of(Index.ERROR_CODE), key_of(Index.QUICK_STOP_DECELERATION)
_FOLLOWING_ERROR, _FOLLOWING_ERROR_WINDOW = key_of(Index.FOLLOWING_ERROR_ACTUAL), key_of(Index.FOLLOWING_ERROR_WINDOW)

_SERVO_MODES = (OperationMode.HOMING, OperationMode.CYCLIC_SYNC_POSITION, OperationMode.CYCLIC_SYNC_VELOCITY)
_SWITCHED_ON = DriveState.SWITCHED_ON  # bound once: a look-up of an enumeration member takes time in the loop
_STOPPING = (DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)
_FOLLOWING_ERROR_CODE = 0x8611  # CiA 402-2


class SimulatedDrive(SimulatedDevice):
    """The drive node. `servo`: loops inside the drive; without them the drive accepts only CST and coasts to a stop.

    Positions in increments of 0x608F, torques in 1/1000 of `rated_torque_n_m` (0x6076, mN m): it sets the resolution of
    set-point and measurement. Linear axes: metres for radians, newtons for newton metres, travel_per_rev in m.
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
        travel_per_rev: float = 2 * math.pi,
        eds: Path = EDS_FOLDER / "servo_drive.eds",
    ) -> None:
        self.plant = plant
        self._set_period(period_s)
        self._moved_s = math.inf  # time until which the plant has moved; inf: no SYNC yet
        self._loops = DriveLoops(plant, servo)
        self._rated_torque_mn_m, self._counts_per_rev = round(rated_torque_n_m * 1000), counts_per_rev
        self._travel_per_rev = travel_per_rev
        self.state = DriveState.NOT_READY_TO_SWITCH_ON
        self._controlword = 0
        super().__init__(port, eds, node_id)
        self.dictionary.on_write(Index.CONTROLWORD, self._on_controlword_sdo)
        self.dictionary.on_write(Index.MODE_OF_OPERATION, self._on_mode)
        self.dictionary.on_write(Index.INTERPOLATION_TIME, self._on_interpolation_time)
        self.dictionary.on_write(Index.HOMING_METHOD, self._on_homing_method)
        self._power_up()

    def _power_up(self) -> None:
        values = self.values
        values[key_of(Index.RATED_TORQUE)] = self._rated_torque_mn_m
        values[key_of(Index.POSITION_ENCODER_RESOLUTION, 1)] = self._counts_per_rev
        self._n_m_per_mille = self._rated_torque_mn_m / 1e6
        self._mille_per_n_m = 1e6 / self._rated_torque_mn_m
        self._counts_per_rad = self._counts_per_rev / self._travel_per_rev
        self._torque_n_m = 0.0  # command in force in CST, set when an RPDO arrives
        self._offset_counts = 0  # position = encoder counts - offset, set by homing
        self._counts = round(self.plant.motor_position_rad * self._counts_per_rad)
        self._last_counts = self._counts
        self._homing: Homing | None = None
        self._last_target = 0
        self._fault_present = False
        self._set_state(DriveState.SWITCH_ON_DISABLED)
        self._measure(self._counts)

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self._power_up()

    # -- states -----------------------------------------------------------------------------------------------------

    def _set_state(self, state: DriveState) -> None:
        if state is DriveState.OPERATION_ENABLED or state in _STOPPING:
            self._loops.start(self._velocity_rad_s())
        self.state = state
        self._refresh_drive()

    def _refresh_drive(self) -> None:
        """Compute the values that depend on state and mode only, once for each change."""
        enabled = self.state is DriveState.OPERATION_ENABLED
        self._direct = enabled and self.values[_MODE] == OperationMode.CYCLIC_SYNC_TORQUE
        self._idle = not enabled and self.state not in _STOPPING
        if not self._direct:
            self._torque_n_m, self.values[_TORQUE_DEMAND] = 0.0, 0
        self._homing = None
        self._last_target = self.values[_POSITION]
        follows = enabled and self.values[_MODE] != OperationMode.HOMING
        self._status(Statusword.FOLLOWS_COMMAND if follows else 0)

    def _status(self, extra: int) -> None:
        self.values[_STATUSWORD] = STATUS[self.state] | REMOTE | int(extra)

    def process_rpdo(self, now_s: float) -> None:
        if self.values[_CONTROLWORD] != self._controlword or self.state is _SWITCHED_ON:
            self._take_controlword(now_s)
        if self._direct:
            values = self.values
            torque, limit = values[_TARGET_TORQUE], values[_MAX_TORQUE]
            if torque > limit:
                torque = limit
            elif torque < -limit:
                torque = -limit
            self._torque_n_m = torque * self._n_m_per_mille
            values[_TORQUE_DEMAND] = torque  # output of the torque limit, CiA 402-2

    def _take_controlword(self, now_s: float) -> None:
        controlword, previous = self.dictionary.number(Index.CONTROLWORD), self._controlword
        self._controlword = controlword
        state = next_state(self.state, controlword, previous, cause_gone=not self._fault_present)
        if state is not self.state:
            if self.state is DriveState.FAULT:
                self.values[_ERROR_CODE] = 0
                self.emergency(0, 0, now_s)
            self._set_state(state)
        if self.state is DriveState.OPERATION_ENABLED and self.values[_MODE] == OperationMode.HOMING:
            self._take_homing_start(bool(controlword & Controlword.HOMING_START))

    def _take_homing_start(self, start: bool) -> None:
        if not start:
            self._homing = None
        elif self._homing is None:
            self._homing = new_homing(self.dictionary.number, self._counts_per_rev)
            self._status(0)

    def trip(self, code: int, register: int, now_s: float, *, lasting: bool = False) -> None:
        """Trip by a fault inside the drive: EMCY, stop ramp, FAULT (transitions 13, 14).

        lasting: a reset clears the fault only after `clear_cause`."""
        self._fault_present = lasting
        self.values[_ERROR_CODE] = code
        self.emergency(code, register, now_s)
        self._react(DriveState.FAULT_REACTION_ACTIVE)

    def clear_cause(self) -> None:
        """Remove the cause of a lasting fault."""
        self._fault_present = False

    def communication_lost(self, now_s: float) -> None:
        """React by the abort connection option code 0x6007: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop."""
        option = self.dictionary.number(Index.ABORT_CONNECTION_OPTION)
        if option == 1:
            self.values[_ERROR_CODE] = self.dictionary.number(Index.ERROR_HISTORY, 1)
            self._react(DriveState.FAULT_REACTION_ACTIVE)
        elif option == 2 and self.state is not DriveState.FAULT:
            self._set_state(DriveState.SWITCH_ON_DISABLED)
        elif option == 3 and self.state is DriveState.OPERATION_ENABLED:
            self._react(DriveState.QUICK_STOP_ACTIVE)

    def _react(self, reaction: DriveState) -> None:
        # a second cause does not end the reaction to the first
        powered = self.state is DriveState.OPERATION_ENABLED or self.state in _STOPPING
        self._set_state(reaction if powered or reaction is DriveState.QUICK_STOP_ACTIVE else DriveState.FAULT)

    def _velocity_rad_s(self) -> float:
        return (self._counts - self._last_counts) / self._counts_per_rad / self.period_s

    # -- SDO hooks --------------------------------------------------------------------------------------------------

    def _on_controlword_sdo(self, index: int, subindex: int, value: int) -> None:
        self.values[_CONTROLWORD] = value
        self._take_controlword(self._last_s)

    def _on_mode(self, index: int, subindex: int, value: int) -> None:
        known = value in (OperationMode.NONE, OperationMode.CYCLIC_SYNC_TORQUE) or (
            self._loops.closed and value in _SERVO_MODES
        )
        if not known:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        if self.state is DriveState.OPERATION_ENABLED:
            raise SdoAbort(AbortCode.NOT_IN_THIS_STATE)
        self.values[_MODE] = self.values[_MODE_DISPLAY] = value
        self._refresh_drive()

    def _on_homing_method(self, index: int, subindex: int, value: int) -> None:
        if value not in list(HomingMethod):
            raise SdoAbort(AbortCode.INVALID_VALUE)

    def _on_interpolation_time(self, index: int, subindex: int, value: int) -> None:
        self._set_period(interpolation_time_s(self.dictionary.number, subindex, value))

    def _set_period(self, period_s: float) -> None:
        self.period_s, self._syncs_per_s = period_s, 1 / period_s

    # -- in the loop ------------------------------------------------------------------------------------------------

    def process_sync(self, now_s: float) -> None:
        periods = (now_s - self._moved_s) * self._syncs_per_s
        if 0.5 < periods < 1.5 or periods < -0.5:  # follow the phase of the SYNC; first SYNC, new time base
            self._moved_s = now_s
            self._move(now_s)
        else:
            self._catch_up(now_s)

    def tick(self, now_s: float) -> None:
        """Heartbeats and deadlines; moves the plant by its own clock where the SYNC is missing."""
        if now_s - self._moved_s > 1.5 * self.period_s:
            self._catch_up(now_s)
        super().tick(now_s)

    def clock(self, now_s: float) -> None:
        """Pass the time where no SYNC does; in another time base (as before the first SYNC): its heartbeats alone."""
        if abs(now_s - self._moved_s) > 1.5 * self.period_s:
            self.tick(now_s)

    def _catch_up(self, now_s: float) -> None:
        for _ in range(round((now_s - self._moved_s) * self._syncs_per_s)):
            self._moved_s += self.period_s
            time_s = min(self._moved_s, now_s)
            if time_s >= self._last_s and time_s >= min(self._timer_s, self.pdo.deadline_s):
                super().tick(time_s)  # its watchdogs act when they run out, not when a frame comes
            self._move(time_s)

    def _move(self, now_s: float) -> None:
        """Move the plant by one period and measure."""
        plant = self.plant
        if self._direct or self._idle:
            plant.advance(self._torque_n_m, self.period_s)
            torque = round(plant.torque_n_m * self._mille_per_n_m)
        else:
            torque = round(self._advance_by_loops(now_s) * self._mille_per_n_m)
        self.values[_TORQUE] = torque if -32768 <= torque <= 32767 else max(-32768, min(32767, torque))
        self._measure(round(plant.motor_position_rad * self._counts_per_rad))

    def _measure(self, counts: int) -> None:
        """Store position, wrapped to INTEGER32, and velocity as its difference."""
        moved, values = counts - self._counts, self.values
        self._last_counts, self._counts = self._counts, counts
        values[_VELOCITY] = int(moved * self._syncs_per_s)
        values[_POSITION] = _wrap(counts - self._offset_counts)

    def _advance_by_loops(self, now_s: float) -> float:
        """Advance one period under the loops inside the drive: CSV, CSP, homing, stops; mean measured torque [N m]."""
        loops, values = self._loops, self.values
        mode, target = values[_MODE], ServoTarget(0.0)
        if self.state in _STOPPING:
            deceleration_rad_s2 = values[_QUICK_STOP_DECELERATION] / self._counts_per_rad
            stop = loops.stop_target(deceleration_rad_s2, self._velocity_rad_s(), self.period_s)
            if stop is None:
                fault = self.state is DriveState.FAULT_REACTION_ACTIVE
                self._set_state(DriveState.FAULT if fault else DriveState.SWITCH_ON_DISABLED)
                return loops.advance(None, self.period_s, 0.0)
            target = stop
        elif mode == OperationMode.CYCLIC_SYNC_VELOCITY:
            target = ServoTarget(values[_TARGET_VELOCITY] / self._counts_per_rad)
        elif mode == OperationMode.CYCLIC_SYNC_POSITION:
            target = self._position_target(now_s)
        elif mode == OperationMode.HOMING and self._homing is not None:
            target = self._homing_target(self._homing)
        values[_VELOCITY_DEMAND] = round(target.velocity_rad_s * self._counts_per_rad)
        values[_POSITION_DEMAND] = values[_TARGET_POSITION if target.position_rad is not None else _POSITION]
        return loops.advance(target, self.period_s, values[_MAX_TORQUE] * self._n_m_per_mille)

    def _position_target(self, now_s: float) -> ServoTarget:
        values = self.values
        moved = _wrap(values[_TARGET_POSITION] - self._last_target)
        self._last_target = values[_TARGET_POSITION]
        error = _wrap(values[_TARGET_POSITION] - values[_POSITION])  # both wrap; their wrapped difference is the error
        values[_FOLLOWING_ERROR] = error
        if abs(error) > values[_FOLLOWING_ERROR_WINDOW]:
            self.trip(_FOLLOWING_ERROR_CODE, 0x21, now_s)
            return ServoTarget(self._velocity_rad_s())
        return ServoTarget(moved / self._counts_per_rad / self.period_s, (self._counts + error) / self._counts_per_rad)

    def _homing_target(self, before: Homing) -> ServoTarget:
        run = self._homing = step_homing(before, self._counts, self._last_counts, self.period_s)
        if run.attained and not before.attained:
            self._offset_counts = run.reference - self.dictionary.number(Index.HOME_OFFSET)
        self._status(Statusword.HOMING_ATTAINED * run.attained | Statusword.TARGET_REACHED * run.done)
        return ServoTarget(run.velocity / self._counts_per_rad)


def _wrap(counts: int) -> int:
    """Wrap a value to INTEGER32."""
    return ((counts + 0x80000000) & 0xFFFFFFFF) - 0x80000000
