"""The master's part of CANopen in the loop: SYNC, its own heartbeat, NMT commands, polling the bus.

SYNC and heartbeat are sent by the loop itself, never by `send_periodic`: on socketcan that runs in the kernel and
would continue to serve the drive's watchdog if this process hangs.
"""

from typing import Final

from drivers.bus import BusHealth, CanPort
from drivers.sdo_client import SetupNetwork

SYNC: Final = 0x080
NMT_START: Final = 1
NMT_STOP: Final = 2
NMT_PRE_OPERATIONAL: Final = 128
NMT_RESET_NODE: Final = 129
CONSUMED_HEARTBEATS: Final = 3  # a consumer misses a heartbeat after so many of its periods without one
_OPERATIONAL: Final = b"\x05"
_NO_HEARTBEAT_AWAITED: Final = bytes.fromhex("2316100100000000")  # SDO download of 0 to 0x1016:01, CiA 301


class CanopenMaster:
    """CANopen master on a port; drives and encoders of the bus share it.

    node_id: of the master, for its heartbeat. heartbeat_s: its period, of which consumers await
    CONSUMED_HEARTBEATS.
    """

    __slots__ = ("_heartbeat_due_s", "_heartbeat_id", "_send", "health", "heartbeat_s", "network", "node_id",
                 "poll", "port", "silent", "sync_time_s", "syncs")  # fmt: skip

    def __init__(self, port: CanPort, *, node_id: int = 1, heartbeat_s: float = 0.02) -> None:
        self.port, self.node_id, self.heartbeat_s = port, node_id, heartbeat_s
        self.network = SetupNetwork(port)
        self.poll = port.poll
        self._send = port.send
        self._heartbeat_id = 0x700 + node_id
        self._heartbeat_due_s = 0.0
        self.health: BusHealth = port.health
        self.silent = False  # after `cut_off`: SYNC, heartbeat and set-points are withheld
        self.syncs = 0  # SYNCs sent; samples count their age by it
        self.sync_time_s = 0.0  # when the last one was sent

    def nmt(self, command: int, node_id: int = 0, now_s: float | None = None) -> None:
        """NMT command to one node, 0: to all."""
        self.port.send(0x000, bytes([command, node_id]), self.network.time_s if now_s is None else now_s)

    def start(self, now_s: float) -> None:
        """Set all nodes operational and send the first heartbeat; from now on call `sync` every period."""
        self.silent = False
        self.nmt(NMT_START, now_s=now_s)
        self._heartbeat_due_s = now_s + self.heartbeat_s
        self.beat(now_s)

    def beat(self, now_s: float) -> None:
        """Send a heartbeat."""
        self._send(self._heartbeat_id, _OPERATIONAL, now_s)

    def sync(self, now_s: float) -> None:
        """Heartbeat when due, then SYNC. After `cut_off` NMT stop instead, in case it was lost before."""
        if self.silent:
            self.syncs += 1
            self.nmt(NMT_STOP, now_s=now_s)
            return
        if now_s >= self._heartbeat_due_s:
            self._heartbeat_due_s += self.heartbeat_s
            if self._heartbeat_due_s <= now_s:  # after a pause of the loop: do not send the missed heartbeats
                self._heartbeat_due_s = now_s + self.heartbeat_s
            self.beat(now_s)
        self.syncs += 1
        self.sync_time_s = now_s
        self._send(SYNC, b"", now_s)

    def release(self, node_id: int) -> None:
        """Leave a drive whose power is off: without PDOs and without awaiting the heartbeat, which would trip it."""
        self.nmt(NMT_PRE_OPERATIONAL, node_id, self.sync_time_s)
        self._send(0x600 + node_id, _NO_HEARTBEAT_AWAITED, self.sync_time_s)

    def cut_off(self, now_s: float) -> None:
        """Withhold SYNC, heartbeat and set-points until `start`, and stop all nodes by NMT.

        For a drive that does not follow its controlword: losing the master is what its own watchdogs react to (0x1016,
        0x1400:5), and entering NMT stopped is an event of its abort connection option code (0x6007, CiA 402-2).
        """
        self.silent = True
        self.nmt(NMT_STOP, now_s=now_s)
