"""SINUMERIK 840D sl and 828D: measuring system error compensation, backlash, and friction (quadrant errors) as MDs.

    $AA_ENC_COMP[0,N,axis]    is added to the actual value: a positive value moves the axis in the negative direction,
                              so it is minus the correction of the set-point, the mean of both directions     [mm]
    MD32450 BACKLASH          positive where the encoder leads the machine part: forward less backward        [mm]
    MD32520 FRICT_COMP_CONST_MAX, MD32540 FRICT_COMP_TIME
                              pulse on the velocity set-point after a reversal                      [mm/min], [s]

A pulse dn exp(-t / T) on a PI velocity loop with gain Kp and integral time Ti = T gives the torque step Kp dn. At a
reversal Coulomb friction changes by 2 Tc, so that dn = 2 Tc / Kp with T = Ti. Both are starting values: the manual
finds them by a circularity test (`hil iso230 --circle`).

Source: Siemens, SINUMERIK 840D sl / 828D, Function Manual Extended Functions 6FC5397-1BP40, K3 Compensations: 4.3
backlash, 4.4.2 measuring system error compensation with its example, 4.6 friction compensation.
"""

import numpy as np

from hil.compensating.controllers.controller_task import ControllerFiles, ControllerTask, NotTaken
from hil.compensating.controllers.position_table import PositionTable, position_table
from hil.control.compensation_tables import Adds, CompensationTable, Over

MOST = 1000  # MD38000 sets the number; 8 bytes of NC memory each
AXIS = "AX1"
NO_TORQUE = {
    Over.ACCELERATION: "the torque pre-control of the drive has an inertia, no table",
    Over.POSITION: "tables over a position correct positions, no torque",
    Over.ANGLE: "tables over a position correct positions, no torque",
    Over.REVERSAL_TIME: "the pulse after a reversal has one amplitude and one time constant, no table",
    Over.REVERSAL_WAY: "the pulse after a reversal has one amplitude and one time constant, no table",
}
NO_INTEGRAL = "the velocity loop of the bench has no integral part, whose time the pulse after a reversal takes"


def for_sinumerik(task: ControllerTask) -> ControllerFiles:
    """Write an INI file of the NC: ENC_COMP table, backlash and friction of the axis AX1."""
    table, left_out = position_table(task, MOST)
    lines, not_taken = list[str](), list(left_out)
    if table is not None:
        lines += _backlash(task, table) if table.constant else _encoder(task, table) + _backlash(task, table)
    for one in task.tables(Adds.TORQUE):
        if one.over is not Over.VELOCITY:
            not_taken.append(NotTaken(one.name, NO_TORQUE[one.over]))
        elif task.gains.integral_gain_n_m_rad <= 0.0:
            not_taken.append(NotTaken(one.name, NO_INTEGRAL))
        else:
            lines += _friction(task, one)
    if not lines:
        return ControllerFiles({}, tuple(not_taken))
    head = [
        f"; Compensation of {task.name}. Replace {AXIS} by the machine axis. Position 0 must be that of the bench.",
        "CHANDATA(1)",
    ]
    return ControllerFiles({"sinumerik.ini": "\n".join([*head, *lines, "M17"]) + "\n"}, tuple(not_taken))


def _encoder(task: ControllerTask, table: PositionTable) -> list[str]:
    unit, step = task.per_unit, task.per_unit * (table.at[1] - table.at[0])
    values = [f"$AA_ENC_COMP[0,{number},{AXIS}]={value:.7f}" for number, value in enumerate(0.0 - unit * table.both)]
    return [
        f"; MD38000 $MA_MM_ENC_COMP_MAX_POINTS must be {table.at.size} or more: set it first, it clears NC memory.",
        f"; The lines between the points leave {100.0 * table.left:.2g} % of the correction. Unit: {task.unit}.",
        f"$MA_ENC_COMP_ENABLE[0,{AXIS}]=0 ; the table is write-protected while it is 1",
        *values,
        f"$AA_ENC_COMP_STEP[0,{AXIS}]={step:.7f}",
        f"$AA_ENC_COMP_MIN[0,{AXIS}]={unit * table.at[0]:.7f}",
        f"$AA_ENC_COMP_MAX[0,{AXIS}]={unit * table.at[-1]:.7f}",
        f"$AA_ENC_COMP_IS_MODULO[0,{AXIS}]=0",
        f"$MA_ENC_COMP_ENABLE[0,{AXIS}]=1 ; acts after the reference point, with a jump where its value is not 0 there",
    ]


def _backlash(task: ControllerTask, table: PositionTable) -> list[str]:
    if table.one_way:
        return []
    left = float(np.abs(table.forward - table.backward - table.reversal).max())
    return [
        f"; Backlash: one value for the travel, which is up to {task.per_unit * left:.7f} {task.unit} beside it.",
        f"$MA_BACKLASH[0,{AXIS}]={task.per_unit * table.reversal:.7f}",
    ]


def _friction(task: ControllerTask, table: CompensationTable) -> list[str]:
    speed, gains = task.compensation.limits.direction_m_s, task.gains
    coulomb = 0.5 * float(
        np.interp(speed, table.at, table.forward) - np.interp(-speed, table.at, table.backward)
    )  # without constant load
    pulse = 2.0 * coulomb / gains.velocity_gain_n_m_s_rad * gains.ratio_m_rad  # [m/s]
    per_minute = task.per_unit / 360.0 * 60.0 if task.turns else 60.0 * task.per_unit  # rev/min, mm/min
    time_s = gains.velocity_gain_n_m_s_rad / gains.integral_gain_n_m_rad
    return [
        f"; Friction at a reversal: starting values for {coulomb:.4g} {task.torque_unit} of Coulomb",
        "; friction and the velocity loop of the bench; find the best ones by a circularity test.",
        "; MD32490, 32500, 32510, 32520, 32540; the first acts after a reset of the NCK.",
        f"$MA_FRICT_COMP_MODE[0,{AXIS}]=1",
        f"$MA_FRICT_COMP_ENABLE[{AXIS}]=1",
        f"$MA_FRICT_COMP_ADAPT_ENABLE[0,{AXIS}]=0",
        f"$MA_FRICT_COMP_CONST_MAX[0,{AXIS}]={pulse * per_minute:.6f}",
        f"$MA_FRICT_COMP_TIME[0,{AXIS}]={time_s:.6f}",
    ]
