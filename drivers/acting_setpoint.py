"""The set-point that acts in the drive against those commanded: 0x6074, 0x606B or 0x6062 in a TPDO (CiA 402-2).

A drive that got none of the last set-points, or limits them, reports another demand than any of them. Set-points of
some cycles count, because some may be lost or late, and the drive may interpolate between them.
"""

from collections import deque
from typing import Final

from drivers.cia402 import OperationMode
from drivers.object_index import ObjectIndex as Index
from drivers.pdo import Entry, layout

DEMAND: Final = {
    OperationMode.CYCLIC_SYNC_TORQUE: Entry(Index.TORQUE_DEMAND, 0, 16, True),
    OperationMode.CYCLIC_SYNC_VELOCITY: Entry(Index.VELOCITY_DEMAND, 0, 32, True),
    OperationMode.CYCLIC_SYNC_POSITION: Entry(Index.POSITION_DEMAND, 0, 32, True),
}
# Drives compute in units of their own: 1 % of the rated torque, 1 rpm, a thousandth of a revolution
_TORQUE_TOLERANCE: Final = 10
_TURNS_TOLERANCE: Final = {
    OperationMode.CYCLIC_SYNC_VELOCITY: 1 / 60,
    OperationMode.CYCLIC_SYNC_POSITION: 1e-3,
}
MORE_CYCLES: Final = 3  # than may be missed: one until a set-point acts, one until it is reported, one late


class ActingSetpoint:
    """Compares the demand of a drive with the targets of the last `cycles` (units of the objects).

    torque_limit: to which the drive limits its torque (0x6072) [1/1000 of the rated torque].
    """

    def __init__(self, mode: OperationMode, cycles: int, counts_per_rev: float, torque_limit: float) -> None:
        self._unpack = layout([DEMAND[mode]]).unpack
        self.size = DEMAND[mode].bits // 8
        self.sent: deque[int] = deque(maxlen=cycles)
        in_torque = mode is OperationMode.CYCLIC_SYNC_TORQUE
        self._limit = torque_limit if in_torque else float("inf")
        self._tolerance = _TORQUE_TOLERANCE if in_torque else max(2.0, _TURNS_TOLERANCE[mode] * counts_per_rev)
        self.text = ""

    def differs(self, data: bytes) -> bool:
        """Return True if the demand in a TPDO lies beyond all targets sent, by more than the tolerance."""
        (demand,) = self._unpack(data)
        if demand in self.sent or not self.sent:
            return False
        apart = [_wrap(min(max(target, -self._limit), self._limit) - demand) for target in self.sent]
        if min(apart) <= self._tolerance and max(apart) >= -self._tolerance:
            return False
        self.text = f"the set-point {demand} acts, commanded were {min(self.sent)} to {max(self.sent)}"
        return True


def _wrap(counts: float) -> float:
    """Wrap a difference of positions to INTEGER32."""
    return (counts + 0x80000000) % 0x100000000 - 0x80000000
