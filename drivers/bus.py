"""CAN ports of drives, encoders and simulated nodes, and opening of a python-can bus.

Every port, simulated or real, does four things: `listen` to a COB-ID, `send` a frame, `poll` for what has arrived, and
report its `health`. The caller passes the time. `PythonCanPort` stands on any python-can bus
(socketcan, virtual, udp_multicast); the in-process bus of `drivers.inprocess` offers the same without threads.

Frames enter here alone: a listener gets classic data frames with an 11-bit identifier, all that CANopen has (CiA 301);
others are foreign and counted. Error frames of a controller are decoded, since the canopen package drops them and a
bus-off would stay invisible.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Final, Protocol

import can
from can.interfaces.virtual import VirtualBus

from drivers.loopback_bus import DamagedData, LoopbackBus, open_loopback
from drivers.port import BusError

Listener = Callable[[int, bytes, float], None]  # COB-ID, data, time_s
"""Called once per frame; canopen's own callbacks have the same form."""


class BusState(IntEnum):
    """Error state of a CAN controller, ISO 11898-1."""

    ACTIVE = 0
    PASSIVE = 1
    OFF = 2


@dataclass(slots=True)
class BusHealth:
    """State of a CAN controller; counters since the bus was opened."""

    state: BusState = BusState.ACTIVE
    error_frames: int = 0
    frames_lost: int = 0  # frames this port could not send
    last_error: str = ""
    foreign: Counter[str] = field(default_factory=Counter)  # received and not acted on, by kind


class CanPort(Protocol):
    """Connection to a CAN bus."""

    health: BusHealth

    def listen(self, can_id: int | None, listener: Listener) -> None:
        """Call `listener` for each frame with this identifier; None: for every frame."""

    def ignore(self, can_id: int | None, listener: Listener) -> None:
        """Undo `listen`."""

    def send(self, can_id: int, data: bytes, now_s: float) -> None:
        """Send a frame. A port whose controller is off counts it as lost: the loop goes on and sees `health`."""

    def poll(self, now_s: float, timeout_s: float = 0.0) -> None:
        """Hand what has arrived to the listeners; waits up to timeout_s for a first frame, 0 never waits."""

    def close(self) -> None: ...


@dataclass(frozen=True, slots=True)
class BusConfig:
    """Settings of a bus: python-can's interface name, channel and bit rate."""

    interface: str = "virtual"
    channel: str = "hil"
    bitrate: int = 1_000_000

    INTERFACES = ("virtual", "udp_multicast", "socketcan")


# Error classes of socketcan (linux/can/error.h): bits of the identifier of an error frame, and of data[1].
_ERR_CLASS: Final = {
    0x001: "transmit time-out", 0x002: "arbitration lost", 0x004: "controller problem", 0x008: "protocol violation",
    0x010: "transceiver", 0x020: "no acknowledge", 0x040: "bus off", 0x080: "bus error", 0x100: "restarted",
}  # fmt: skip
_BUS_OFF, _RESTARTED, _CONTROLLER = 0x040, 0x100, 0x004
_PASSIVE, _BACK_TO_ACTIVE = 0x30, 0x40
_MOST_FRAMES: Final = 1000  # of one poll: the loop goes on whatever floods the bus


_CHANNELS: Final = {  # allowed, advice
    "virtual": ("any name", ""),
    "udp_multicast": ("an IPv4 multicast address, 224.0.0.0 to 239.255.255.255", "It reaches processes of this PC."),
    "socketcan": (
        "an existing channel", "Is the interface up (ip link set can0 up type can bitrate 1000000)?"
    ),
}  # fmt: skip


def open_bus(config: BusConfig) -> can.BusABC:
    """Open a python-can bus. BusError says which interface and why."""
    where = f"bus {config.interface}:{config.channel}"
    if config.interface not in BusConfig.INTERFACES:
        raise BusError("unknown interface", where=where, given=config.interface,
                       allowed=", ".join(BusConfig.INTERFACES))  # fmt: skip
    options: dict[str, Any] = {"bitrate": config.bitrate} if config.interface == "socketcan" else {}
    try:
        if config.interface == "udp_multicast":
            return open_loopback(config.channel)
        return can.Bus(interface=config.interface, channel=config.channel, **options)
    except (can.CanError, OSError, ValueError) as error:
        allowed, advice = _CHANNELS[config.interface]
        raise BusError(f"cannot be opened ({error})", where=where, allowed=allowed, advice=advice) from error


