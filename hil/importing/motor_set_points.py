"""Set-points of a geared axis that count the motor's angle, as a drive's own do (CiA 402, objects 6062h and 60FCh)."""

from collections.abc import Mapping

from hil.arrays import FloatArray
from hil.channels import SPEED_SET_POINT, AxisChannels
from hil.importing.relations import SAME_POSITION, proportional
from hil.importing.unit_choice import MATCH
from hil.importing.usual_values import SURE_TURNS

SET_POINTS = ("position_command_m", "velocity_command_m_s", "acceleration_command_m_s2", SPEED_SET_POINT)


def gear_of_set_points(columns: Mapping[str, FloatArray], axis: AxisChannels) -> float:
    """Gear ratio by which set-points must be divided to be those of the load; 1 where they are.

    `columns` (n,) are in SI. Set-points that follow the motor's encoder as they are, beside a second encoder that does
    not, are the motor's; the ratio is that of the two encoders, a whole one where it is near.
    """
    names = (axis.motor_position, axis.table_position, axis.position_command)
    if not columns.keys() >= set(names):
        return 1.0
    motor, load, command = (columns[name] for name in names)
    over, asked = proportional(load, motor), proportional(command, motor)
    follows = min(over.share, asked.share) > SAME_POSITION and abs(asked.factor - 1.0) < MATCH
    if not follows or abs(over.factor) > 1.0 - MATCH:
        return 1.0
    gear = 1.0 / over.factor
    return float(round(gear)) if abs(gear - round(gear)) < SURE_TURNS else gear
