"""Input and output of the writers of controller files."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hil.control.cascade import Gains
from hil.control.compensation_tables import Adds, Compensation, CompensationTable
from hil.motion.trajectory import Trajectory


class NotTaken(NamedTuple):
    """A table that a controller cannot take, and why."""

    table: str
    reason: str


@dataclass(frozen=True, eq=False)
class ControllerTask:
    """A compensation with what it was made for; `low_m`, `high_m`: travel [m, rad]; `torque_unit`: N m, N, or V.

    `rated_torque`: object 0x6076 of the drive, None if the bench does not know it.
    """

    name: str
    compensation: Compensation
    gains: Gains
    motion: Trajectory
    low_m: float
    high_m: float
    turns: bool = False
    torque_unit: str = "N m"
    rated_torque: float | None = None

    @property
    def per_unit(self) -> float:
        """Millimetres per metre; degrees per radian where the load turns: the units of CNC controllers."""
        return float(np.degrees(1.0)) if self.turns else 1e3

    @property
    def unit(self) -> str:
        """Name of that unit."""
        return "degree" if self.turns else "mm"

    def tables(self, adds: Adds) -> list[CompensationTable]:
        """Tables that add to the torque, or to the position."""
        return [table for table in self.compensation.tables if table.adds is adds]


@dataclass(frozen=True)
class ControllerFiles:
    """Texts of the files of a controller by the ending of their names, and tables that it cannot take."""

    texts: dict[str, str]
    not_taken: tuple[NotTaken, ...] = ()
