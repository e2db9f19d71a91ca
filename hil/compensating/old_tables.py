"""Tables of a bench that no longer fit the axis, held against what a later diagnosis asks for.

A table over the angle of the motor is also tried at all other angles: after an absolute encoder was exchanged, or a
coupling was moved, the same curve stands at another place.
"""

import math
from collections.abc import Iterator

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.compensating.controllers.position_table import USELESS
from hil.compensating.derive import SMALL, SMALLEST_M, size, turn_m
from hil.compensating.shapes import NEAR, TableReach, shapes
from hil.control.compensation_tables import Adds, CompensationTable, Over
from hil.recording.recording import Recording

_SHIFTS = 720  # of a turn: half a degree
_DIP = 2.0  # degrees about an angle that fits, within which the best one is taken


def reach_of_recording(recording: Recording, bench: Bench) -> TableReach:
    """Travel, speed and acceleration of the set-points of a recording."""
    position, speed = recording["position_command_m"], recording["velocity_command_m_s"]
    acceleration = float(np.abs(np.gradient(speed, bench.period_s)).max())
    return TableReach(
        float(position.min()), float(position.max()), float(np.abs(speed).max()), acceleration, turn_m(bench)
    )


def old_tables(bench: Bench, reach: TableReach) -> Iterator[str]:
    """Say which tables of a bench leave much of what its twin, as diagnosed, asks for within a reach."""
    wanted = shapes(bench.twin(), reach, bench.gains.position_from_table)
    tables = [one for one in bench.tables().tables if one.over in (Over.ANGLE, Over.POSITION)]
    if any(one.over is Over.ANGLE for one in tables) and not any(one.over is Over.ANGLE for one in wanted.values()):
        yield "The tables over angle and position were not checked: the motion has less than two turns of the motor."
        return
    for table in tables:
        asked = wanted.get(table.name)
        if asked is None or (asked.adds, asked.over) != (table.adds, table.over):
            continue
        curve, own = _joined(asked, asked), _rms(_joined(table, asked))
        least = SMALL[table.adds] * max(size(one) for one in wanted.values() if one.adds is table.adds)
        least = max(least, SMALLEST_M if table.adds is Adds.POSITION else 0.0)
        whole = _rms(curve)
        if own <= least:
            continue
        if whole <= max(least, NEAR * own):
            yield f"The table '{table.name}' no longer fits the axis, which asks for nothing like it any more."
            continue
        left = _rms(curve - _joined(table, asked)) / whole
        if left > USELESS:
            turned = _turned(table, asked) if table.over is Over.ANGLE else ""
            yield f"The table '{table.name}' no longer fits the axis: it leaves {left:.0%} of what it is for{turned}."


def _turned(table: CompensationTable, asked: CompensationTable) -> str:
    """The nearest angle at which a table would fit, in words; empty if it fits at none."""
    curve = _joined(asked, asked)
    moved = {
        degrees: _rms(curve - _joined(table, asked, math.radians(degrees))) / _rms(curve)
        for degrees in sorted(np.linspace(-180.0, 180.0, _SHIFTS, endpoint=False).tolist(), key=abs)
    }
    least = min(moved.values())
    if not least < USELESS:
        return ""
    near = next(degrees for degrees, one in moved.items() if one <= least + NEAR)  # a wave fits at several angles
    about = [degrees for degrees in moved if abs(degrees - near) <= _DIP]
    nearest = min(about, key=lambda degrees: moved[degrees])
    return f"; turned by {nearest:g} deg of the motor it would leave {moved[nearest]:.0%}"


def _joined(table: CompensationTable, at: CompensationTable, shift: float = 0.0) -> FloatArray:
    """Values (2 n,) forward and backward of a table, turned by an angle, at the knots of another."""
    period = 2.0 * math.pi if table.over is Over.ANGLE else None
    return np.concatenate(
        [np.interp(at.at - shift, table.at, one, period=period) for one in (table.forward, table.backward)]
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
