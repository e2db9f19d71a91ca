"""LinuxCNC: a screw compensation file of type 1, and the lines of the INI section [JOINT_n] that name it.

    motor position command = joint position command + trim      forward trim for v > 0, reverse trim for v < 0

Lines of a file of type 1 are "nominal forward_trim reverse_trim" in machine units, ascending, at most 256; the first
line without three numbers ends it, so that it has no comments. (Type 0 has measured positions: nominal less trim.)
Between the lines it is interpolated, outside them the outer trims hold. BACKLASH adds +- its half and is not used
where there is a COMP_FILE. LinuxCNC ramps the change of direction by itself.

Source: LinuxCNC 2.9, src/emc/motion/control.c (compute_screw_comp), usrmotintf.cc (usrmotLoadComp), command.c
(EMCMOT_SET_JOINT_COMP); LinuxCNC documentation, INI Configuration, section [JOINT_<num>].
"""

from hil.compensating.controllers.controller_task import ControllerFiles, ControllerTask, NotTaken
from hil.compensating.controllers.position_table import position_table
from hil.control.compensation_tables import Adds

MOST = 256  # EMCMOT_COMP_SIZE
NO_TORQUE = (
    "LinuxCNC's motion has no torque output: its tables correct positions; the torque is made behind it, by a pid "
    "component or the drive (--for cia402)"
)


def for_linuxcnc(task: ControllerTask) -> ControllerFiles:
    """Write COMP_FILE and INI lines; only BACKLASH where nothing but the direction counts."""
    table, left_out = position_table(task, MOST)
    not_taken = (*left_out, *(NotTaken(one.name, NO_TORQUE) for one in task.tables(Adds.TORQUE)))
    if table is None:
        return ControllerFiles({}, not_taken)
    head = [
        f"# Into the section [JOINT_n] of the axis {task.name}. Machine units: {task.unit}.",
        "# Position 0 of the joint must be that of the bench: the screw has its angle from there.",
    ]
    if table.constant:
        ini = [*head, f"BACKLASH = {task.per_unit * table.reversal:.7f}"]
        return ControllerFiles({"linuxcnc.ini": "\n".join(ini) + "\n"}, not_taken)
    ini = [
        *head,
        f"# {table.at.size} points; the lines between them leave {100.0 * table.left:.2g} % of the correction.",
        f"COMP_FILE = {task.name}.linuxcnc.comp",
        "COMP_FILE_TYPE = 1",
        "# BACKLASH is within COMP_FILE and not used beside it.",
    ]
    columns = (table.at, table.forward, table.backward)
    lines = [
        f"{at:.7f} {forward:.7f} {backward:.7f}"
        for at, forward, backward in zip(*(task.per_unit * one for one in columns), strict=True)
    ]
    return ControllerFiles({"linuxcnc.comp": "\n".join(lines) + "\n", "linuxcnc.ini": "\n".join(ini) + "\n"}, not_taken)
