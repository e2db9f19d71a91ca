"""Simulated serial encoder on a pseudo-terminal: table position of a plant as binary frames or ASCII read-outs.

The caller sends each position with `send`. For fault injection, `put` sends any bytes (garbage, cut frames) and
`vanish` removes the line.
"""

import os

from drivers.port import PlantLike
from drivers.serial_encoder import SerialFormat
from drivers.serial_frames import encode_frame, encode_line


class SimulatedSerialEncoder:
    """Serial encoder on `device`, the path for a `SerialEncoder` to open."""

    def __init__(
        self, plant: PlantLike, *, step_m: float = 0.5e-6, format: SerialFormat = SerialFormat.BINARY, bits: int = 64
    ) -> None:
        import tty  # POSIX only; without a serial line the simulated axis runs elsewhere too

        self.plant, self._step_m, self._format = plant, step_m, format
        self._half = 1 << (bits - 1)
        self._sequence = 0
        self._last_s: float | None = None
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)

    def send(self, now_s: float, *, status: int = 0) -> None:
        """Send a frame; status other than 0: position not valid."""
        self.put(self.frame(now_s, status))

    def frame(self, now_s: float, status: int = 0) -> bytes:
        """The bytes of the next frame."""
        position_m = self.plant.table_position_m
        if self._format is SerialFormat.ASCII:
            return encode_line(position_m)
        counts = round(position_m / self._step_m)
        counts = (counts + self._half) % (2 * self._half) - self._half
        elapsed_us = 0xFFFF if self._last_s is None else min(round((now_s - self._last_s) * 1e6), 0xFFFF)
        self._last_s = now_s
        self._sequence = (self._sequence + 1) & 0xFF
        return encode_frame(counts, self._sequence, status, elapsed_us)

    def put(self, data: bytes) -> None:
        """Send any bytes; they are lost if the buffer of the line is full."""
        try:
            os.write(self._master, data)
        except BlockingIOError:
            return

    def vanish(self) -> None:
        """Close both ends, as when the plug is pulled."""
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    close = vanish
