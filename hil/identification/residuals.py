"""Measured less simulated. Each encoder has a datum of its own: only that of the position loop is the set-points'."""

from __future__ import annotations

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.twin.axis import Response


def datum_m(measured: Response, simulated: Response, ratio_m: float, judged: slice) -> float:
    """By how much the datum of the linear encoder differs from that of a simulation: the mean difference of table less
    motor position over the rows judged. 0 without a linear encoder."""
    if not measured.table_position_m.size:
        return 0.0
    return float(np.mean(_stretch(measured, simulated, ratio_m)[judged]))


def differences(measured: Response, simulated: Response, bench: Bench, judged: slice) -> dict[str, FloatArray]:
    """Differences (n,) of the motor [rad or m], table less motor [m], torque [N m or N], free of the data.

    Not finite where the simulation is not.
    """
    ratio_m = bench.axis.ratio_m_rad
    with np.errstate(invalid="ignore", over="ignore"):  # a hypothesis may be unstable
        motor = measured.motor_position - simulated.motor_position
        found = {"motor": motor - np.mean(motor[judged]) if bench.gains.position_from_table else motor}
        if measured.table_position_m.size:
            found["table"] = _stretch(measured, simulated, ratio_m) - datum_m(measured, simulated, ratio_m, judged)
        found["torque"] = measured.torque - simulated.torque
    return found


def _stretch(measured: Response, simulated: Response, ratio_m: float) -> FloatArray:
    motor_m = ratio_m * (measured.motor_position - simulated.motor_position)
    return measured.table_position_m - simulated.table_position_m - motor_m
