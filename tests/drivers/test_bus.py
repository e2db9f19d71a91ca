"""Ports: in-process, python-can, modelled; all three carry the same frames."""

from __future__ import annotations

import time
from collections.abc import Iterator
from copy import deepcopy
from itertools import pairwise

import can
import pytest

from drivers.bus import BusConfig, BusState, CanPort, DataFrame, PumpedPort, PythonCanPort, foreign_kind, open_bus
from drivers.inprocess import AsBusABC, InProcessBus
from drivers.loopback_bus import DamagedData
from drivers.modelled_bus import Fault, FaultKind, ModelledBus, frame_bits
from drivers.port import BusError

Seen = list[tuple[int, bytes, float]]


@pytest.fixture(params=["in-process", "modelled", "virtual"])
def ports(request: pytest.FixtureRequest) -> Iterator[tuple[CanPort, CanPort]]:
    if request.param == "virtual":
        pair = [PythonCanPort(open_bus(BusConfig("virtual", "test_bus"))) for _ in range(2)]
    else:
        bus = InProcessBus() if request.param == "in-process" else ModelledBus(None)
        pair = [bus.port(), bus.port()]
    yield pair[0], pair[1]
    for port in pair:
        port.close()


def record(port: CanPort, can_id: int | None) -> Seen:
    seen: Seen = []
    port.listen(can_id, lambda *frame: seen.append(frame))
    return seen


def test_a_frame_reaches_who_listens_and_not_its_sender(ports: tuple[CanPort, CanPort]) -> None:
    a, b = ports
    own, right, other, everything = record(a, 0x123), record(b, 0x123), record(b, 0x124), record(b, None)
    a.send(0x123, b"\x01\x02", 2.5)
    b.poll(2.5)
    a.poll(2.5)
    assert right == everything == [(0x123, b"\x01\x02", 2.5)]
    assert own == other == []


def test_frames_keep_their_order_and_listeners_can_leave(ports: tuple[CanPort, CanPort]) -> None:
    a, b = ports
    seen: Seen = []

    def listener(*frame: object) -> None:
        seen.append(frame)  # type: ignore[arg-type]

    b.listen(0x10, listener)
    for k in range(20):
        a.send(0x10, bytes([k]), 0.0)
    b.poll(0.0)
    b.ignore(0x10, listener)
    a.send(0x10, b"late", 0.0)
    b.poll(0.0)
    assert [frame[1][0] for frame in seen] == list(range(20))


def test_an_answer_given_inside_the_listener_arrives(ports: tuple[CanPort, CanPort]) -> None:
    a, b = ports
    b.listen(0x80, lambda can_id, data, now_s: b.send(0x185, b"answer", now_s))
    seen = record(a, 0x185)
    a.send(0x80, b"", 1.0)
    b.poll(1.0)
    a.poll(1.0)
    assert seen == [(0x185, b"answer", 1.0)]


def test_pumped_port_serves_the_far_end_without_a_thread() -> None:
    near, far = (PythonCanPort(open_bus(BusConfig("virtual", "test_pump"))) for _ in range(2))
    far.listen(0x80, lambda can_id, data, now_s: far.send(0x185, b"\x07", now_s))
    port = PumpedPort(near, far)
    seen = record(port, 0x185)
    port.send(0x80, b"", 0.0)
    port.poll(0.0)
    assert seen == [(0x185, b"\x07", 0.0)]
    port.close()
    far.close()


def test_an_in_process_port_is_a_python_can_bus_where_one_is_wanted() -> None:
    bus = InProcessBus()
    as_bus, port = AsBusABC(bus.port()), bus.port()
    seen = record(port, 0x321)
    as_bus.send(can.Message(arbitration_id=0x321, data=b"\x05", is_extended_id=False))
    assert [frame[:2] for frame in seen] == [(0x321, b"\x05")]
    port.send(0x322, b"\x06", 4.0)
    message = as_bus.recv(0)
    assert message is not None
    assert (message.arbitration_id, bytes(message.data), message.timestamp) == (0x322, b"\x06", 4.0)
    assert foreign_kind(message) == ""
    assert as_bus.recv(0) is None
    as_bus.set_filters([{"can_id": 0x324, "can_mask": 0x7FF}])
    for can_id in (0x323, 0x324):
        port.send(can_id, b"", 5.0)
    filtered = as_bus.recv(0.1)
    assert filtered is not None
    assert filtered.arbitration_id == 0x324
    as_bus.shutdown()


def test_a_frame_that_arrives_while_somebody_waits_for_one_is_taken() -> None:
    """On a modelled bus nothing arrives until the next look at the time."""
    bus, times = ModelledBus(1_000_000), iter([0.0, 1.0])
    as_bus = AsBusABC(bus.port(), lambda: next(times))
    bus.port().send(0x321, b"", 0.0)
    began_s = time.monotonic()
    message = as_bus.recv(None)
    assert message is not None
    assert message.arbitration_id == 0x321
    assert time.monotonic() - began_s < 1.0  # it looks every 5 ms
    as_bus.shutdown()


