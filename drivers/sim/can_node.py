"""A simulated CANopen node (CiA 301): NMT, boot-up, heartbeat both ways, SDO server, EMCY, SYNC-driven PDOs.

A subclass is the device: `process_sync` moves and measures, `process_rpdo` takes commands, `communication_lost` reacts
to the missing heartbeat of the master. The node reads no clock: each frame carries its time. SYNCs drive its timers; on
a bus without SYNC the caller calls `tick`.
"""

import struct
from enum import IntEnum
from pathlib import Path
from typing import Final

from drivers.bus import CanPort
from drivers.object_index import ObjectIndex as Index
from drivers.sim.object_dictionary import Dictionary, key_of
from drivers.sim.process_data import ProcessData
from drivers.sim.sdo_server import AbortCode, SdoAbort, SdoServer

EDS_FOLDER: Final = Path(__file__).parent.parent / "eds"
_EMCY: Final = struct.Struct("<HB5s")
_HISTORY: Final = key_of(Index.ERROR_HISTORY)
HEARTBEAT_ERROR: Final = 0x8130  # EMCY: heartbeat consumer time-out, CiA 301 table 26
RPDO_TIMEOUT: Final = 0x8250  # EMCY: event timer of an RPDO (0x1400:5 ff.) ran out, CiA 301 table 26
# Keys of the heartbeat times, computed once.
_PRODUCER_TIME, _CONSUMER_TIME = key_of(Index.PRODUCER_HEARTBEAT_TIME), key_of(Index.CONSUMER_HEARTBEAT_TIME, 1)


class NmtState(IntEnum):
    """NMT states as the heartbeat reports them."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """NMT commands of COB-ID 0."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


