"""Fuzz targets of the devices: EDS files, SDO answers, cyclic frames, bytes of a serial line."""

from __future__ import annotations

import contextlib
import functools
import random
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from mutations import damaged_bytes, damaged_text

from drivers.inprocess import InProcessBus
from drivers.port import DriverError
from drivers.sdo_setup import EDS_FOLDER
from drivers.serial_frames import AsciiParser, BinaryParser, encode_frame, encode_line

sys.path.insert(0, str(Path(__file__).parents[1] / "drivers"))
from drive_rig import Rig

_SERVER_IDS = (0x585, 0x586)  # SDO answers of drive and encoder
_CYCLIC_IDS = (0x185, 0x186, 0x085, 0x086, 0x705, 0x706, 0x585, 0x000, 0x080)


@functools.cache
def _eds() -> str:
    return (EDS_FOLDER / "servo_drive.eds").read_text()


def eds(rng: random.Random, folder: Path) -> None:
    """Set up a drive with a damaged EDS."""
    path = folder / "drive.eds"
    path.write_bytes(damaged_text(rng, _eds()))
    rig = _rig()
    rig.drive.set_up(replace(rig.settings, eds=path))


def sdo(rng: random.Random, folder: Path) -> None:
    """Set up drive and encoder where SDO answers are damaged, lost, repeated, or random."""
    rig, share = _rig(), rng.choice((0.01, 0.05, 0.3))
    for node in (rig.node, rig.encoder_node):
        _disturb(rng, node, share)
    rig.set_up()


def _disturb(rng: random.Random, node: Any, share: float) -> None:
    send = node._send

    def hostile(can_id: int, data: bytes, now_s: float) -> None:
        if can_id not in _SERVER_IDS or rng.random() > share:
            send(can_id, data, now_s)
            return
        way = rng.randrange(5)
        if way == 0:
            send(can_id, damaged_bytes(rng, data)[:8], now_s)
        elif way == 1:
            send(can_id, rng.randbytes(rng.randint(0, 8)), now_s)
        elif way == 2:  # another value
            send(can_id, data[:4] + rng.choice((b"\0" * 4, b"\xff" * 4, b"\0\0\0\x80", rng.randbytes(4))), now_s)
        elif way == 3:
            send(can_id, data, now_s)
            send(can_id, data, now_s)
        elif rng.random() < 0.2:  # a segmented upload of many bytes
            send(can_id, b"\x41" + data[1:4] + b"\xff\xff\xff\x7f", now_s)

    node._send = hostile


def frames(rng: random.Random, folder: Path) -> None:
    """Frames of any length and content between the ticks of an enabled drive."""
    rig = _rig()
    rig.set_up()
    rig.enable()
    other = rig.bus_port
    for _ in range(rng.randint(1, 12)):
        for _ in range(rng.randint(0, 3)):
            other.send(rng.choice(_CYCLIC_IDS), rng.randbytes(rng.randint(0, 8)), rig.now_s)
        sample = rig.cycle(0.0)
        _ = rig.drive.status, rig.drive.error_code, sample.condition
        for check in (rig.drive.check, rig.encoder.check):
            with contextlib.suppress(DriverError):
                check()


def _rig() -> Any:
    bus = InProcessBus()
    rig = Rig(bus.port(), bus.port())
    rig.bus_port = bus.port()
    return rig


def serial(rng: random.Random, folder: Path) -> None:
    """Damaged frames of both kinds, fed in pieces."""
    parser = rng.choice((BinaryParser, AsciiParser))()
    binary = isinstance(parser, BinaryParser)
    good = b"".join(
        encode_frame(rng.randrange(-(2**63), 2**63), k) if binary else encode_line(rng.uniform(-1e3, 1e3))
        for k in range(5)
    )
    data = damaged_bytes(rng, good) if rng.random() < 0.8 else rng.randbytes(rng.randint(0, 3000))
    while data:
        cut = rng.randint(1, 40)
        for reading in parser.feed(data[:cut]):
            _ = reading.valid, reading.position_m, reading.counts
        data = data[cut:]
