"""A run in virtual time over a modelled bus whose rig is kept, for faults of drive and bus."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench_runs import MOVING, Ran, run

from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from hil.loop.devices import Rig
from hil.loop.session import Session
from hil.recording.recording import read_recording

MANY = 1_000_000


class FaultyBench:
    """A run whose rig is kept, and the plant's true motion, whatever the run ends with."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.bus = folder, ModelledBus()
        self.rig: Rig | None = None

    def run(self, bench: Any, events: Callable[[Rig, Session], dict[int, Callable[[], Any]]]) -> Ran:
        def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
            self.rig = rig
            return events(rig, session)

        return run(self.folder, bench, script=script, bus=self.bus)

    def lose(self, can_id: int) -> None:
        self.bus.inject(Fault(FaultKind.DROP, can_id, count=MANY))

    @property
    def ended(self) -> str:
        return read_recording(self.folder / "run.parquet").metadata["ended"]

    @property
    def travelled_m(self) -> float:
        """Way of the table from the recording's row MOVING to the end of everything."""
        recording = read_recording(self.folder / "run.parquet")
        return abs(self.rig.nodes.plant.table_position_m - recording["table_position_m"][MOVING])

    def speed_m_s(self) -> float:
        """Mean speed of the table over the next 100 periods of the drive's own clock."""
        drive, plant = self.rig.nodes.drive, self.rig.nodes.plant
        before_m = plant.table_position_m
        for _ in range(100):
            drive._move(0.0)
        return abs(plant.table_position_m - before_m) / 0.1
