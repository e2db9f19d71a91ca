"""Speed and torque among monitor outputs in volts, whose names do not tell which is which."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from hil.arrays import FloatArray
from hil.identification.derivatives import motion
from hil.importing.column_names import Label
from hil.importing.lexicon import Quantity
from hil.importing.relations import driven

_DRIVEN, _CLEARLY = 0.6, 0.2  # share of the torque that the motion explains, and by how much more than the other way


@dataclass(frozen=True)
class MonitorOutputs:
    """Labels of the speed and the torque, and a note on how they were told."""

    labels: dict[str, Label]
    note: str


def monitor_outputs(
    live: Mapping[str, FloatArray], labels: Mapping[str, Label], period_s: float
) -> MonitorOutputs | None:
    """Tell the two where a file has voltages only: inertia and friction of the speed explain the torque.

    None where another column is a position or a speed, or if no two voltages are so related.
    """
    if any(labels[name].quantity in (Quantity.POSITION, Quantity.VELOCITY) for name in live):
        return None
    volts = [name for name in live if (labels[name].unit or labels[name].electric) in ("V", "mV")]
    shares = {
        (speed, torque): driven(live[torque], motion(np.cumsum(live[speed]) * period_s, period_s), period_s).share
        for speed, torque in permutations(volts, 2)
    }
    best = max(shares, key=lambda pair: shares[pair], default=None)
    if best is None or shares[best] < max(_DRIVEN, shares[best[::-1]] + _CLEARLY):
        return None
    speed, torque = best
    note = f"{speed}: taken for the speed and {torque} for the torque, because inertia and friction explain it so"
    return MonitorOutputs({speed: replace(labels[speed], quantity=Quantity.VELOCITY, electric=None)}, note)
