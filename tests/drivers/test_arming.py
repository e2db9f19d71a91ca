"""Arming: why a drive is not enabled, which objects are read meanwhile, how long its transitions take."""

from __future__ import annotations

import struct

import pytest

from drivers.cia402 import DriveState, OperationMode
from drivers.cia402_arming import Arming, LoopReader, hindrances, mode_name
from drivers.inprocess import InProcessBus

CODE, HELD, SHOWN = 0x603F, 0x6040, 0x6061
CST = OperationMode.CYCLIC_SYNC_TORQUE
READY, ENABLED, DISABLED = 0x0231, 0x0237, 0x0270  # statuswords with voltage, remote and quick stop as they should be


@pytest.mark.parametrize(
    ("statusword", "sent", "mode", "read", "found"),
    [
        (READY, 0x07, None, {}, []),
        (READY, 0x07, CST, {HELD: 0x07, CODE: 0, SHOWN: 0}, []),
        (0x0201, 0, None, {}, ["CiA 402 does not define this state"]),
        (0x0210, 0, None, {}, ["the drive still initialises"]),
        (0x0218, 0, None, {}, ["the drive has a fault, which must be reset"]),
        (0x021F, 0, None, {}, ["the drive has a fault, which must be reset"]),
        (READY, 0x07, None, {CODE: 0x3220}, ["error code (object 0x603F) 0x3220 DC link under-voltage"]),
        (READY & ~0x200, 0x07, None, {},
         ["remote (statusword bit 9) is 0: the drive does not obey the bus; give the bus the control"]),
        *((word & ~0x10, 0x07, None, {}, ["no main voltage (statusword bit 4 is 0)"])
          for word in (DISABLED, READY, 0x0233)),
        (ENABLED & ~0x10, 0x0F, None, {}, []),
        (READY | 0x80, 0x07, None, {}, ["a warning is active (statusword bit 7)"]),
        (READY | 0x800, 0x07, None, {},
         ["an internal limit is active (statusword bit 11): limit switch, travel, speed or torque"]),
        (READY, 0x07, None, {HELD: 0x0107},
         ["halt (controlword bit 8) is set in the drive, not by this program: is there a second master?"]),
        (READY, 0x0107, None, {HELD: 0x0107}, []),
        *((READY, 0x07, None, {HELD: held},
           [f"the drive holds controlword 0x{held:04X}, sent is 0x0007: its RPDO does not act"]) for held in (6, 15)),
        (ENABLED, 0x0F, CST, {SHOWN: 9}, ["the mode display (object 0x6061) reads 9 (CYCLIC_SYNC_VELOCITY), "
                                          "commanded is 10 (CYCLIC_SYNC_TORQUE)"]),
        (ENABLED, 0x0F, CST, {}, ["the mode display (object 0x6061) reads nothing, commanded is 10 "
                                  "(CYCLIC_SYNC_TORQUE)"]),
        *((word, 0x06, None, {}, ["quick stop (statusword bit 5 is 0), by an input of the drive or its commissioning "
                                  "tool"]) for word in (DISABLED & ~0x20, 0x0217)),
        (DISABLED & ~0x30, 0x06, None, {}, ["no main voltage (statusword bit 4 is 0)"]),
    ],
)  # fmt: skip
def test_hindrances_in_words(
    statusword: int, sent: int, mode: OperationMode | None, read: dict[int, int], found: list[str]
) -> None:
    assert hindrances(statusword, sent, mode, read) == found


def test_a_mode_is_told_by_number_and_name() -> None:
    assert [mode_name(mode) for mode in (None, 0, 6, 3)] == ["nothing", "0 (NONE)", "6 (HOMING)", "3"]


class Asked:
    """A reader, the requests that the node got, and its answers."""

    def __init__(self) -> None:
        bus = InProcessBus()
        self.reader, self.node = LoopReader(bus.port(), 5), bus.port()
        self.requests: list[bytes] = []
        self.node.listen(0x605, lambda can_id, data, now_s: self.requests.append(data))

    def ask(self, now_s: float, *indices: int) -> None:
        self.reader.ask(indices, now_s)

    def answer(self, text: str, now_s: float) -> None:
        self.node.send(0x585, bytes.fromhex(text), now_s)


@pytest.mark.parametrize(("text", "value"), [
    ("4f 61 60 00 0a 00 00 00", 10), ("4f 61 60 00 fe 00 00 00", -2), ("4b 61 60 00 02 01 00 00", 0x0102),
    ("47 61 60 00 03 02 01 00", 0x010203), ("43 61 60 00 04 03 02 01", 0x01020304),
])  # fmt: skip
def test_an_expedited_answer_is_read_by_its_size(text: str, value: int) -> None:
    asked = Asked()
    asked.ask(0.0, SHOWN)
    assert asked.requests == [struct.pack("<BHB4x", 0x40, SHOWN, 0)]
    asked.answer(text, 0.001)
    assert asked.reader.values == {SHOWN: value}


