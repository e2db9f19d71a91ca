"""The way of a drive to OPERATION ENABLED: its mode display, the time of its transitions, and what hinders it.

Drives take some 100 ms for a transition, and some show their mode (0x6061) only when they are enabled. So the display
is asked for while the drive is armed, by SDO without waiting, and no set-point acts before it is right.
"""

from collections.abc import Mapping
from struct import Struct
from typing import Final

from drivers.bus import CanPort
from drivers.cia402 import Controlword, DriveState, OperationMode, Statusword, state_of
from drivers.emcy import error_text
from drivers.object_index import ObjectIndex as Index

_ASKED: Final = (Index.MODE_DISPLAY, Index.ERROR_CODE, Index.CONTROLWORD)
_REQUEST: Final = Struct("<BHB4x")  # CiA 301: upload initiate
_UPLOAD, _ABORT = 0x40, 0x80
_ANSWER_S: Final = 0.5  # an answer that takes longer is not awaited
_SPACING_S: Final = 0.01  # between an answer and the next request
_ASK_AFTER_S: Final = 0.1  # a drive that is armed sooner is asked nothing
_SLOWER: Final = 1.5  # than its transitions to enabled a drive may be when it is disarmed
_SLOWEST_S: Final = 0.5
_BEFORE_READY: Final = (DriveState.SWITCH_ON_DISABLED, DriveState.QUICK_STOP_ACTIVE)
_SWITCHED_OFF: Final = (DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON)


class LoopReader:
    """Reads objects of a node by SDO in turn, from within the loop: one request at a time, `values` by index."""

    def __init__(self, port: CanPort, node_id: int) -> None:
        self.values: dict[int, int] = {}
        self._send, self._request_id, self._turn = port.send, 0x600 + node_id, 0
        port.listen(0x580 + node_id, self._on_answer)
        self.begin()

    def begin(self) -> None:
        """Forget all answers; a new time base may begin."""
        self.values.clear()
        self._awaited: bytes | None = None
        self._due_s = -float("inf")

    def ask(self, indices: tuple[int, ...], now_s: float) -> None:
        """Send the next request, if none is under way."""
        if now_s < self._due_s:
            return
        self._turn = (self._turn + 1) % len(indices)
        request = _REQUEST.pack(_UPLOAD, indices[self._turn], 0)
        self._awaited, self._due_s = request[1:4], now_s + _ANSWER_S
        self._send(self._request_id, request, now_s)

    def _on_answer(self, can_id: int, data: bytes, now_s: float) -> None:
        if self._awaited is None or len(data) != 8 or data[1:4] != self._awaited:
            return
        index = int.from_bytes(data[1:3], "little")
        if data[0] & 0xE3 == _UPLOAD | 0x03:  # expedited, with its size
            size = 4 - (data[0] >> 2 & 3)
            self.values[index] = int.from_bytes(data[4 : 4 + size], "little", signed=index == Index.MODE_DISPLAY)
        elif data[0] != _ABORT:
            return
        self._awaited, self._due_s = None, now_s + _SPACING_S


class Arming:
    """Follows a drive while it is armed. slowest_s: longest time that it stayed in one state meanwhile."""

    def __init__(self, port: CanPort, node_id: int) -> None:
        self._reader = LoopReader(port, node_id)
        self.begin(OperationMode.NONE, mode_shown=True)

    def begin(self, mode: OperationMode, *, mode_shown: bool) -> None:
        """Begin anew after a set-up; mode_shown: 0x6061 showed the mode there."""
        self._reader.begin()
        self._mode, self.mode_shown = mode, mode_shown
        self.slowest_s = self._start_s = self._since_s = 0.0
        self._state: DriveState | None = None

    def stop(self) -> None:
        """Note that the drive is not being armed (any more)."""
        self._state = None

    def step(self, state: DriveState, now_s: float) -> None:
        """Take in the state of a cycle in which the drive is to be enabled and is not, or does not show its mode."""
        if self._state is None:
            self._reader.begin()
            self._start_s = now_s
        if state is not self._state:
            self._state, self._since_s = state, now_s
        self.slowest_s = max(self.slowest_s, now_s - self._since_s)
        if state is DriveState.OPERATION_ENABLED:
            self._reader.ask((Index.MODE_DISPLAY,), now_s)
            self.mode_shown = self._reader.values.get(Index.MODE_DISPLAY) == self._mode
        elif now_s - self._start_s > _ASK_AFTER_S:
            self._reader.ask(_ASKED, now_s)

    @property
    def disarm_s(self) -> float:
        """Time that the drive may take to leave OPERATION ENABLED at rest: a brake closes as slowly as it opened."""
        return min(_SLOWER * self.slowest_s, _SLOWEST_S)

    def hindrances(self, statusword: int, sent: int, *, answers: bool) -> str:
        """What keeps the drive from being enabled, for a message. sent: last controlword; answers: to SYNC."""
        found = hindrances(statusword, sent, None if self.mode_shown else self._mode, self._reader.values)
        if not answers:
            found.append("it has answered no SYNC since its set-up")
        return ": " + "; ".join(found) if found else ""


def hindrances(statusword: int, sent: int, mode: OperationMode | None, read: Mapping[int, int]) -> list[str]:
    """What keeps a drive from OPERATION ENABLED in its mode, in words (CiA 402-2, statusword and controlword).

    sent: last controlword; mode: that 0x6061 does not show yet, None: it does; read: values of 0x6061, 0x603F and
    0x6040 in the drive, as far as they are known.
    """
    state, found = state_of(statusword), []
    code, held, shown = (read.get(index) for index in (Index.ERROR_CODE, Index.CONTROLWORD, Index.MODE_DISPLAY))
    if state is DriveState.UNKNOWN:
        found.append("CiA 402 does not define this state")
    if state is DriveState.NOT_READY_TO_SWITCH_ON:
        found.append("the drive still initialises")
    if state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
        found.append("the drive has a fault, which must be reset")
    if code:
        found.append(f"error code (object 0x603F) {error_text(code)}")
    if not statusword & Statusword.REMOTE:
        found.append("remote (statusword bit 9) is 0: the drive does not obey the bus; give the bus the control")
    if state in _SWITCHED_OFF and not statusword & Statusword.VOLTAGE_ENABLED:
        found.append("no main voltage (statusword bit 4 is 0)")
    if statusword & Statusword.WARNING:
        found.append("a warning is active (statusword bit 7)")
    if statusword & Statusword.INTERNAL_LIMIT:
        found.append("an internal limit is active (statusword bit 11): limit switch, travel, speed or torque")
    if held is not None and held & Controlword.HALT & ~sent:
        found.append("halt (controlword bit 8) is set in the drive, not by this program: is there a second master?")
    elif held is not None and held != sent:
        found.append(f"the drive holds controlword 0x{held:04X}, sent is 0x{sent:04X}: its RPDO does not act")
    if state is DriveState.OPERATION_ENABLED and mode is not None:
        found.append(f"the mode display (object 0x6061) reads {mode_name(shown)}, commanded is {mode_name(mode)}")
    if not found and state in _BEFORE_READY and not statusword & Statusword.QUICK_STOP:  # 0 without another cause, too
        found.append("quick stop (statusword bit 5 is 0), by an input of the drive or its commissioning tool")
    return found


def mode_name(mode: int | None) -> str:
    """Mode of operation as number and name."""
    if mode is None:
        return "nothing"
    return f"{mode} ({OperationMode(mode).name})" if mode in list(OperationMode) else f"{mode}"
