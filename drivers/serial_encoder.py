"""A linear encoder on a serial line (pyserial), read without blocking. Frames: see `drivers.serial_frames`."""

import os
import stat
from dataclasses import dataclass
from enum import StrEnum

import serial

from drivers.counting import Unwrapper
from drivers.port import Condition, Encoder, EncoderError, EncoderSample
from drivers.serial_frames import AsciiParser, BinaryParser, Parser, Reading


class SerialFormat(StrEnum):
    """Format of the frames."""

    BINARY = "binary"
    ASCII = "ascii"


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """Settings of the line. step_m: of one count (binary), and the resolution of the counts of a read-out."""

    device: str
    baudrate: int = 921_600
    format: SerialFormat = SerialFormat.BINARY
    step_m: float = 0.5e-6
    reversed: bool = False
    bits: int = 64  # width of the device's counter, for its wrap-around (binary)
    latency_s: float = 0.0  # from the measurement to the arrival; subtracted from the time stamp
    missed_reads_allowed: int = 10  # reads in a row without a new position before it counts as stale


class SerialEncoder(Encoder):
    """Linear encoder on a serial line. Raises EncoderError if the device cannot be opened."""

    def __init__(self, settings: SerialSettings) -> None:
        self.settings = settings
        self._parser: Parser = BinaryParser() if settings.format is SerialFormat.BINARY else AsciiParser()
        self._unwrapper = Unwrapper(1 << settings.bits)
        self._started = False
        self._sign = -1 if settings.reversed else 1
        self._age = 0
        self._errors_seen = 0
        self._sequence: int | None = None
        self.lost_frames = 0
        self._sample = EncoderSample(0.0, 0, 0.0, 0, Condition.LATE)
        self._line_lost = False
        try:
            self._line = serial.Serial(settings.device, settings.baudrate, timeout=0)
        except (OSError, ValueError) as error:
            raise EncoderError(
                f"cannot be opened ({error})", where=f"serial line {settings.device}",
                given=f"{settings.baudrate} baud",
                advice="Check the name of the device, your rights (group dialout) and its plug.",
            ) from error  # fmt: skip

    @property
    def checksum_errors(self) -> int:
        """Number of invalid frames or lines since the line was opened."""
        return self._parser.errors

    def set_up(self) -> None:
        """Do nothing: the line is open and the device sends by itself."""

    def read(self, now_s: float) -> EncoderSample:
        """Process received bytes; return the newest position with its fault bits. Never raises, never waits."""
        readings = self._parser.feed(self._receive())
        self._age += 1
        alarm = False
        for reading in readings:
            self._count_lost(reading)
            alarm = not reading.valid
            if reading.valid:
                self._take(reading, now_s)
        condition = Condition.OK
        if self._age:
            condition |= Condition.LATE
        if self._age > self.settings.missed_reads_allowed:
            condition |= Condition.STALE
        if self._parser.errors != self._errors_seen:
            self._errors_seen = self._parser.errors
            condition |= Condition.CORRUPT
        if alarm:
            condition |= Condition.ALARM
        if self._line_lost:
            condition |= Condition.LINE_LOST
        self._sample = self._sample._replace(age_cycles=self._age, condition=condition)
        return self._sample

    def _take(self, reading: Reading, now_s: float) -> None:
        step_m, unwrapper = self.settings.step_m, self._unwrapper
        if reading.counts is not None:
            if not self._started:
                unwrapper.restart(reading.counts)
            counts = self._sign * unwrapper.update(reading.counts)
            position_m = counts * step_m
        else:
            assert reading.position_m is not None
            position_m = self._sign * reading.position_m
            counts = round(position_m / step_m)
        self._started = True
        self._age = 0
        self._sample = EncoderSample(now_s - self.settings.latency_s, 0, position_m, counts, Condition.OK)

    def _count_lost(self, reading: Reading) -> None:
        if reading.sequence is None:
            return
        if self._sequence is not None:
            self.lost_frames += (reading.sequence - self._sequence - 1) & 0xFF
        self._sequence = reading.sequence

    def _receive(self) -> bytes:
        """Return all received bytes. After the line is unplugged some drivers raise, others return b"" without end."""
        if self._line_lost:
            return b""
        try:
            data: bytes = self._line.read(4096)
            if not data and self._age and self._age % 64 == 0 and self._vanished():
                self._line_lost = True
        except (OSError, serial.SerialException, TypeError):  # TypeError: pyserial on a closed descriptor
            self._line_lost = True
            return b""
        return data

    def _vanished(self) -> bool:
        """Return True if the device file is gone or another one."""
        try:
            there, ours = os.stat(self.settings.device), os.fstat(self._line.fileno())
        except OSError:
            return True
        return not stat.S_ISCHR(there.st_mode) or there.st_rdev != ours.st_rdev

    def check(self) -> None:
        """Raise EncoderError if the sample read last cannot be trusted."""
        bad = self._sample.condition & (Condition.STALE | Condition.ALARM | Condition.LINE_LOST)
        if bad:
            names = " | ".join(str(flag.name) for flag in Condition if flag in bad)
            raise EncoderError(
                names, where=f"serial line {self.settings.device}", given=f"{self._age} reads without a position",
                allowed=str(self.settings.missed_reads_allowed), advice="Check the plug, the supply and the baud rate.",
            )  # fmt: skip

    def close(self) -> None:
        """Close the line."""
        self._line.close()
