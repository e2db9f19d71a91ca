"""TwinCAT 3: tables of MC_TableBasedPositionCompensation as CSV, and a compensation value list of TwinCAT CNC.

NC PTP: rows Position, Compensation of ST_PositionCompensationTableElement, equidistant, in units of the axis [mm,
degree]. The position correction of NC is added to the actual value and subtracted from the set value of the drive, so
it is minus the correction of the set-point. Where the direction counts there is a file for each direction
(TableParameter.Direction: WorkDirectionPositive, WorkDirectionNegative); both outputs go through one
MC_PositionCorrectionLimiter, as there is one position correction of an axis.

CNC: list of the leadscrew error compensation, in 0.1 um (0.0001 degree); a value is the position error, actual less
set-point, again minus the correction.

Source: Beckhoff Information System: Tc2_MC2, MC_TableBasedPositionCompensation, ST_PositionCompensationTableElement,
MC_PositionCorrectionLimiter ("to be added to the actual value of the axis"), "NC Implementing of the TwinCAT Position
Correction"; TF5200, Axis compensation, kw.ssfk.*, with the example of a compensation value list.
"""

import numpy as np

from hil.arrays import FloatArray
from hil.compensating.controllers.controller_task import ControllerFiles, ControllerTask, NotTaken
from hil.compensating.controllers.position_table import PositionTable, position_table
from hil.control.compensation_tables import Adds

MOST = 1000  # below the 1500 of kw.ssfk.max_points
NO_TORQUE = "a position correction adds no torque; the drive takes it as object 0x60B2 (--for cia402)"


def for_twincat(task: ControllerTask) -> ControllerFiles:
    """Write the CSV of each direction, or one for both, and the list of the CNC."""
    table, left_out = position_table(task, MOST)
    not_taken = (*left_out, *(NotTaken(one.name, NO_TORQUE) for one in task.tables(Adds.TORQUE)))
    if table is None:
        return ControllerFiles({}, not_taken)
    ways = {"both": table.both} if table.one_way else {"positive": table.forward, "negative": table.backward}
    texts = {f"twincat-{way}.csv": _csv(task, table.at, values) for way, values in ways.items()}
    return ControllerFiles(texts | {"twincat-cnc.lis": _list(task, table)}, not_taken)


def _csv(task: ControllerTask, at: FloatArray, correction: FloatArray) -> str:
    columns = (task.per_unit * at, 0.0 - task.per_unit * correction)
    lines = [f"{place:.7f};{value:.7f}" for place, value in zip(*columns, strict=True)]
    return "\n".join(["Position;Compensation", *lines]) + "\n"


def _list(task: ControllerTask, table: PositionTable) -> str:
    """Points are listed one by one (interval 0), in whole units of the list."""
    unit = 1e4 * task.per_unit
    lines = [
        "kopf.log_achs_nr 1",
        f"kopf.log_achs_name {task.name}",
        "kw.ssfk.unit 1",
        "kw.ssfk.interval 0",
        f"kw.ssfk.kw_nr_max {table.at.size}",
        f"kw.ssfk.bilateral {int(not table.one_way)}",
    ]
    columns = {"setpoint": unit * table.at, "pos": -unit * table.forward, "neg": -unit * table.backward}
    for name, values in columns.items():
        lines += [f"kw.ssfk.table[{number}].{name} {value:.0f}" for number, value in enumerate(np.rint(values) + 0.0)]
    return "\n".join(lines) + "\n"
