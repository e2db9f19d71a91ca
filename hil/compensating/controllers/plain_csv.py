"""Plain CSV of all tables, for a controller of one's own: a row per knot, with units; nothing is left out.

A value is added to the torque at the motor, or to the position set-point; `forward` for motion away from home. Tables
are lines through their knots (`hil.control.compensation_tables`).
"""

from hil.compensating.controllers.controller_task import ControllerFiles, ControllerTask
from hil.control.compensation_tables import Adds, Over


def for_csv(task: ControllerTask) -> ControllerFiles:
    """Write the knots of all tables."""
    length = "rad" if task.turns else "m"
    units = {Adds.TORQUE: task.torque_unit, Adds.POSITION: length}
    over = {
        Over.VELOCITY: f"{length}/s",
        Over.ACCELERATION: f"{length}/s^2",
        Over.ANGLE: "rad",
        Over.POSITION: length,
        Over.REVERSAL_TIME: "s",
        Over.REVERSAL_WAY: length,
    }
    names = {one: one.name.lower().replace("_", " ") for one in Over}
    lines = ["table,adds_to,value_unit,over,knot_unit,knot,forward,backward"]
    for table in task.compensation.tables:
        head = ",".join((table.name, table.adds.name.lower(), units[table.adds], names[table.over], over[table.over]))
        for knot, forward, backward in zip(table.at, table.forward, table.backward, strict=True):
            lines.append(f"{head},{knot:.9g},{forward:.9g},{backward:.9g}")
    return ControllerFiles({"csv": "\n".join(lines) + "\n"})
