"""An in-process bus with bit time, arbitration, error confinement and faults injected at chosen frames.

Deterministic: events are ordered by time, then identifier, then age; the same sends give the same deliveries. A frame
sent at `now_s` arrives when its bits have passed, so a loop polls at a later instant of the same cycle:

    master.sync(t); master.poll(t + 0.0004); drive.read(...); drive.command(t + 0.0004, torque)

Bits of a standard data frame of n bytes with the longest bit stuffing, and the interframe space (ISO 11898-1):

    bits(n) = 47 + 8 n + floor((34 + 8 n - 1) / 4)
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from drivers.bus import BusState
from drivers.inprocess import InProcessBus, InProcessPort

ERROR_FRAME_BITS: Final = 31  # error flag, its echo, delimiter and interframe space, at most
_ERROR_WEIGHT: Final = 8  # transmit error counter: +8 per error, -1 per success
_PASSIVE_ABOVE, _OFF_ABOVE = 127, 255


def frame_bits(size: int) -> int:
    """Length [bits] of a standard data frame of `size` bytes with the longest bit stuffing."""
    return 47 + 8 * size + (34 + 8 * size - 1) // 4


class FaultKind(StrEnum):
    """Fate of a frame on the bus."""

    DROP = "drop"  # passes the bus, no node receives it
    DELAY = "delay"  # its sender holds it back
    CORRUPT = "corrupt"  # a byte arrives inverted (an error the CRC of the frame did not see)
    DUPLICATE = "duplicate"  # arrives twice (its sender saw an error in the last bit of the frame, ISO 11898-1)
    TRUNCATE = "truncate"  # arrives one byte short
    ERROR_FRAME = "error_frame"  # destroyed by an error frame, sent again by itself
    BUS_OFF = "bus_off"  # its sender's controller leaves the bus


@dataclass(frozen=True, slots=True)
class Fault:
    """Fault of `count` frames with this identifier (None: any), beginning with the `first` one after `inject`."""

    kind: FaultKind
    can_id: int | None = None
    first: int = 0
    count: int = 1
    delay_s: float = 0.0
    byte: int = 0  # that is inverted; a frame without it arrives as it is


@dataclass(slots=True)
class _Armed:
    fault: Fault
    seen: int = 0

    def hits(self, can_id: int) -> bool:
        """Count a frame; return True if the fault applies to it."""
        if self.fault.can_id not in (None, can_id):
            return False
        self.seen += 1
        return self.fault.first < self.seen <= self.fault.first + self.fault.count


@dataclass(slots=True)
class _Frame:
    request_s: float
    can_id: int
    age: int
    data: bytes
    sender: ModelledPort
    drop: bool = False


class ModelledPort(InProcessPort):
    """Connection to a `ModelledBus`."""

    __slots__ = ("_model", "_transmit_errors")

    def __init__(self, bus: ModelledBus) -> None:
        super().__init__(bus)
        self._model = bus
        self._transmit_errors = 0

    def send(self, can_id: int, data: bytes, now_s: float) -> None:
        if self.health.state is BusState.OFF:
            self.health.frames_lost += 1
            return
        self._model.submit(self, can_id, data, now_s)

    def poll(self, now_s: float, timeout_s: float = 0.0) -> None:
        self._model.run_until(now_s)
        self._model.pass_time(now_s)
        self._model.run_until(now_s)

    def listeners(self, can_id: int) -> list:  # type: ignore[type-arg]
        return [] if self.health.state is BusState.OFF else super().listeners(can_id)

    def recover(self) -> None:
        """Return to the bus after bus-off, as after 128 x 11 recessive bits."""
        self._transmit_errors = 0
        self._set_state(BusState.ACTIVE)

    def sent(self) -> None:
        """Count a success."""
        if self._transmit_errors:
            self._transmit_errors -= 1
            if self._transmit_errors <= _PASSIVE_ABOVE:
                self._set_state(BusState.ACTIVE)

    def failed(self) -> None:
        """Count an error of transmission (ISO 11898-1, fault confinement)."""
        self._transmit_errors += _ERROR_WEIGHT
        if self._transmit_errors > _OFF_ABOVE:
            self.switch_off()
        elif self._transmit_errors > _PASSIVE_ABOVE:
            self._set_state(BusState.PASSIVE)

    def switch_off(self) -> None:
        """Enter bus-off: neither send nor receive."""
        self._set_state(BusState.OFF)
        self.health.last_error = "bus off"

    def _set_state(self, state: BusState) -> None:
        if state is not self.health.state:
            self.health.state = state
            self._model.forget_routes()


class ModelledBus(InProcessBus):
    """bitrate None: frames take no time (faults only)."""

    def __init__(self, bitrate: int | None = 1_000_000) -> None:
        super().__init__()
        self._bit_s = 0.0 if bitrate is None else 1 / bitrate
        self._pending: list[_Frame] = []
        self._armed: list[_Armed] = []
        self._now_s = self._free_s = self._busy_s = self._since_s = 0.0
        self._age = 0
        self._running = False

    def port(self) -> ModelledPort:
        port = ModelledPort(self)
        self._ports.append(port)
        self.forget_routes()
        return port

    def inject(self, fault: Fault) -> None:
        """Arm a fault."""
        self._armed.append(_Armed(fault))

    def load(self) -> float:
        """Share of the time the bus was busy since the last call."""
        span_s = self._now_s - self._since_s
        share = self._busy_s / span_s if span_s > 0 else 0.0
        self._busy_s, self._since_s = 0.0, self._now_s
        return share

    def submit(self, sender: ModelledPort, can_id: int, data: bytes, now_s: float) -> None:
        """Queue a frame of a controller for arbitration."""
        self._age += 1
        frame = _Frame(now_s, can_id, self._age, data, sender)
        for armed in self._armed:
            if armed.hits(can_id):
                self._befall(frame, armed.fault)
        if sender.health.state is BusState.OFF:
            sender.health.frames_lost += 1
            return
        self._pending.append(frame)
        if not self._running:
            self.run_until(now_s)

    def _befall(self, frame: _Frame, fault: Fault) -> None:
        if fault.kind is FaultKind.DROP:
            frame.drop = True
        elif fault.kind is FaultKind.DELAY:
            frame.request_s += fault.delay_s
        elif fault.kind is FaultKind.CORRUPT and len(frame.data) > fault.byte:
            at = fault.byte
            frame.data = frame.data[:at] + bytes([frame.data[at] ^ 0xFF]) + frame.data[at + 1 :]
        elif fault.kind is FaultKind.DUPLICATE:
            self._age += 1
            self._pending.append(_Frame(frame.request_s, frame.can_id, self._age, frame.data, frame.sender))
        elif fault.kind is FaultKind.TRUNCATE:
            frame.data = frame.data[:-1]
        elif fault.kind is FaultKind.BUS_OFF:
            frame.sender.switch_off()
        elif fault.kind is FaultKind.ERROR_FRAME:
            self._destroy(frame)

    def _destroy(self, frame: _Frame) -> None:
        """Signal an error frame to all ports; the sender counts it and retransmits."""
        bits_s = (frame_bits(len(frame.data)) + ERROR_FRAME_BITS) * self._bit_s
        self._free_s = max(self._free_s, frame.request_s) + bits_s
        self._busy_s += bits_s
        for port in self._ports:
            port.health.error_frames += 1
            port.health.last_error = f"error frame in 0x{frame.can_id:03X}"
        frame.sender.failed()

    def run_until(self, now_s: float) -> None:
        """Deliver what has passed the bus by now. A smaller time than before sets the time base anew."""
        if now_s < self._now_s:
            self._rebase(now_s)
        if self._running:
            return
        self._running = True
        try:
            while self._pending:
                start_s = max(self._free_s, min(frame.request_s for frame in self._pending))
                ready = (frame for frame in self._pending if frame.request_s <= start_s)
                frame = min(ready, key=lambda waiting: (waiting.can_id, waiting.age))
                end_s = start_s + frame_bits(len(frame.data)) * self._bit_s
                if end_s > now_s:
                    break
                self._pending.remove(frame)
                self._deliver(frame, end_s)
        finally:
            self._running = False
        self._now_s = now_s

    def _deliver(self, frame: _Frame, end_s: float) -> None:
        self._busy_s += end_s - max(self._free_s, frame.request_s)
        self._free_s = end_s
        frame.sender.sent()
        if not frame.drop:
            for listener in self.listeners(frame.can_id, but=frame.sender):
                listener(frame.can_id, frame.data, end_s)

    def _rebase(self, now_s: float) -> None:
        for frame in self._pending:
            frame.request_s = now_s
        self._now_s = self._free_s = self._since_s = now_s
        self._busy_s = 0.0
