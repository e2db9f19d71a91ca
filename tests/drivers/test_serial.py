"""Serial encoders: the parsers on any bytes, and the reader on a real pseudo-terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from drive_rig import Mass
from hypothesis import given
from hypothesis import strategies as st
from processes import wait_for

from drivers.port import Condition, EncoderError, EncoderSample
from drivers.serial_encoder import SerialEncoder, SerialFormat, SerialSettings
from drivers.serial_frames import AsciiParser, BinaryParser, Parser, Reading, crc16, encode_frame, encode_line
from drivers.sim.serial_line import SimulatedSerialEncoder

COUNTS = st.integers(-(1 << 63), (1 << 63) - 1)
CLEAN = st.binary(max_size=40).filter(lambda junk: b"\xaa" not in junk)


def test_checksum_is_the_documented_one() -> None:
    assert crc16(b"123456789") == 0x29B1


def feed_in_pieces(parser: Parser, stream: bytes, cuts: list[int]) -> list[Reading]:
    edges = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    return [r for a, b in pairwise(edges) for r in parser.feed(stream[a:b])]


@given(st.lists(st.tuples(CLEAN, COUNTS, st.integers(0, 255)), max_size=8), st.lists(st.integers(0, 500), max_size=20))
def test_every_frame_is_found_between_garbage_however_it_is_cut(
    items: list[tuple[bytes, int, int]], cuts: list[int]
) -> None:
    stream = b"".join(junk + encode_frame(counts, sequence) for junk, counts, sequence in items)
    parser = BinaryParser()
    readings = feed_in_pieces(parser, stream, cuts)
    assert [(r.counts, r.sequence) for r in readings] == [(counts, sequence) for _, counts, sequence in items]
    assert parser.discarded_bytes == sum(len(junk) for junk, _, _ in items)
    assert parser.errors == 0


@given(COUNTS, st.integers(0, 15), st.integers(1, 255))
def test_a_changed_byte_is_never_a_position_and_the_next_frame_is_found(counts: int, at: int, change: int) -> None:
    broken = bytearray(encode_frame(counts, 7))
    broken[at] ^= change
    parser = BinaryParser()
    readings = parser.feed(bytes(broken) + encode_frame(42, 8) + encode_frame(43, 9))
    assert [r.counts for r in readings] == [42, 43]


def test_a_wrong_checksum_is_one_error() -> None:
    parser = BinaryParser()
    wrong = encode_frame(41, 7)[:-1] + bytes([encode_frame(41, 7)[-1] ^ 1])
    assert [r.counts for r in parser.feed(wrong + encode_frame(42, 8))] == [42]
    assert (parser.errors, parser.discarded_bytes) == (1, 16)


@given(st.integers(1, 15), COUNTS)
def test_a_cut_frame_costs_itself_only(length: int, counts: int) -> None:
    parser = BinaryParser()
    readings = parser.feed(encode_frame(counts, 1)[:length] + encode_frame(5, 2) + encode_frame(6, 3))
    assert [r.counts for r in readings] == [5, 6]


@given(st.binary(max_size=300), st.lists(st.integers(0, 300), max_size=10))
def test_no_bytes_stop_the_parsers(stream: bytes, cuts: list[int]) -> None:
    binary, ascii_ = BinaryParser(), AsciiParser()
    for reading in feed_in_pieces(ascii_, stream, cuts):
        assert reading.position_m is not None
        assert math.isfinite(reading.position_m)
    found = feed_in_pieces(binary, stream, cuts)
    assert len(found) * 16 + binary.discarded_bytes <= len(stream)


TENTHS_UM = st.integers(-999_999_999, 999_999_999)


@given(st.lists(TENTHS_UM, min_size=1, max_size=10), st.lists(st.integers(0, 300), max_size=9))
def test_read_outs_survive(tenths_um: list[int], cuts: list[int]) -> None:
    parser = AsciiParser()
    stream = b"\n" + b"".join(encode_line(value * 1e-7) for value in tenths_um)
    readings = feed_in_pieces(parser, stream, cuts)
    assert [round(1e7 * (r.position_m or 0.0)) for r in readings] == tenths_um


@pytest.mark.parametrize(
    ("line", "position_m"),
    [
        (b"+00012.3456 mm\r\n", 0.0123456),
        (b"-1.5\n", -0.0015),
        (b"  250 um \r\n", 0.00025),
        (b"0.125 M\n", 0.125),
        (b"- 1.0 in\r\n", -0.0254),
    ],
)
def test_read_outs_of_different_devices(line: bytes, position_m: float) -> None:
    assert AsciiParser().feed(b"\n" + line)[0].position_m == pytest.approx(position_m)


def test_broken_lines_are_counted_and_the_first_one_is_never_believed() -> None:
    parser = AsciiParser()
    readings = parser.feed(b"2.3456 mm\r\n+12.34x6 mm\r\n1.0 mm\r\n12.34\xff56 mm\r\n" + b"7" * 100)
    assert [r.position_m for r in readings] == [pytest.approx(0.001)]  # not 2.3456: it may be the end of 12.3456
    assert parser.errors == 3
    assert [r.position_m for r in parser.feed(b"777\n2.0 mm\n")] == [pytest.approx(0.002)]


@pytest.mark.parametrize(("data", "discarded"), [(b"abc", 3), (b"\xff", 1), (b"ab\xaa", 2), (b"\xaa", 0), (b"", 0)])
def test_bytes_outside_of_frames_go_at_once_but_for_half_a_mark(data: bytes, discarded: int) -> None:
    parser = BinaryParser()
    assert parser.feed(data) == []
    assert parser.discarded_bytes == discarded
    assert len(parser.feed(encode_frame(1, 1))) == 1
    assert parser.discarded_bytes == len(data)


@pytest.mark.parametrize(("elapsed_us", "told"), [(0, 0), (1234, 1234), (0xFFFE, 0xFFFE), (0xFFFF, None)])
@pytest.mark.parametrize("status", [0, 1, 255])
def test_status_and_elapsed_time_of_a_frame(elapsed_us: int, told: int | None, status: int) -> None:
    (reading,) = BinaryParser().feed(encode_frame(-7, 255, status, elapsed_us))
    assert reading == (-7, None, 255, status == 0, told)


def test_a_frame_says_nothing_of_elapsed_time_or_an_alarm_by_itself() -> None:
    assert BinaryParser().feed(encode_frame(-7, 255)) == [(-7, None, 255, True, None)]


# -- on a pseudo-terminal ---------------------------------------------------------------------------------------------


class Line:
    """A simulated encoder and its reader. The kernel carries the bytes over in its own time: `read` waits for them."""

    def __init__(self, format: SerialFormat = SerialFormat.BINARY, *, bits: int = 32, reversed: bool = False) -> None:
        self.plant = Mass(lead_m=2 * math.pi)  # table position = motor position
        self.simulated = SimulatedSerialEncoder(self.plant, format=format, bits=bits)
        self.reader = SerialEncoder(SerialSettings(self.simulated.device, format=format, bits=bits, reversed=reversed))
        self.underway = 0

    def put(self, data: bytes) -> None:
        self.simulated.put(data)
        self.underway += len(data)

    def send(self, now_s: float, status: int = 0) -> None:
        self.put(self.simulated.frame(now_s, status))

    def read(self, now_s: float) -> EncoderSample:
        wait_for(lambda: self.reader._line.in_waiting >= self.underway, step_s=0.0001)
        self.underway = 0
        return self.reader.read(now_s)

    def close(self) -> None:
        self.reader.close()
        self.simulated.close()


@pytest.fixture(params=list(SerialFormat))
def line(request: pytest.FixtureRequest) -> Iterator[Line]:
    line = Line(request.param)
    line.put(b"\n")
    yield line
    line.close()


def test_positions_arrive_with_their_time(line: Line) -> None:
    for k in range(1, 200):
        line.plant.motor_position_rad = 1e-3 * math.sin(k / 10)
        line.send(k * 1e-3)
        sample = line.read(k * 1e-3)
        assert sample.position_m == pytest.approx(line.plant.motor_position_rad, abs=0.3e-6)
        assert (sample.time_s, sample.age_cycles, sample.condition) == (k * 1e-3, 0, Condition.OK)
    line.reader.check()
    assert line.reader.lost_frames == 0


@pytest.mark.parametrize(("read_out", "counts"), [(b"1.2 um\n", 2), (b"1.3 um\n", 3), (b"-1.3 um\n", -3)])
def test_the_counts_of_a_read_out_are_the_nearest(read_out: bytes, counts: int) -> None:
    line = Line(SerialFormat.ASCII)  # a count is 0.5 um
    line.put(b"\n" + read_out)
    assert line.read(0.0).counts == counts
    line.close()


def test_reading_never_waits_and_an_old_position_says_so(line: Line) -> None:
    line.send(0.0)
    line.read(0.0)
    conditions = [line.reader.read(k * 1e-3).condition for k in range(1, 13)]
    assert conditions[:10] == [Condition.LATE] * 10
    assert conditions[10:] == [Condition.LATE | Condition.STALE] * 2
    with pytest.raises(EncoderError, match=r"serial line /dev/.*: STALE; given: 12 reads without a position"):
        line.reader.check()


def test_garbage_and_cut_frames_are_counted_and_survived(line: Line) -> None:
    line.send(0.0)
    line.read(0.0)
    line.put(b"\x00garbage\xff\n" + line.simulated.frame(0.001)[:9])
    line.plant.motor_position_rad = 0.5
    line.put(b"\n")
    line.send(0.002)
    line.send(0.003)
    sample = line.read(0.003)
    assert sample.position_m == pytest.approx(0.5, abs=1e-6)
    assert sample.condition is Condition.CORRUPT
    assert line.reader.checksum_errors >= 1
    assert line.reader.read(0.004).condition is Condition.LATE


@pytest.mark.parametrize("hang_up", [True, False])
def test_a_vanished_line_is_noticed(line: Line, hang_up: bool) -> None:
    line.send(0.0)
    line.read(0.0)
    if hang_up:
        line.simulated.vanish()
    conditions = [line.reader.read(k * 1e-3).condition for k in range(1, 140)]
    assert bool(conditions[-1] & Condition.LINE_LOST) is hang_up
    assert conditions[-1] & Condition.STALE


def test_before_the_first_position_the_sample_is_late_at_zero(line: Line) -> None:
    assert line.reader.read(0.5) == EncoderSample(0.0, 1, 0.0, 0, Condition.LATE)


@pytest.mark.parametrize("older_first", [True, False])
def test_another_device_under_the_same_name_is_no_line_any_more(tmp_path: Path, older_first: bool) -> None:
    plants = [SimulatedSerialEncoder(Mass(), format=SerialFormat.BINARY, bits=32) for _ in range(2)]
    first, second = plants if older_first else plants[::-1]
    name = tmp_path / "encoder"
    name.symlink_to(first.device)
    reader = SerialEncoder(SerialSettings(str(name)))
    assert not any(reader.read(k * 1e-3).condition & Condition.LINE_LOST for k in range(140))
    name.unlink()
    name.symlink_to(second.device)
    conditions = [reader.read(0.2 + k * 1e-3).condition for k in range(140)]
    assert conditions[-1] & Condition.LINE_LOST
    reader.close()
    for plant in plants:
        plant.close()


def test_a_position_is_as_old_as_its_transmission_takes() -> None:
    line = Line()
    line.reader.settings = replace(line.reader.settings, latency_s=0.25)
    line.send(1.0)
    assert line.read(1.0).time_s == 0.75
    line.close()


def test_binary_wrap_direction_alarm_and_lost_frames() -> None:
    line = Line(bits=16, reversed=True)  # 65 536 counts are 32.8 mm
    for k in range(300):
        line.plant.motor_position_rad = k * 1e-3
        line.send(k * 1e-3)
        assert line.read(k * 1e-3).position_m == pytest.approx(-k * 1e-3, abs=1e-6)
    line.simulated.frame(0.3)
    line.simulated.frame(0.301)
    line.send(0.302)
    line.read(0.302)
    assert line.reader.lost_frames == 2
    line.plant.motor_position_rad = 0.9
    line.send(0.303, status=1)
    sample = line.read(0.303)
    assert sample.condition == Condition.LATE | Condition.ALARM
    assert sample.position_m == pytest.approx(-0.299, abs=1e-6)
    line.close()


def test_a_line_that_is_not_there_says_what_to_do() -> None:
    with pytest.raises(EncoderError, match=r"serial line /dev/none: cannot be opened.*dialout"):
        SerialEncoder(SerialSettings("/dev/none"))
