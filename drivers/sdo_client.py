"""canopen's SDO client without its threads: the caller that waits for a response polls the port itself.

The Network of canopen reads the bus in a Notifier thread, which an exception ends without a message. Here one thread
does all, the same on real and simulated buses.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final

import canopen
from canopen.sdo import SdoAbortedError, SdoClient, SdoCommunicationError

from drivers.bus import CanPort

RESPONSE_TIMEOUT_S: Final = 0.5
MOST_ANSWERS: Final = 16  # of one transfer: the objects used here have 8 bytes or less, in two segments
_PUMP_S: Final = 0.001
_SDO_BYTES: Final = 8  # CiA 301: every SDO frame has eight bytes
_INITIATE: Final = (0x20, 0x40)  # requests whose answer names its object: download and upload initiate


class SetupNetwork(canopen.Network):  # type: ignore[misc]  # canopen is not typed
    """canopen's Network on a `CanPort`. `time_s` is the set-up's own time: it moves while a response is awaited."""

    def __init__(self, port: CanPort) -> None:
        self.port = port
        self.time_s = 0.0
        super().__init__()

    def subscribe(self, can_id: int, callback: Callable[[int, bytes, float], None]) -> None:
        super().subscribe(can_id, callback)
        self.port.listen(can_id, callback)

    def unsubscribe(self, can_id: int, callback: Callable[[int, bytes, float], None] | None = None) -> None:
        for gone in [callback] if callback else list(self.subscribers[can_id]):
            self.port.ignore(can_id, gone)
        super().unsubscribe(can_id, callback)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self.port.send(can_id, bytes(data), self.time_s)

    def pump(self) -> None:
        """Take in what has arrived; waits up to a millisecond on a real bus, passes one on a simulated bus."""
        self.time_s += _PUMP_S
        self.port.poll(self.time_s, _PUMP_S)


class PumpedSdoClient(SdoClient):  # type: ignore[misc]
    """canopen's SDO client, waiting by pumping the port. answers_left: that one transfer may still take."""

    answers_left = 0
    _asked: bytes | None = None  # object of the request, if the answer names it

    def send_request(self, request: bytes) -> None:
        self._asked = bytes(request[1:4]) if request[0] & 0xE0 in _INITIATE else None
        super().send_request(request)

    def read_response(self) -> bytes:
        response = self._next_response()
        # a late answer to an earlier request, or to that of another client
        while self._asked and response[0] & 0xE0 in (0x40, 0x60) and response[1:4] != self._asked:
            response = self._next_response()
        return response

    def upload(self, index: int, subindex: int) -> bytes:
        """As canopen's, but an answer that says its length is never cut to the one in the EDS, which may be wrong."""
        with self.open(index, subindex, buffering=0) as stream:
            data = bytes(stream.read())
        variable = self.od.get_variable(index, subindex)
        return data if stream.size is not None or variable is None else data[: len(variable) // 8]

    def _next_response(self) -> bytes:
        deadline_s = self.network.time_s + RESPONSE_TIMEOUT_S
        while self.responses.empty():
            if self.network.time_s >= deadline_s:
                raise SdoCommunicationError("No SDO response received")
            self.network.pump()
        response: bytes = self.responses.get_nowait()
        self.answers_left -= 1
        if self.answers_left < 0:  # also ends a segmented answer without end
            raise SdoCommunicationError(f"more than {MOST_ANSWERS} answers to one request")
        if len(response) != _SDO_BYTES:
            raise SdoCommunicationError(f"an answer of {len(response)} bytes, allowed {_SDO_BYTES}")
        if response[0] == 0x80:
            raise SdoAbortedError(struct.unpack_from("<L", response, 4)[0])
        return response
