"""The SDO client on a port: answers that it takes, skips or refuses, and how long it waits."""

from __future__ import annotations

import pytest
from drive_rig import in_process

from drivers.inprocess import InProcessBus, InProcessPort
from drivers.port import ConfigurationError, ResponseTimeout
from drivers.sdo_client import SetupNetwork
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup

EDS = EDS_FOLDER / "servo_drive.eds"
VENDOR = bytes.fromhex("43 18 10 01")  # upload of 0x1018:1, expedited, four bytes


class Server:
    """Answers each request to node 5 by given frames."""

    def __init__(self, *answers: bytes) -> None:
        bus = InProcessBus()
        self.port, self.network = bus.port(), SetupNetwork(bus.port())
        self.requests: list[bytes] = []
        self.answers = answers
        self.port.listen(0x605, self.on_request)

    def on_request(self, can_id: int, data: bytes, now_s: float) -> None:
        self.requests.append(data)
        for answer in self.answers:
            self.port.send(0x585, answer, now_s)

    def read(self) -> int:
        with DeviceSetup(self.network, 5, EDS) as device:
            return device.read(0x1018, 1)


def test_an_expedited_answer_is_read() -> None:
    server = Server(VENDOR + b"\x07\x00\x00\x80")
    assert server.read() == 0x80000007
    assert server.requests == [bytes.fromhex("40 18 10 01 00 00 00 00")]


@pytest.mark.parametrize("late", ["43 18 10 02 01 00 00 00", "60 18 10 02 00 00 00 00", "43 00 10 01 01 00 00 00"])
def test_an_answer_that_names_another_object_is_skipped(late: str) -> None:
    assert Server(bytes.fromhex(late), VENDOR + b"\x07\0\0\0").read() == 7


def test_a_request_is_answered_within_half_a_second_or_never() -> None:
    server = Server()
    server.network.time_s = 3.25
    with pytest.raises(ResponseTimeout, match=r"0x1018:01 \(.*\): no SDO answer; given: 0.5 s"):
        server.read()
    assert server.network.time_s == pytest.approx(3.75, abs=0.0011)


@pytest.mark.parametrize("size", [0, 7])
def test_a_short_answer_is_none(size: int) -> None:
    with pytest.raises(ResponseTimeout, match=rf"no usable SDO answer \(an answer of {size} bytes, allowed 8\)"):
        Server((VENDOR + bytes(4))[:size]).read()


def test_answers_without_end_are_refused() -> None:
    with pytest.raises(ResponseTimeout, match=r"more than 16 answers to one request"):
        Server(*[bytes.fromhex("43 18 10 02 01 00 00 00")] * 17).read()
    assert Server(*[bytes.fromhex("43 18 10 02 01 00 00 00")] * 15, VENDOR + b"\x07\0\0\0").read() == 7


def test_a_refusal_is_told_with_its_code() -> None:
    with pytest.raises(ConfigurationError, match=r"the device refuses \(Code 0x06090011, Subindex does not exist\)"):
        Server(bytes.fromhex("80 18 10 01 11 00 09 06")).read()


def test_who_unsubscribes_hears_nothing_any_more() -> None:
    bus = InProcessBus()
    network, other = SetupNetwork(bus.port()), bus.port()
    heard: list[str] = []
    listeners = [lambda *frame, name=name: heard.append(name) for name in "abc"]
    for listener in listeners:
        network.subscribe(0x700, listener)
    network.unsubscribe(0x700, listeners[1])
    send(other)
    assert heard == ["a", "c"]
    network.unsubscribe(0x700)
    send(other)
    assert heard == ["a", "c"]


def send(port: InProcessPort) -> None:
    port.send(0x700, b"\x05", 0.0)


def test_the_time_of_the_set_up_goes_on_by_a_millisecond_while_an_answer_is_awaited() -> None:
    rig = in_process()
    times: list[float] = []
    rig.master.network.port = type("Port", (), {"poll": lambda self, now_s, wait_s: times.append((now_s, wait_s))})()
    rig.master.network.pump()
    rig.master.network.pump()
    assert times == [(0.001, 0.001), (0.002, 0.001)]