class SimulatedDevice:
    """A simulated node on one port. Raises ValueError for a node-ID outside 1..127."""

    def __init__(self, port: CanPort, eds: Path, node_id: int) -> None:
        if not 1 <= node_id <= 127:
            raise ValueError(f"node_id must be 1..127, got {node_id}")
        self.port, self.node_id = port, node_id
        self.dictionary = Dictionary(eds, node_id)
        self.values = self.dictionary.values
        self.nmt_state = NmtState.INITIALISING
        self.pdo = ProcessData(self.dictionary, port, self.process_rpdo, self.emergency)
        self._sdo = SdoServer(self.dictionary.read, self.dictionary.write)
        self._consumed: dict[int, float] = {}  # node-ID -> deadline, once its first heartbeat came
        self._heartbeat_due_s = 0.0
        self._timer_s = 0.0
        self._last_s = 0.0
        self.mute = False  # fault injection: the node continues to compute but sends nothing
        self.dictionary.on_write(Index.CONSUMER_HEARTBEAT_TIME, self._on_consumer_written)
        self.dictionary.on_write(Index.PRODUCER_HEARTBEAT_TIME, self._on_producer_written)
        port.listen(0x000, self._on_nmt)
        port.listen(0x080, self._on_sync)
        port.listen(0x600 + node_id, self._on_sdo)
        self._boot(0.0)

    # -- implemented by subclasses ----------------------------------------------------------------------------------

    def process_sync(self, now_s: float) -> None:
        """Move and measure: called at every SYNC, before the TPDOs are packed."""

    def process_rpdo(self, now_s: float) -> None:
        """Take new set-points from `values`, after an RPDO."""

    def communication_lost(self, now_s: float) -> None:
        """React to a time-out of a consumed heartbeat or an RPDO, and to the NMT command "stop"."""

    # -- NMT, boot-up, timers ---------------------------------------------------------------------------------------

    def _boot(self, now_s: float) -> None:
        self._consumed.clear()
        self.pdo.configure(operational=False)
        self._send(0x700 + self.node_id, b"\0", now_s)
        self._enter(NmtState.PRE_OPERATIONAL)
        self._schedule(now_s)

    def _enter(self, state: NmtState) -> None:
        self.nmt_state = state
        self.pdo.configure(operational=state is NmtState.OPERATIONAL)

    def reset(self, now_s: float) -> None:
        """Power cycle: set the dictionary to the defaults of the EDS and boot."""
        self.dictionary.reset(0x1000, 0xFFFF)
        self._boot(now_s)

    def _on_nmt(self, can_id: int, data: bytes, now_s: float) -> None:
        if len(data) != 2 or data[1] not in (0, self.node_id):
            return
        command = data[0]
        if command == NmtCommand.START:
            self._enter(NmtState.OPERATIONAL)
        elif command == NmtCommand.STOP:
            running = self.nmt_state is NmtState.OPERATIONAL
            self._enter(NmtState.STOPPED)
            if running:  # an event of 0x6007, as a lost heartbeat is (CiA 402-2, abort connection option code)
                self.communication_lost(now_s)
        elif command == NmtCommand.ENTER_PRE_OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)
        elif command == NmtCommand.RESET_NODE:
            self.reset(now_s)
        elif command == NmtCommand.RESET_COMMUNICATION:
            self.dictionary.reset(0x1000, 0x1FFF)
            self._boot(now_s)

    def tick(self, now_s: float) -> None:
        """Heartbeat producer and consumers; returns quickly if nothing is due."""
        if now_s < self._last_s:  # the time base was reset: restart the timers
            self._consumed = dict.fromkeys(self._consumed, now_s + self._consumer_time_s())
            self._heartbeat_due_s = now_s
            self.pdo.restart_deadlines()
        self._last_s = now_s
        period_s = self.values[_PRODUCER_TIME] / 1000
        if period_s and now_s >= self._heartbeat_due_s:
            self._send(0x700 + self.node_id, bytes([self.nmt_state]), now_s)
            self._heartbeat_due_s = max(self._heartbeat_due_s + period_s, now_s)
        for node_id, deadline_s in list(self._consumed.items()):
            if now_s >= deadline_s:
                del self._consumed[node_id]
                self._communication_error(HEARTBEAT_ERROR, now_s, bytes([node_id]))
        if now_s >= self.pdo.deadline_s:
            self.pdo.restart_deadlines()
            self._communication_error(RPDO_TIMEOUT, now_s)
        self._schedule(now_s)

    def _communication_error(self, code: int, now_s: float, detail: bytes = b"") -> None:
        """Send the EMCY, leave NMT operational if 0x1029:1 is 0, and let the device react."""
        self.emergency(code, 0x11, now_s, detail)
        if self.dictionary.number(Index.ERROR_BEHAVIOUR, 1) == 0 and self.nmt_state is NmtState.OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)
        self.communication_lost(now_s)

    def _schedule(self, now_s: float) -> None:
        due = [*self._consumed.values()]
        if self.values[_PRODUCER_TIME]:
            due.append(self._heartbeat_due_s)
        self._last_s = now_s
        self._timer_s = min(due, default=float("inf"))

    def _consumer_time_s(self) -> float:
        return float(self.values[_CONSUMER_TIME] & 0xFFFF) / 1000

    def _on_consumer_written(self, index: int, subindex: int, value: int) -> None:
        old = self.dictionary.number(Index.CONSUMER_HEARTBEAT_TIME, 1) >> 16 & 0x7F
        node_id, time_ms = value >> 16 & 0x7F, value & 0xFFFF
        self._consumed.clear()
        if old:
            self.port.ignore(0x700 + old, self._on_heartbeat)
        if node_id and time_ms:
            self.port.listen(0x700 + node_id, self._on_heartbeat)
        elif value:
            raise SdoAbort(AbortCode.INVALID_VALUE)

    def _on_producer_written(self, index: int, subindex: int, value: int) -> None:
        self._heartbeat_due_s = self._timer_s = self._last_s

    def _on_heartbeat(self, can_id: int, data: bytes, now_s: float) -> None:
        deadline_s = now_s + self._consumer_time_s()
        self._consumed[can_id - 0x700] = deadline_s
        self._timer_s = min(self._timer_s, deadline_s)  # if this is too early, `tick` finds nothing due

    # -- SDO, SYNC, EMCY --------------------------------------------------------------------------------------------

    def _on_sdo(self, can_id: int, data: bytes, now_s: float) -> None:
        if self.nmt_state is NmtState.STOPPED:
            return
        response = self._sdo.answer(data)
        if response is not None:
            self._send(0x580 + self.node_id, response, now_s)

    def _on_sync(self, can_id: int, data: bytes, now_s: float) -> None:
        if now_s >= self._timer_s or now_s < self._last_s or now_s >= self.pdo.deadline_s:
            self.tick(now_s)
        self._last_s = now_s
        if self.nmt_state is NmtState.STOPPED:  # NMT and heartbeat only, CiA 301 table "NMT states and objects"
            return
        self.process_sync(now_s)
        if not self.mute:
            self.pdo.on_sync(now_s)  # holds no PDOs outside NMT operational

    def emergency(self, code: int, register: int, now_s: float, detail: bytes = b"") -> None:
        """Send an EMCY, keep it in 0x1003 (newest first) and in the error register; code 0: errors reset."""
        self.values[0x1001_00] = register
        if code:
            history = [self.dictionary.number(Index.ERROR_HISTORY, k) for k in range(1, 9)]
            for k, entry in enumerate([code, *history[:7]], start=1):
                self.values[_HISTORY + k] = entry
            self.values[_HISTORY] = min(self.dictionary.number(Index.ERROR_HISTORY) + 1, 8)
        if self.nmt_state is not NmtState.STOPPED:
            self._send(0x080 + self.node_id, _EMCY.pack(code, register, detail), now_s)

    def _send(self, can_id: int, data: bytes, now_s: float) -> None:
        if not self.mute:
            self.port.send(can_id, data, now_s)
