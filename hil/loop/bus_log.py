"""Log the bus of a bench beside a run: another process listens by a connection of its own (`drivers.bus_logger`)."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drivers.bus_logger import ENDINGS, READY
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveSection
from hil.errors import FieldError, HilError, InputError
from hil.files.input_file import is_file

_BUSES = ("socketcan", "udp_multicast")  # that another process hears
_END_S = 30.0  # for the rest of the log on a slow disk


@contextmanager
def log_bus(bench: Bench, path: Path) -> Iterator[None]:
    """Log all frames, from before the set-up of the devices to the end of the block, into `path`.

    Raises InputError for another ending or a file that exists, FieldError for a bus that stays within this program,
    HilError if the log cannot be begun or was ended by an error.
    """
    section = bench.drive or DriveSection()
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: given the ending {path.suffix!r}, allowed {', '.join(ENDINGS)}; correct it")
    if is_file(path):
        raise InputError(f"{path}: the file exists and is not overwritten; give another name or remove it")
    if section.interface not in _BUSES:
        raise FieldError(
            ("drive", "interface"),
            f"given {section.interface} with a log of the bus, allowed {' or '.join(_BUSES)}: another process writes "
            "it, so that the loop does not wait for the disk; change it or leave --bus-log",
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-P", "-m", "drivers.bus_logger"]
    command += [section.interface, section.channel, str(section.bitrate), str(path)]
    logger = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,  # ctrl-C stops the axis, whose end belongs into the log
    )  # fmt: skip
    assert logger.stdout is not None
    assert logger.stderr is not None
    try:
        if logger.stdout.readline().strip() != READY:
            raise HilError(f"{path}: the bus cannot be logged: {logger.stderr.read().strip()}")
        yield
    finally:
        try:
            _, told = logger.communicate(timeout=_END_S)  # closes its standard input
        except subprocess.TimeoutExpired:
            logger.kill()
            _, told = logger.communicate()
        if logger.returncode and sys.exception() is None:
            raise HilError(f"{path}: the log of the bus is not complete: {told.strip() or 'it had to be ended'}")
