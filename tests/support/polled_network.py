"""A python-can bus for a slave of durand, polled by its owner instead of durand's Notifier thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import can
from durand.network import NetworkABC


class PolledNetwork(NetworkABC):
    """The bus. alive: False is a device without power; takes: may keep a frame from durand."""

    def __init__(self, bus: can.BusABC, answers_sdo_s: float) -> None:
        self.bus, self.alive, self.now_s = bus, True, 0.0
        self._answers_sdo_s = answers_sdo_s
        self.callbacks: dict[int, Callable[[int, bytes], None]] = {}
        self.takes: Callable[[int, bytes], bool] = lambda can_id, data: True
        self._later: list[tuple[float, can.Message]] = []

    def add_subscription(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        self.callbacks[cob_id] = callback

    def remove_subscription(self, cob_id: int, callback: Any = None) -> None:
        self.callbacks.pop(cob_id, None)

    def send(self, cob_id: int, msg: bytes) -> None:
        message = can.Message(arbitration_id=cob_id, data=msg, is_extended_id=False)
        if self._answers_sdo_s and cob_id & 0x780 == 0x580:
            self._later.append((self.now_s + self._answers_sdo_s, message))
        elif self.alive:
            self.bus.send(message)

    def receive(self) -> None:
        """Take in what has arrived; send what is due."""
        while (message := self.bus.recv(0.0)) is not None:
            can_id, data = message.arbitration_id, bytes(message.data)
            if self.alive and self.takes(can_id, data) and can_id in self.callbacks:
                self.callbacks[can_id](can_id, data)
        due = [message for due_s, message in self._later if due_s <= self.now_s]
        self._later = [entry for entry in self._later if entry[0] > self.now_s]
        for message in due:
            self.bus.send(message)
