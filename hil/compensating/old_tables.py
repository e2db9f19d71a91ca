"""Tables of a bench that no longer fit the axis, held against what a later diagnosis asks for.

A table over the angle of the motor is also tried at all other angles: after an absolute encoder was exchanged, or a
coupling was moved, the same curve stands at another place.
"""

import math
from collections.abc import Iterator

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.compensating.shapes import NEAR, TableReach, shapes
from hil.control.compensation_tables import CompensationTable, Over
from hil.recording.recording import Recording

OLD = 0.5  # of what the axis asks for (rms): a table that leaves more is old
_SHIFTS = 720  # of a turn: half a degree


def reach_of_recording(recording: Recording, bench: Bench) -> TableReach:
    """Travel, speed and acceleration of the set-points of a recording."""
    position, speed = recording["position_command_m"], recording["velocity_command_m_s"]
    physics, ratio = bench.axis.physics(), bench.axis.ratio_m_rad
    turn_m = 2.0 * math.pi * ratio / physics.angle_per_unit if physics.turn_known else 0.0
    acceleration = float(np.abs(np.gradient(speed, bench.period_s)).max())
    return TableReach(float(position.min()), float(position.max()), float(np.abs(speed).max()), acceleration, turn_m)


def old_tables(bench: Bench, reach: TableReach) -> Iterator[str]:
    """Say which tables of a bench leave much of what its twin, as diagnosed, asks for within a reach."""
    wanted = shapes(bench.twin(), reach, bench.gains.position_from_table)
    for table in bench.tables().tables:
        asked = wanted.get(table.name)
        if asked is None or table.over not in (Over.ANGLE, Over.POSITION):
            continue
        curve = _joined(asked, asked)
        left = _rms(curve - _joined(table, asked))
        if not left > OLD * _rms(curve):
            continue
        share = left / (_rms(curve) or left)
        text = f"The table '{table.name}' no longer fits the axis: it leaves {share:.0%} of what it is for"
        if table.over is Over.ANGLE:
            moved = {
                degrees: _rms(curve - _joined(table, asked, math.radians(degrees))) / (_rms(curve) or left)
                for degrees in sorted(np.linspace(-180.0, 180.0, _SHIFTS, endpoint=False).tolist(), key=abs)
            }
            least = min(moved.values())
            if least < OLD:  # a curve that repeats within the turn fits at several angles: the nearest
                nearest = next(degrees for degrees, one in moved.items() if one <= least + NEAR)
                text += f"; turned by {nearest:g} deg of the motor it would leave {moved[nearest]:.0%}"
        yield f"{text}."


def _joined(table: CompensationTable, at: CompensationTable, shift: float = 0.0) -> FloatArray:
    """Values (2 n,) forward and backward of a table, turned by an angle, at the knots of another."""
    period = 2.0 * math.pi if table.over is Over.ANGLE else None
    return np.concatenate(
        [np.interp(at.at - shift, table.at, one, period=period) for one in (table.forward, table.backward)]
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
