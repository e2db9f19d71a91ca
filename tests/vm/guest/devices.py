"""Simulated drive and linear encoder of a bench as a process of their own on its CAN interface, in wall-clock time.

A file in memory gets what only the axis knows, at every look at the bus: others read it meanwhile, and it outlives the
process. Columns as `COLUMNS`; the first row holds the number of rows.
"""

from __future__ import annotations

import ctypes
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from drivers.bus import BusConfig, PythonCanPort, open_bus
from drivers.port import BusError
from drivers.sim.node import serve
from hil.bench.hardware import DriveSection
from hil.loop.simulated_bench import SimulatedNodes, load_simulated

COLUMNS = ("monotonic_s", "state", "velocity_m_s", "position_m")
MOST_ROWS = 500_000  # five minutes at 250 Hz, each SYNC and each answer a row
PRIORITY = 60  # SCHED_FIFO: a device keeps its time, whatever the computer does
_LOCK_ALL = 7  # MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT: reserved memory that is never used takes none


class DevicePort(PythonCanPort):
    """Port of a device, which does not end when the computer's interface does: there it would hear nothing."""

    def poll(self, now_s: float, timeout_s: float = 0.0) -> None:
        try:
            super().poll(now_s, timeout_s)
        except BusError:
            time.sleep(timeout_s)


class Truth:
    """Writes the axis and the drive's state; served as a device, after the drive."""

    def __init__(self, nodes: SimulatedNodes, path: Path) -> None:
        self._drive, self._plant, self._written = nodes.drive, nodes.plant, 0
        self._rows: npt.NDArray[np.float64] = np.memmap(path, np.float64, "w+", shape=(MOST_ROWS + 1, len(COLUMNS)))

    def tick(self, now_s: float) -> None:
        """Add a row."""
        if self._written == MOST_ROWS:
            return
        self._written += 1
        velocity_m_s = float(self._plant.velocities_m_s[-1])  # type: ignore[attr-defined]
        self._rows[self._written] = (time.monotonic(), self._drive.state, velocity_m_s, self._plant.table_position_m)
        self._rows[0, 0] = self._written


def truth(path: Path) -> npt.NDArray[np.float64]:
    """Return the rows written so far."""
    rows = np.memmap(path, np.float64, "r").reshape(-1, len(COLUMNS))
    return np.array(rows[1 : 1 + int(rows[0, 0])])


def serve_bench(path: Path, log: Path, ready: Callable[[], None]) -> None:
    """Serve the devices of a bench until killed; calls `ready` when they are on the bus."""
    bench = load_simulated(path)
    section = bench.drive or DriveSection()
    port = DevicePort(open_bus(BusConfig(section.interface, section.channel, section.bitrate)))
    nodes = SimulatedNodes(bench, port, seed=1)
    nodes.plant.advance(0.0, bench.gains.period_s)  # compiled before the bus is served
    served: list[Any] = [node for node in (nodes.drive, nodes.encoder) if node is not None]
    served.append(Truth(nodes, log))
    os.sched_setaffinity(0, {0})
    ctypes.CDLL(None).mlockall(_LOCK_ALL)
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    ready()
    serve(port, served, threading.Event())
