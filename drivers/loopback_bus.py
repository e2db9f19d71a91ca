"""python-can's `udp_multicast` bus on the loopback interface alone: simulated devices in other processes of this PC.

python-can itself binds all addresses of the PC and joins the group on its network, where anybody can send frames, and
a datagram that is no frame is an error of the bus. The datagrams are python-can's here, too.

Whoever may run a program on this PC can send on this bus: it carries simulated devices, never a drive.
"""

import ipaddress
import select
import socket
from typing import Final

import can
from can.interfaces.udp_multicast.utils import pack_message, unpack_message

PORT: Final = 43113  # as python-can's
_LOOPBACK: Final = socket.inet_aton("127.0.0.1")
_IP_MULTICAST_ALL: Final = 49  # linux/in.h; 0: memberships of other sockets are none of this one
_MOST_BYTES: Final = 4096  # as python-can's


class DamagedData(can.CanError):  # type: ignore[misc]  # python-can is not typed here
    """Received data that is no CAN frame."""


class LoopbackBus(can.BusABC):  # type: ignore[misc]
    """Bus of the processes of this PC that open the same group. `open_loopback` makes one."""

    def __init__(self, group: str, connection: socket.socket) -> None:
        self.channel_info = f"udp_multicast:{group}"
        self._address, self._socket = (group, PORT), connection
        super().__init__(channel=group)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        try:
            self._socket.sendto(pack_message(msg), self._address)
        except OSError as error:
            raise can.CanOperationError(str(error)) from error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """Raise DamagedData for a datagram that is no frame."""
        if not select.select([self._socket], [], [], timeout)[0]:
            return None, False
        data = self._socket.recv(_MOST_BYTES)
        try:
            return unpack_message(data, check=True), False
        except Exception as error:  # msgpack and python-can raise many kinds
            raise DamagedData(f"{len(data)} bytes that are no CAN frame") from error

    def fileno(self) -> int:
        return self._socket.fileno()

    def shutdown(self) -> None:
        super().shutdown()
        self._socket.close()


def open_loopback(group: str) -> LoopbackBus:
    """Open a bus. Raises ValueError for a group that is no IPv4 multicast address, OSError without loopback."""
    if not ipaddress.IPv4Address(group).is_multicast:
        raise ValueError(f"{group} is no multicast address")
    connection = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        connection.setblocking(False)  # the loop never waits for a buffer
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        connection.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + _LOOPBACK)
        connection.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _LOOPBACK)
        connection.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        connection.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
        connection.bind((group, PORT))  # the group's address: nothing that is sent to an address of this PC
    except OSError:
        connection.close()
        raise
    return LoopbackBus(group, connection)