# -- error frames of a real controller, as socketcan reports them (linux/can/error.h) ---------------------------------


class ErrorSource(can.BusABC):
    """A python-can bus that delivers given messages."""

    def __init__(self, messages: list[can.Message]) -> None:
        self.messages = messages
        super().__init__(channel=None)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("transmit buffer full")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.messages.pop(0) if self.messages else None), True


def error_frame(error_class: int, detail: int = 0) -> can.Message:
    return can.Message(arbitration_id=error_class, is_error_frame=True, data=bytes([0, detail, 0, 0, 0, 0, 0, 0]))


def test_the_states_of_a_controller_differ() -> None:
    assert [state.name for state in BusState] == ["ACTIVE", "PASSIVE", "OFF"]


@pytest.mark.parametrize(
    ("error_class", "text"),
    [
        (0x001, "transmit time-out"), (0x002, "arbitration lost"), (0x004, "controller problem"),
        (0x008, "protocol violation"), (0x010, "transceiver"), (0x020, "no acknowledge"), (0x040, "bus off"),
        (0x080, "bus error"), (0x100, "restarted"), (0x200, "error frame"), (0x0A0, "no acknowledge, bus error"),
    ],
)  # fmt: skip
def test_error_classes_are_told_in_words(error_class: int, text: str) -> None:
    port = PythonCanPort(ErrorSource([error_frame(error_class)]))
    port.poll(0.0)
    assert port.health.last_error == text


@pytest.mark.parametrize("data", [b"", b"\x00"])
def test_an_error_frame_without_its_detail_changes_no_state(data: bytes) -> None:
    port = PythonCanPort(ErrorSource([can.Message(arbitration_id=0x004, is_error_frame=True, data=data)]))
    port.poll(0.0)
    assert port.health.state is BusState.ACTIVE
    assert port.health.error_frames == 1


@pytest.mark.parametrize(
    ("frames", "state"),
    [
        ([error_frame(0x080)], BusState.ACTIVE),
        ([error_frame(0x004, 0x20)], BusState.PASSIVE),
        ([error_frame(0x004, 0x10)], BusState.PASSIVE),
        ([error_frame(0x004, 0x01)], BusState.ACTIVE),  # overflow of a buffer, and warnings
        ([error_frame(0x004, 0x0E)], BusState.ACTIVE),
        ([error_frame(0x004, 0x10), error_frame(0x004, 0x40)], BusState.ACTIVE),
        ([error_frame(0x040)], BusState.OFF),
        ([error_frame(0x040), error_frame(0x100)], BusState.ACTIVE),
    ],
)
def test_error_frames_are_visible(frames: list[can.Message], state: BusState) -> None:
    count = len(frames)
    port = PythonCanPort(ErrorSource(frames))
    port.poll(0.0)
    assert port.health.state is state
    assert port.health.error_frames == count
    assert port.health.last_error


def test_what_follows_damaged_data_is_heard_at_the_same_poll() -> None:
    class Damaged(ErrorSource):
        """Its first data is no frame."""

        damaged = True

        def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
            if self.damaged:
                self.damaged = False
                raise DamagedData
            return super()._recv_internal(timeout)

    port = PythonCanPort(Damaged([can.Message(arbitration_id=0x185, is_extended_id=False)]))
    seen = record(port, 0x185)
    port.poll(0.0)
    assert len(seen) == 1
    assert port.health.foreign == {"no CAN frame": 1}


def test_a_frame_that_cannot_be_sent_is_counted_and_does_not_stop_the_loop() -> None:
    port = PythonCanPort(ErrorSource([]))
    port.send(0x80, b"", 0.0)
    assert port.health.frames_lost == 1
    assert "transmit buffer full" in port.health.last_error


def test_opening_what_is_not_there_says_what_to_do() -> None:
    with pytest.raises(BusError, match=r"bus floppy:a: unknown interface.*virtual, udp_multicast, socketcan"):
        open_bus(BusConfig("floppy", "a"))
    with pytest.raises(BusError, match=r"bus socketcan:can_none: cannot be opened.*ip link set"):
        open_bus(BusConfig("socketcan", "can_none"))


# -- modelled bus ----------------------------------------------------------------------------------------------------


def test_frame_length_with_the_longest_stuffing() -> None:
    assert [frame_bits(n) for n in (0, 8)] == [55, 135]  # ISO 11898-1: 47 and 111 bits without stuffing


def test_frames_take_their_time_and_the_lowest_identifier_goes_first() -> None:
    bus = ModelledBus(1_000_000)
    a, b, c = bus.port(), bus.port(), bus.port()
    seen = record(c, None)
    a.send(0x300, bytes(8), 0.0)  # has the bus
    a.send(0x200, bytes(8), 10e-6)
    b.send(0x100, bytes(8), 20e-6)
    c.poll(1.0)
    assert [frame[0] for frame in seen] == [0x300, 0x100, 0x200]
    assert [frame[2] for frame in seen] == pytest.approx([135e-6, 270e-6, 405e-6])


