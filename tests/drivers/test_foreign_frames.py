"""Frames and data that CANopen does not have are counted and not acted on, on every python-can bus."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator
from pathlib import Path

import can
import msgpack
import pytest
from drive_rig import Rig
from hypothesis import given
from hypothesis import strategies as st

from drivers.bus import BusConfig, BusHealth, PumpedPort, PythonCanPort, open_bus
from drivers.inprocess import AsBusABC, InProcessBus
from drivers.loopback_bus import PORT
from drivers.port import BusError, Condition

GROUP = "239.74.163.79"
TPDO, EMCY, HEARTBEAT, BUS_OFF = 0x185, 0x085, 0x705, 0x040
KINDS = {
    "29-bit identifier": {"is_extended_id": True},
    "remote frame": {"is_remote_frame": True, "is_extended_id": False},
    "error frame": {"is_error_frame": True, "is_extended_id": False},
    "CAN FD": {"is_fd": True, "is_extended_id": False},
}


@pytest.fixture(params=["virtual", "udp_multicast"])
def config(request: pytest.FixtureRequest) -> BusConfig:
    return BusConfig(request.param, GROUP)


def frame(kind: str, can_id: int, data: bytes) -> can.Message:
    remote = kind == "remote frame"
    return can.Message(arbitration_id=can_id, data=None if remote else data, dlc=len(data), **KINDS[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_of_another_kind_reaches_no_listener(config: BusConfig, kind: str) -> None:
    port, sender = PythonCanPort(open_bus(config)), open_bus(config)
    heard: list[int] = []
    port.listen(None, lambda can_id, data, now_s: heard.append(can_id))
    for can_id in (TPDO, EMCY, HEARTBEAT, BUS_OFF):
        port.listen(can_id, lambda can_id, data, now_s: heard.append(can_id))
        sender.send(frame(kind, can_id, b"\x10\x23\x01\0\0\0\0\0"))
    sender.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
    while not heard:
        port.poll(0.0, 0.1)
    assert heard == [0x7FF]
    assert port.health == BusHealth(foreign={kind: 4})
    port.close()
    sender.shutdown()


@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_is_not_read_from_another_kind_of_frame(kind: str) -> None:
    config = BusConfig("virtual", "test_foreign")
    near, far, sender = PythonCanPort(open_bus(config)), PythonCanPort(open_bus(config)), open_bus(config)

    rig = Rig(PumpedPort(near, far), far)
    rig.set_up()
    rig.enable()
    samples = []
    for _ in range(20):
        for can_id, data in ((TPDO, b"\xff" * 8), (EMCY, b"\x10\x23" + bytes(6)), (HEARTBEAT, b"\x7f")):
            sender.send(frame(kind, can_id, data))
        samples.append(rig.cycle())
    assert all(sample.enabled and sample.condition is Condition.OK for sample in samples)
    assert all(abs(sample.motor_position_rad) < 1e-3 for sample in samples)
    assert rig.drive.emergencies == []
    assert near.health.foreign == {kind: 60}
    near.close()
    far.close()
    sender.shutdown()


def test_a_flood_does_not_hold_the_loop() -> None:
    config = BusConfig("virtual", "test_flood")
    port, sender = PythonCanPort(open_bus(config)), open_bus(config)
    for _ in range(2500):
        sender.send(frame("29-bit identifier", TPDO, bytes(8)))
    counts = []
    for _ in range(4):
        port.poll(0.0)
        counts.append(port.health.foreign.total())
    assert counts == [1000, 2000, 2500, 2500]
    port.close()
    sender.shutdown()


def test_canopens_own_network_does_not_send_them_either() -> None:
    bus = InProcessBus()
    as_bus = AsBusABC(bus.port())
    with pytest.raises(can.CanOperationError, match="29-bit identifier"):
        as_bus.send(frame("29-bit identifier", TPDO, bytes(8)))
    as_bus.shutdown()


# -- udp_multicast ----------------------------------------------------------------------------------------------------


@pytest.fixture
def loopback() -> Iterator[tuple[PythonCanPort, socket.socket]]:
    """A port, and a socket that sends datagrams to its group on loopback."""
    port = PythonCanPort(open_bus(BusConfig("udp_multicast", GROUP)))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        yield port, sender
    port.close()


MESSAGE = {"arbitration_id": TPDO, "is_extended_id": False, "dlc": 8, "data": bytes(8)}
DAMAGED = st.one_of(
    st.binary(max_size=100).filter(lambda data: not data.startswith((b"\x80", b"\xde", b"\xdf"))),  # empty: a frame
    st.integers(1, len(msgpack.packb(MESSAGE)) - 1).map(lambda cut: msgpack.packb(MESSAGE)[:cut]),
    st.sampled_from([{"dlc": 9}, {"arbitration_id": -1}, {"arbitration_id": "0x185"}, {"dlc": 3}, {"colour": 1},
                     {"data": 10**18}, {"arbitration_id": 0x800}]).map(lambda part: msgpack.packb(MESSAGE | part)),
)  # fmt: skip


def test_datagrams_that_are_no_frame_are_counted(loopback: tuple[PythonCanPort, socket.socket]) -> None:
    port, sender = loopback
    heard: list[bytes] = []
    port.listen(TPDO, lambda can_id, data, now_s: heard.append(data))

    @given(DAMAGED)
    def send(data: bytes) -> None:
        heard.clear()
        port.health.foreign.clear()
        sender.sendto(data, (GROUP, PORT))
        sender.sendto(msgpack.packb(MESSAGE), (GROUP, PORT))
        while not heard:
            port.poll(0.0, 0.1)
        assert heard == [bytes(8)]
        assert port.health == BusHealth(foreign={"no CAN frame": 1})

    send()


def test_nothing_from_outside_of_loopback_is_heard(loopback: tuple[PythonCanPort, socket.socket]) -> None:
    port, sender = loopback
    heard: list[bytes] = []
    port.listen(None, lambda can_id, data, now_s: heard.append(data))
    own = {family[4][0] for family in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outside,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as member,  # of another program, on the network
    ):
        with contextlib.suppress(OSError):
            group = socket.inet_aton(GROUP) + socket.inet_aton("0.0.0.0")
            member.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        for address in {"127.0.0.1", GROUP} | own:  # the group: by the route of the network, if there is one
            try:
                outside.sendto(msgpack.packb(MESSAGE), (address, PORT))
            except OSError:
                assert address == GROUP
    sender.sendto(msgpack.packb(MESSAGE | {"data": b"loopback"}), (GROUP, PORT))
    while not heard:
        port.poll(0.0, 0.1)
    assert heard == [b"loopback"]
    assert port.health.foreign == {}


def test_a_socket_on_another_group_hears_nothing(loopback: tuple[PythonCanPort, socket.socket]) -> None:
    port, _ = loopback
    other = PythonCanPort(open_bus(BusConfig("udp_multicast", "239.74.163.80")))
    heard: list[bytes] = []
    port.listen(None, lambda can_id, data, now_s: heard.append(data))
    other.send(TPDO, b"another", 0.0)
    port.send(TPDO, b"own", 0.0)
    while not heard:
        port.poll(0.0, 0.1)
    assert heard == [b"own"]
    other.close()


@pytest.mark.parametrize("channel", ["hil", "192.168.1.5", "ff15::1", ""])
def test_a_channel_that_is_no_group_is_refused(channel: str) -> None:
    with pytest.raises(BusError, match=r"cannot be opened.*allowed: an IPv4 multicast address, 224\.0\.0\.0 to 239"):
        open_bus(BusConfig("udp_multicast", channel))


def test_no_other_module_receives_from_a_bus() -> None:
    folder = Path(__file__).parents[2] / "drivers"
    assert [path.name for path in folder.rglob("*.py") if "_bus.recv(" in path.read_text()] == ["bus.py"]
