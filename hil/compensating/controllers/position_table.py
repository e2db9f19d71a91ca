"""Tables over angle and position as one table of equidistant points over the travel, as CNC controllers take it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.compensating.controllers.controller_task import ControllerTask, NotTaken
from hil.compensating.shapes import NEAR
from hil.control.compensation_tables import Adds, CompensationTable, Over

USELESS = 0.5  # a table that leaves half of the correction is none
SAME_M = 1e-9  # below this, values are equal: no encoder of a machine tool tells them apart
STEP_M = 1e-9  # points are multiples of it, so that the digits of a file give them exactly
_DENSE = 20_001  # places at which a table is compared with the correction
GOES_BY_REVERSAL = "goes by time or way since a reversal, its tables by position only"


@dataclass(frozen=True, eq=False)
class PositionTable:
    """Correction that is added to the position set-point [m, rad] at points (n,), forward and backward.

    `left`: rms of what the lines between the points leave, as a share of the correction without its mean.
    """

    at: FloatArray
    forward: FloatArray
    backward: FloatArray
    left: float

    @property
    def reversal(self) -> float:
        """Mean of forward less backward: the backlash that a controller takes as one value."""
        return float(np.mean(self.forward - self.backward))

    @property
    def both(self) -> FloatArray:
        """Mean of both directions (n,)."""
        return np.asarray(0.5 * (self.forward + self.backward))

    @property
    def constant(self) -> bool:
        """True if only the direction counts."""
        return bool(np.ptp(self.forward) <= SAME_M and np.ptp(self.backward) <= SAME_M)

    @property
    def one_way(self) -> bool:
        """True if the direction does not count."""
        return bool(np.abs(self.forward - self.backward).max() <= SAME_M)


class OneTable(NamedTuple):
    """The table of a controller, None if there is nothing to correct or no table of it follows; what is left out."""

    table: PositionTable | None
    not_taken: tuple[NotTaken, ...]


def position_table(task: ControllerTask, most: int) -> OneTable:
    """Sum of the tables that add to the position, with as few points as are near enough, `most` at most."""
    wanted = task.tables(Adds.POSITION)
    taken = [table for table in wanted if table.over in (Over.ANGLE, Over.POSITION)]
    left_out = [NotTaken(table.name, GOES_BY_REVERSAL) for table in wanted if table not in taken]
    if not taken:
        return OneTable(None, tuple(left_out))
    dense = np.linspace(task.low_m, task.high_m, _DENSE)
    exact = _sums(task, taken, dense)
    count = 2
    while (found := _through(task, taken, count, dense, exact)).left > NEAR and count < most:
        count = min(2 * count - 1, most)
    if found.left <= USELESS:
        return OneTable(found, tuple(left_out))
    reason = (
        f"changes too fast along the travel for its {most} points; give a --profile and drive.travel_m that are short"
    )
    return OneTable(None, (*left_out, *(NotTaken(table.name, reason) for table in taken)))


def _sums(task: ControllerTask, tables: list[CompensationTable], at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Correction forward and backward at places (n,) [m]."""

    def total(column: str) -> FloatArray:
        result = np.zeros_like(at)
        for table in tables:
            turn = table.over is Over.ANGLE
            over = at * task.compensation.angle_per_m if turn else at
            result += np.interp(over, table.at, getattr(table, column), period=2.0 * np.pi if turn else None)
        return result

    return total("forward"), total("backward")


def _through(
    task: ControllerTask,
    tables: list[CompensationTable],
    count: int,
    dense: FloatArray,
    exact: tuple[FloatArray, FloatArray],
) -> PositionTable:
    low = math.floor(task.low_m / STEP_M) * STEP_M
    at: FloatArray = (
        low + np.arange(count, dtype=np.float64) * math.ceil((task.high_m - low) / (count - 1) / STEP_M) * STEP_M
    )
    columns = _sums(task, tables, at)
    left = [np.interp(dense, at, one) - true for one, true in zip(columns, exact, strict=True)]
    size = float(np.std(exact))
    return PositionTable(at, *columns, float(np.sqrt(np.mean(np.square(left)))) / size if size > 0.0 else 0.0)
