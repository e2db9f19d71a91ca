"""A process that only listens to a CAN bus and writes every frame with python-can's own writer (BLF, ASC, candump log).

    python -m drivers.bus_logger INTERFACE CHANNEL BITRATE FILE

It says "ready" on its standard output when it listens, and ends when its standard input ends, so also with the program
that started it. It shares nothing with that program: a slow disk delays the log alone.
"""

import os
import select
import socket
import sys
import time
from pathlib import Path
from typing import Final

import can

from drivers.bus import BusConfig, open_bus
from drivers.loopback_bus import DamagedData
from drivers.port import BusError

ENDINGS: Final = (".blf", ".asc", ".log")
READY: Final = "ready"
_SO_RCVBUFFORCE: Final = 33  # linux/socket.h
_BUFFER_BYTES: Final = 16_000_000  # seconds of a full bus of 1 Mbit/s
_WAIT_S: Final = 0.05  # for a frame, before the standard input is looked at
_QUIET_S: Final = 0.2  # without a frame, after which a log that is to end is complete


def log(bus: can.BusABC, path: Path) -> int:
    """Write frames until the standard input ends and the bus is quiet. Returns how many."""
    frames, ending, heard_s = 0, False, time.monotonic()
    with can.Logger(path) as writer:
        print(READY, flush=True)
        while True:
            try:
                frame = bus.recv(_WAIT_S)
            except DamagedData:
                continue
            if frame is not None:
                if not frame.timestamp:  # a bus of this PC, whose frames have none
                    frame.timestamp = time.monotonic()  # only differences count
                writer.on_message_received(frame)
                frames, heard_s = frames + 1, time.monotonic()
            if not ending and (frame is None or frames % 100 == 0):
                ending = bool(select.select([sys.stdin], [], [], 0.0)[0]) and not sys.stdin.read(1)
                until_s = time.monotonic() + 10 * _QUIET_S  # others may go on sending
            if ending and (time.monotonic() - heard_s > _QUIET_S or time.monotonic() > until_s):
                return frames


def widen(bus: can.BusABC) -> None:
    """Let the kernel keep frames while this process does not run: without, those of 50 ms on a loaded machine."""
    with socket.socket(fileno=os.dup(bus.fileno())) as same:
        try:
            same.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER_BYTES)
        except PermissionError:  # without CAP_NET_ADMIN up to net.core.rmem_max
            same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)


def main(interface: str, channel: str, bitrate: str, name: str) -> int:
    """Open the bus and log it; an error is one line on standard error."""
    try:
        bus = open_bus(BusConfig(interface, channel, int(bitrate)))
        with bus:
            widen(bus)
            log(bus, Path(name))
    except (BusError, OSError, can.CanError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
