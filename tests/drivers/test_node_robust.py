"""Whatever comes over the bus, the simulated drive answers or ignores it; it never falls over."""

from __future__ import annotations

import math

from drive_rig import Mass
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.cia402 import DriveState, state_of
from drivers.inprocess import InProcessBus
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.sdo_server import AbortCode, SdoAbort, SdoServer
from drivers.sim.servo import DriveServo, Servo

# Requests around what exists: commands of CiA 301 on objects the drive has, with any data.
OBJECTS = st.sampled_from([0x1016, 0x1017, 0x1400, 0x1600, 0x1800, 0x1A00, 0x1A01, 0x6040, 0x6060, 0x6098, 0x60C2])
LIKELY = st.builds(
    lambda command, index, subindex, data: bytes([command]) + index.to_bytes(2, "little") + bytes([subindex]) + data,
    st.sampled_from([0x22, 0x23, 0x27, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x80, 0x21, 0x00, 0x10, 0xC0]),
    OBJECTS, st.integers(0, 6), st.binary(min_size=4, max_size=4),
)  # fmt: skip
NMT = [b"\x01\x05", b"\x01\0", b"\x02\0", b"\x80\0", b"\x81\0", b"\x82\x05", b"\x01\x09", b"\x07"]
FRAMES = st.one_of(
    st.tuples(st.just(0x605), st.one_of(LIKELY, st.binary(max_size=8))),
    st.tuples(st.just(0x000), st.sampled_from(NMT)),
    st.tuples(st.sampled_from([0x080, 0x205, 0x305, 0x701]), st.binary(max_size=8)),
    st.tuples(st.just(0x205), st.sampled_from([6, 7, 15, 2, 0, 128]).map(lambda word: bytes([word, 0]))),
)


@settings(max_examples=300)
@given(st.lists(st.tuples(FRAMES, st.floats(-1, 1)), max_size=40))
def test_any_traffic_leaves_a_defined_state(traffic: list[tuple[tuple[int, bytes], float]]) -> None:
    bus = InProcessBus()
    port = bus.port()
    servo = DriveServo(Servo(), 0.01 / (2 * math.pi))
    node = SimulatedDrive(bus.port(), Mass(), servo=servo)
    answers: list[bytes] = []
    port.listen(0x585, lambda can_id, data, now_s: answers.append(data))
    now_s = 0.0
    for (can_id, data), step_s in traffic:
        now_s += step_s
        port.send(can_id, data, now_s)
    port.send(0x080, b"", now_s)
    assert all(len(answer) == 8 for answer in answers)
    assert state_of(node.values[0x6041_00]) is node.state
    assert node.state is not DriveState.UNKNOWN


@given(st.binary(max_size=64), st.binary(min_size=1, max_size=64))
def test_segmented_transfer_carries_any_bytes(stored: bytes, sent: bytes) -> None:
    memory = {0x2000: stored}
    server = SdoServer(lambda index, sub: memory[index], lambda index, sub, data: memory.__setitem__(index, data))
    for k in range(0, len(sent), 7):  # download by hand, segment by segment
        if k == 0:
            start = server.answer(b"\x21\x00\x20\x00" + len(sent).to_bytes(4, "little"))
            assert start == b"\x60\x00\x20\x00" + bytes(4)
        piece, toggle = sent[k : k + 7], (k // 7 % 2) << 4
        last = k + 7 >= len(sent)
        answer = server.answer(bytes([toggle | (7 - len(piece)) << 1 | last]) + piece.ljust(7, b"\0"))
        assert answer == bytes([0x20 | toggle]) + bytes(7)
    assert memory[0x2000] == sent


def test_wrong_toggle_and_block_transfer_are_aborted() -> None:
    def refuse(index: int, sub: int) -> bytes:
        raise SdoAbort(AbortCode.NO_SUCH_OBJECT)

    server = SdoServer(refuse, lambda index, sub, data: None)
    assert server.answer(b"\x40\x34\x12\x05" + bytes(4)) == b"\x80\x34\x12\x05\x00\x00\x02\x06"
    server.answer(b"\x21\x34\x12\x05\x09\x00\x00\x00")
    assert server.answer(b"\x10" + bytes(7)) == b"\x80\x34\x12\x05\x00\x00\x03\x05"
    assert server.answer(b"\xa0\x34\x12\x05" + bytes(4)) == b"\x80\x34\x12\x05\x01\x00\x04\x05"
    assert server.answer(b"\x80\x34\x12\x05" + bytes(4)) is None
    assert server.answer(b"\x40\x34") is None
