"""Frames of linear encoders on a serial line: binary with CRC, and ASCII read-outs. Pure parsers that resynchronise.

Binary frame, 16 bytes, little-endian:

    0..1   0xAA 0x55
    2      sequence number, +1 per frame modulo 256
    3      status, 0: valid position
    4..11  position in counts, INTEGER64
    12..13 time since the frame before in us, UNSIGNED16, 65535: longer or unknown
    14..15 CRC-16 over bytes 2..13: polynomial 0x1021 (x^16 + x^12 + x^5 + 1), start 0xFFFF, not reflected,
           no final inversion (CRC-16/IBM-3740; check value of "123456789": 0x29B1), low byte first

ASCII read-out, one line per position: optional sign, digits with a decimal point, optional unit (mm, um, m, in), line
feed with or without carriage return, as in "+00012.3456 mm\\r\\n". Without a unit: mm.
"""

import re
from binascii import crc_hqx
from struct import Struct
from typing import Final, NamedTuple, Protocol

MARK: Final = b"\xaa\x55"
SIZE: Final = 16
_BODY: Final = Struct("<BBqH")
_LINE: Final = re.compile(rb"\s*([+-]?) *(\d{1,12}(?:\.\d{1,9})?) *(mm|um|m|in)?\s*", re.IGNORECASE)
_METRES: Final = {b"": 1e-3, b"mm": 1e-3, b"um": 1e-6, b"m": 1.0, b"in": 0.0254}
_LONGEST_LINE: Final = 64


def crc16(data: bytes) -> int:
    """CRC-16/IBM-3740 (CCITT polynomial 0x1021, start 0xFFFF)."""
    return crc_hqx(data, 0xFFFF)


class Reading(NamedTuple):
    """A position. counts: None from a read-out; position_m: None from a binary frame (its step is not in it)."""

    counts: int | None
    position_m: float | None
    sequence: int | None
    valid: bool
    elapsed_us: int | None


class Parser(Protocol):
    """Parser from bytes to readings; counts errors and discarded bytes."""

    errors: int
    discarded_bytes: int

    def feed(self, data: bytes) -> list[Reading]: ...


def encode_frame(counts: int, sequence: int, status: int = 0, elapsed_us: int = 0xFFFF) -> bytes:
    """Return a binary frame."""
    body = _BODY.pack(sequence & 0xFF, status, counts, elapsed_us)
    return MARK + body + crc16(body).to_bytes(2, "little")


def encode_line(position_m: float) -> bytes:
    """Return an ASCII read-out in mm with 0.1 um."""
    return f"{position_m * 1e3:+011.4f} mm\r\n".encode()


class BinaryParser:
    """errors: frames with a wrong CRC; discarded_bytes: bytes outside valid frames."""

    def __init__(self) -> None:
        self.errors = 0
        self.discarded_bytes = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Reading]:
        """Readings completed by these bytes. After a wrong CRC the search continues at the next byte."""
        buffer = self._buffer
        buffer += data
        readings: list[Reading] = []
        while True:
            start = buffer.find(MARK)
            if start < 0:
                keep = 1 if buffer[-1:] == MARK[:1] else 0  # the mark may be cut in two
                self._discard(len(buffer) - keep)
                return readings
            self._discard(start)
            if len(buffer) < SIZE:
                return readings
            body = bytes(buffer[2:14])
            if crc16(body) != buffer[14] | buffer[15] << 8:
                self.errors += 1
                self._discard(1)
                continue
            sequence, status, counts, elapsed_us = _BODY.unpack(body)
            readings.append(Reading(counts, None, sequence, status == 0, None if elapsed_us == 0xFFFF else elapsed_us))
            del buffer[:SIZE]

    def _discard(self, count: int) -> None:
        self.discarded_bytes += count
        del self._buffer[:count]


class AsciiParser:
    """errors: lines that are no read-out, except a cut first one. discarded_bytes: theirs."""

    def __init__(self) -> None:
        self.errors = 0
        self.discarded_bytes = 0
        self._buffer = bytearray()
        self._synchronised = False

    def feed(self, data: bytes) -> list[Reading]:
        """Return the readings completed by these bytes."""
        self._buffer += data
        *lines, rest = self._buffer.split(b"\n")
        readings: list[Reading] = []
        for line in lines:
            match = _LINE.fullmatch(line)
            if match is None or not self._synchronised:
                # Before the first line feed a number may lack its first digits and still be valid (12.3456 -> 2.3456).
                self.errors += self._synchronised and bool(line.strip())
                self.discarded_bytes += len(line) + 1
                self._synchronised = True
                continue
            sign, digits, unit = match.groups(b"")
            value = float(digits) * _METRES[unit.lower()]
            readings.append(Reading(None, -value if sign == b"-" else value, None, True, None))
        if len(rest) > _LONGEST_LINE:
            self.errors += 1
            self.discarded_bytes += len(rest)
            self._synchronised = False
            rest = bytearray()
        self._buffer = bytearray(rest)
        return readings