@pytest.mark.parametrize("text", [
    "43 3f 60 00 01 00 00 00", "43 61 60 01 01 00 00 00", "43 61 60 00 01 00 00", "41 61 60 00 04 00 00 00",
    "60 61 60 00 00 00 00 00", "c3 61 60 00 01 00 00 00",
])  # fmt: skip
def test_what_is_no_answer_to_the_request_is_not_read_and_ends_nothing(text: str) -> None:
    """Another object or sub-index, a short frame, a segmented answer, the answer to a write, an unknown command."""
    asked = Asked()
    asked.ask(0.0, SHOWN)
    asked.answer(text, 0.001)
    assert asked.reader.values == {}
    asked.ask(0.4, SHOWN)
    assert len(asked.requests) == 1  # the first is still awaited
    asked.ask(0.51, SHOWN)
    assert len(asked.requests) == 2


@pytest.mark.parametrize("text", ["80 3f 60 00 00 00 02 06", "43 3f 60 00 20 32 00 00"])
def test_objects_are_asked_for_in_turn_a_moment_after_an_answer_or_a_refusal(text: str) -> None:
    asked = Asked()
    asked.ask(5.0, SHOWN, CODE)
    asked.answer(text, 5.001)
    asked.ask(5.005, SHOWN, CODE)
    assert len(asked.requests) == 1
    asked.ask(5.0112, SHOWN, CODE)
    assert [int.from_bytes(request[1:3], "little") for request in asked.requests] == [CODE, SHOWN]
    assert asked.reader.values == ({} if text.startswith("80") else {CODE: 0x3220})
    asked.answer(text, 5.012)  # not awaited any more
    asked.reader.begin()
    assert asked.reader.values == {}
    asked.ask(0.0, SHOWN)  # in another time base
    assert len(asked.requests) == 3


def arming() -> tuple[Arming, list[int]]:
    bus = InProcessBus()
    node, indices = bus.port(), []
    node.listen(0x605, lambda can_id, data, now_s: indices.append(int.from_bytes(data[1:3], "little")))
    watched = Arming(bus.port(), 5)
    watched.begin(CST, mode_shown=True)
    return watched, indices


@pytest.mark.parametrize(("stays_ms", "disarm_s"), [(0, 0.0), (100, 0.15), (600, 0.9), (700, 1.0)])
def test_the_slowest_transition_tells_how_long_disarming_may_take(stays_ms: int, disarm_s: float) -> None:
    watched, _ = arming()
    watched.step(DriveState.SWITCH_ON_DISABLED, 1.0)
    watched.step(DriveState.READY_TO_SWITCH_ON, 1.0)
    watched.step(DriveState.READY_TO_SWITCH_ON, 1.0 + 1e-3 * stays_ms)
    watched.step(DriveState.SWITCHED_ON, 1.0 + 1e-3 * stays_ms)
    assert watched.disarm_s == pytest.approx(disarm_s)
    watched.stop()
    watched.step(DriveState.SWITCH_ON_DISABLED, 9.0)  # the time between is no transition
    assert watched.disarm_s == pytest.approx(disarm_s)


def test_a_drive_that_is_armed_at_once_is_asked_nothing() -> None:
    watched, indices = arming()
    watched.step(DriveState.SWITCHED_ON, 2.0)
    watched.step(DriveState.SWITCHED_ON, 2.09)
    assert indices == []
    for now_s in (2.11, 2.62, 3.13):
        watched.step(DriveState.SWITCHED_ON, now_s)
    assert sorted(indices) == [CODE, HELD, SHOWN]


def test_a_mode_that_is_not_shown_is_asked_for_until_it_is() -> None:
    bus = InProcessBus()
    node, shown = bus.port(), 0
    node.listen(0x605, lambda can_id, data, now_s: node.send(0x585, b"\x4f" + data[1:4] + bytes([shown, 0, 0, 0]),
                                                             now_s))  # fmt: skip
    watched = Arming(bus.port(), 5)
    watched.begin(CST, mode_shown=False)
    for shown, right in ((0, False), (10, True)):
        for k in range(3):
            watched.step(DriveState.OPERATION_ENABLED, 1.0 + shown + 0.02 * k)
        assert watched.mode_shown is right


def test_what_hinders_is_one_sentence_with_the_silence_of_the_drive() -> None:
    watched, _ = arming()
    assert watched.hindrances(READY, 0x07, answers=True) == ""
    assert watched.hindrances(READY, 0x07, answers=False) == ": it has answered no SYNC since its set-up"
    watched.begin(CST, mode_shown=False)
    assert watched.hindrances(ENABLED | 0x80, 0x0F, answers=True) == (
        ": a warning is active (statusword bit 7); the mode display (object 0x6061) reads nothing, commanded is 10 "
        "(CYCLIC_SYNC_TORQUE)"
    )