class DataFrame(can.Message):  # type: ignore[misc]  # python-can is not typed here
    """A standard data frame whose copy takes 1 us instead of 4: python-can's virtual bus copies each one it sends."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, Any] | None) -> "DataFrame":
        return DataFrame(arbitration_id=self.arbitration_id, data=bytes(self.data), is_extended_id=False)


def foreign_kind(frame: can.Message) -> str:
    """Return what a frame is that CANopen does not have; "" for a classic data frame with an 11-bit identifier."""
    if frame.is_error_frame:
        return "error frame"
    if frame.is_fd:
        return "CAN FD"
    if frame.is_remote_frame:
        return "remote frame"  # CiA 301 has it for PDOs and node guarding, and advises against it
    return "29-bit identifier" if frame.is_extended_id else ""


class PythonCanPort:
    """A python-can bus as a `CanPort`."""

    __slots__ = ("_all", "_bus", "_has_controller", "_listeners", "health")

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._has_controller = not isinstance(bus, VirtualBus | LoopbackBus)  # else an error frame is somebody's data
        self._listeners: dict[int, list[Listener]] = {}
        self._all: list[Listener] = []
        self.health = BusHealth()

    def listen(self, can_id: int | None, listener: Listener) -> None:
        (self._all if can_id is None else self._listeners.setdefault(can_id, [])).append(listener)

    def ignore(self, can_id: int | None, listener: Listener) -> None:
        (self._all if can_id is None else self._listeners.get(can_id, [])).remove(listener)

    def send(self, can_id: int, data: bytes, now_s: float) -> None:
        try:
            self._bus.send(DataFrame(arbitration_id=can_id, data=data, is_extended_id=False))
        except can.CanError as error:
            self.health.frames_lost += 1
            self.health.last_error = str(error)

    def poll(self, now_s: float, timeout_s: float = 0.0) -> None:
        for _ in range(_MOST_FRAMES):
            try:
                frame = self._bus.recv(timeout_s)
            except DamagedData:
                self.health.foreign["no CAN frame"] += 1
                timeout_s = 0.0
                continue
            except (can.CanError, OSError, ValueError) as error:
                raise BusError(f"receiving failed ({error})", where=f"bus {self._bus.channel_info}",
                               advice="Was the interface taken down or the bus closed?") from error  # fmt: skip
            if frame is None:
                return
            timeout_s = 0.0
            self._hand_on(frame, now_s)

    def _hand_on(self, frame: can.Message, now_s: float) -> None:
        if kind := foreign_kind(frame):
            if frame.is_error_frame and self._has_controller:
                self._on_error_frame(frame)
            else:
                self.health.foreign[kind] += 1
            return
        can_id, data = frame.arbitration_id, bytes(frame.data)
        for listener in self._listeners.get(can_id, ()):
            listener(can_id, data, now_s)
        for listener in self._all:
            listener(can_id, data, now_s)

    def _on_error_frame(self, message: can.Message) -> None:
        bits, data, health = message.arbitration_id, message.data, self.health
        health.error_frames += 1
        health.last_error = ", ".join(text for bit, text in _ERR_CLASS.items() if bits & bit) or "error frame"
        if bits & _BUS_OFF:
            health.state = BusState.OFF
        elif bits & _RESTARTED:
            health.state = BusState.ACTIVE
        elif bits & _CONTROLLER and len(data) > 1:
            if data[1] & _PASSIVE:
                health.state = BusState.PASSIVE
            elif data[1] & _BACK_TO_ACTIVE:
                health.state = BusState.ACTIVE

    def close(self) -> None:
        self._bus.shutdown()


class PumpedPort:
    """Port of a loop that shares its thread with the simulated nodes: `poll` first polls the ports of the nodes,
    then calls their clock.

    Loop and nodes need no second Python thread, in virtual and in wall-clock time.
    """

    __slots__ = ("_clock", "_nodes", "_port", "health", "ignore", "listen", "send")

    def __init__(self, port: CanPort, *nodes: CanPort, clock: Callable[[float], None] | None = None) -> None:
        self._port, self._nodes, self._clock = port, nodes, clock
        self.health = port.health
        self.listen, self.ignore, self.send = port.listen, port.ignore, port.send

    def poll(self, now_s: float, timeout_s: float = 0.0) -> None:
        for node in self._nodes:
            node.poll(now_s)
        if self._clock is not None:
            self._clock(now_s)
        self._port.poll(now_s)

    def close(self) -> None:
        self._port.close()