def test_nothing_arrives_before_its_bits_have_passed() -> None:
    bus = ModelledBus(500_000)
    a, b = bus.port(), bus.port()
    seen = record(b, 0x80)
    a.send(0x80, b"", 0.0)
    b.poll(109e-6)
    assert seen == []
    b.poll(111e-6)
    assert len(seen) == 1


def test_load_is_bits_over_time() -> None:
    bus = ModelledBus(1_000_000)
    a = bus.port()
    for k in range(100):
        a.send(0x80, b"", k * 1e-3)
        a.send(0x205, bytes(4), k * 1e-3)
    a.poll(0.1)
    assert bus.load() == pytest.approx(100 * (frame_bits(0) + frame_bits(4)) * 1e-6 / 0.1)
    a.poll(0.2)
    assert bus.load() == 0.0
    assert bus.load() == 0.0  # over no time


@pytest.mark.parametrize(
    ("fault", "arrives"),
    [
        (Fault(FaultKind.DROP, 0x10, first=1, count=2), [0, 3, 4]),
        (Fault(FaultKind.DROP, 0x99), [0, 1, 2, 3, 4]),
        (Fault(FaultKind.DROP), [1, 2, 3, 4]),
        (Fault(FaultKind.CORRUPT, 0x10, first=2), [0, 1, 0xFD, 3, 4]),
        (Fault(FaultKind.BUS_OFF, 0x10, first=3), [0, 1, 2]),
        (Fault(FaultKind.ERROR_FRAME, 0x10, first=1), [0, 1, 2, 3, 4]),
        (Fault(FaultKind.DELAY, 0x10, first=0, delay_s=2.5), [1, 2, 0, 3, 4]),
    ],
)
def test_a_fault_befalls_the_chosen_frames_only(fault: Fault, arrives: list[int]) -> None:
    bus = ModelledBus(None)
    a, b = bus.port(), bus.port()
    seen = record(b, 0x10)
    bus.inject(fault)
    for k in range(5):
        a.send(0x10, bytes([k]), float(k))
    b.poll(10.0)
    assert [frame[1][0] for frame in seen] == arrives


def test_truncated_frame_is_one_byte_short() -> None:
    bus = ModelledBus(None)
    a, b = bus.port(), bus.port()
    seen = record(b, 0x10)
    bus.inject(Fault(FaultKind.TRUNCATE, 0x10))
    a.send(0x10, b"abcd", 0.0)
    assert [frame[1] for frame in seen] == [b"abc"]


def test_errors_drive_a_controller_passive_then_off_and_recovery_brings_it_back() -> None:
    bus = ModelledBus(1_000_000)
    a, b = bus.port(), bus.port()
    seen = record(b, 0x10)
    bus.inject(Fault(FaultKind.ERROR_FRAME, 0x10, count=32))
    states = []
    for k in range(40):
        a.send(0x10, bytes([k]), k * 1e-3)
        states.append(a.health.state)
    assert states == sorted(states)
    assert set(states) == {BusState.ACTIVE, BusState.PASSIVE, BusState.OFF}
    assert a.health.frames_lost > 0
    assert b.health.error_frames >= 32
    a.recover()
    before = len(seen)
    a.send(0x10, b"\xff", 1.0)
    b.poll(1.1)
    assert a.health.state is BusState.ACTIVE
    assert seen[before:][-1][1] == b"\xff"


def test_the_limits_of_a_controller_are_those_of_iso_11898() -> None:
    """Eight per error, one less per success: passive above 127, off above 255, and from zero on after a recovery."""
    port = ModelledBus().port()
    for _ in range(2):
        states = []
        for _ in range(32):
            port.failed()
            states.append(port.health.state)
        assert states == [BusState.ACTIVE] * 15 + [BusState.PASSIVE] * 16 + [BusState.OFF]
        port.recover()
    for _ in range(16):
        port.failed()
    port.sent()
    assert port.health.state is BusState.ACTIVE


def test_the_modelled_bus_is_deterministic() -> None:
    def run() -> Seen:
        bus = ModelledBus(250_000)
        ports = [bus.port() for _ in range(4)]
        seen = record(ports[0], None)
        bus.inject(Fault(FaultKind.DELAY, 0x102, first=3, count=5, delay_s=1e-3))
        for k in range(200):
            ports[1 + k % 3].send(0x100 + k % 7, bytes(k % 9), k * 1e-4)
            ports[0].poll(k * 1e-4)
        ports[0].poll(1.0)
        return seen

    first = run()
    assert len(first) == 200
    assert first == run()
    assert all(a[2] <= b[2] for a, b in pairwise(first))


def test_the_copy_of_a_frame_equals_it_and_shares_no_data() -> None:
    frame = DataFrame(arbitration_id=0x181, data=b"\1\2", is_extended_id=False)
    copied = deepcopy(frame)
    assert copied.equals(frame, timestamp_delta=None)
    copied.data[0] = 9
    assert bytes(frame.data) == b"\1\2"
