"""A CAN bus inside one process and one thread: deterministic, in any time, about a microsecond per frame.

A frame is handed to its listeners inside `send`, so a SYNC returns after every node has answered it. That is an ideal
bus: no bit time, no arbitration, no errors. `drivers.modelled_bus.ModelledBus` adds those.

One thread only sends; another may wait for frames (`AsBusABC` under canopen's own Notifier).
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable

import can

from drivers.bus import BusHealth, CanPort, Listener, foreign_kind


class _Routes(dict[int, tuple[Listener, ...]]):
    """Identifier -> listeners of all other ports; filled on first use."""

    def __init__(self, find: Callable[[int], tuple[Listener, ...]]) -> None:
        super().__init__()
        self._find = find

    def __missing__(self, can_id: int) -> tuple[Listener, ...]:
        found = self[can_id] = self._find(can_id)
        return found


class InProcessPort:
    """Connection to an `InProcessBus`."""

    __slots__ = ("_all", "_bus", "_listeners", "_routes", "health")

    def __init__(self, bus: InProcessBus) -> None:
        self._bus = bus
        self._listeners: dict[int, list[Listener]] = {}
        self._all: list[Listener] = []
        self._routes = _Routes(lambda can_id: bus.listeners(can_id, but=self))
        self.health = BusHealth()

    def listen(self, can_id: int | None, listener: Listener) -> None:
        (self._all if can_id is None else self._listeners.setdefault(can_id, [])).append(listener)
        self._bus.forget_routes()

    def ignore(self, can_id: int | None, listener: Listener) -> None:
        (self._all if can_id is None else self._listeners.get(can_id, [])).remove(listener)
        self._bus.forget_routes()

    def listeners(self, can_id: int) -> list[Listener]:
        """Return the listeners of this port for a frame."""
        return self._listeners.get(can_id, []) + self._all

    def forget_routes(self) -> None:
        """Clear the routes after a change of listeners on the bus."""
        self._routes.clear()

    def send(self, can_id: int, data: bytes, now_s: float) -> None:
        for listener in self._routes[can_id]:
            listener(can_id, data, now_s)

    def poll(self, now_s: float, timeout_s: float = 0.0) -> None:
        """Let the nodes on the bus know the time: no frame waits on an ideal bus."""
        self._bus.pass_time(now_s)

    def close(self) -> None:
        self._bus.remove(self)


class InProcessBus:
    """The bus: `port()` connects one more participant. Frames reach the ports in the order they were connected."""

    def __init__(self) -> None:
        self._ports: list[InProcessPort] = []
        self.clocks: list[Callable[[float], None]] = []  # of simulated nodes: called with the time of every poll

    def port(self) -> InProcessPort:
        """Connect a participant."""
        port = InProcessPort(self)
        self._ports.append(port)
        self.forget_routes()
        return port

    def pass_time(self, now_s: float) -> None:
        """Call the clocks of the simulated nodes."""
        for clock in self.clocks:
            clock(now_s)

    def remove(self, port: InProcessPort) -> None:
        """Disconnect a participant."""
        if port in self._ports:
            self._ports.remove(port)
            self.forget_routes()

    def listeners(self, can_id: int, *, but: InProcessPort) -> tuple[Listener, ...]:
        """Return the listeners of all ports except `but` for a frame."""
        return tuple(heard for port in self._ports if port is not but for heard in port.listeners(can_id))

    def forget_routes(self) -> None:
        """Clear the routes of all ports."""
        for port in self._ports:
            port.forget_routes()


class AsBusABC(can.BusABC):  # type: ignore[misc]  # python-can is not typed here
    """Adapter of a `CanPort` to a python-can bus, for canopen's own Network, python-can's loggers."""

    def __init__(self, port: CanPort, clock: Callable[[], float] = time.monotonic) -> None:
        self._port, self._clock = port, clock
        self._received: queue.SimpleQueue[can.Message] = queue.SimpleQueue()
        self.channel_info = "CanPort"
        port.listen(None, self._on_frame)
        super().__init__(channel=None)

    def _on_frame(self, can_id: int, data: bytes, time_s: float) -> None:
        self._received.put(can.Message(timestamp=time_s, arbitration_id=can_id, data=data, is_extended_id=False))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if kind := foreign_kind(msg):
            raise can.CanOperationError(f"a CanPort carries frames of CANopen only, given: {kind}")
        self._port.send(msg.arbitration_id, bytes(msg.data), self._clock())

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """Wait in slices: on a modelled bus a frame arrives only when the caller advances the time."""
        self._port.poll(self._clock())
        try:
            return self._received.get(timeout=0.005 if timeout is None else min(timeout, 0.005)), False
        except queue.Empty:
            return None, False

    def shutdown(self) -> None:
        super().shutdown()
        self._port.ignore(None, self._on_frame)
