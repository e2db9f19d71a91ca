"""What a twin asks to be added, as tables: over velocity, motor angle, position, acceleration, way since a reversal.

The needed torque T(x, v) of the twin in steady motion is split into f(v), its mean over places; what repeats with the
motor angle; and the rest over the position; the last two for each direction. So is the reading of the motor encoder
less the place of the table. After a slow reversal the torque comes to its steady value over a way, by friction before
sliding and the windup of the axis: what it lacks is a pulse. No mechanism is known here: all go by the stages of the
twin.
"""

import math
from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.control.compensation_tables import Adds, CompensationTable, Over
from hil.twin.axis import Twin
from hil.twin.steady_motion import motor_reading, needed_torque, torque_after_reversal

PER_TURN = 512  # places in a turn: 20 of them in a cycle of the finest cogging that a table resolves
TURNS = 12  # at most, spread over the travel
SPEEDS = 24  # knots of each direction, closer together at low speed: where friction changes most
KNOTS = (2, 9, 33, 65, 129, 257, 513)  # of a table over angle or position; the fewest that are near enough
NEAR = 0.02  # of the rms of a curve: what a table may leave of it
UNFINISHED = 0.1  # of a pulse, at its last knot: more is no pulse
PULSE = "reversal"  # name of the table over the way since a reversal
_STRIDE = 11  # of the places over which the torque is averaged: prime to PER_TURN
WAYS_M = np.geomspace(1e-7, 5e-4, 28)  # knots of a pulse: of contacts, whatever the travel; rad where the load turns
SLOWEST = 0.005  # of the largest velocity: the first knot of the velocity, and where torque changes its direction


@dataclass(frozen=True)
class TableReach:
    """Motion for which tables are made; `turn_m`: way per turn of the motor, 0: not known."""

    low_m: float
    high_m: float
    velocity_m_s: float
    acceleration_m_s2: float
    turn_m: float

    @property
    def direction_m_s(self) -> float:
        """Velocity within which the torque changes its direction."""
        return SLOWEST * self.velocity_m_s

    @property
    def places(self) -> FloatArray:
        """Places (turns, PER_TURN) [m], each row one turn from angle 0; one row over the travel below two turns."""
        turn_m = self.turn_m or math.inf
        first, last = math.ceil(self.low_m / turn_m), math.floor(self.high_m / turn_m)
        if last - first < 2:
            return np.linspace(self.low_m, self.high_m, TURNS * PER_TURN)[np.newaxis]
        turns = np.unique(np.linspace(first, last - 1, min(TURNS, last - first)).round())
        return np.asarray((turns[:, np.newaxis] + np.arange(PER_TURN) / PER_TURN) * self.turn_m, dtype=np.float64)


def shapes(twin: Twin, reach: TableReach, from_table: bool) -> dict[str, CompensationTable]:
    """Tables of a twin by name, with all knots; names and knots depend on the reach alone.

    `from_table`: the position loop corrects what the linear encoder shows, so that no position is corrected.
    """
    found = [_over_acceleration(twin, reach), _over_velocity(twin, reach)]
    slow = 0.25 * reach.velocity_m_s
    place = reach.places
    torque = [needed_torque(twin, place.ravel(), sign * slow).reshape(place.shape) for sign in (1.0, -1.0)]
    found += _along("torque", Adds.TORQUE, reach, [one - one.mean() for one in torque])
    found.append(_after_reversal(twin, reach))
    if not from_table:
        dense = np.unique(np.concatenate([place.ravel(), np.linspace(reach.low_m, reach.high_m, KNOTS[-1])]))
        error = [np.interp(place, dense, motor_reading(twin, dense, sign * slow) - dense) for sign in (1.0, -1.0)]
        found += _along("set-point", Adds.POSITION, reach, error)
    return {table.name: table for table in found}


def thinned(table: CompensationTable) -> CompensationTable | None:
    """The table with as few knots as come near enough; None if it is too fine for all of them."""
    if table.over not in (Over.ANGLE, Over.POSITION):
        return table
    turn, at = table.over is Over.ANGLE, table.at
    period, both = 2.0 * math.pi if turn else None, (table.forward, table.backward)
    for count in KNOTS:
        knots = np.arange(count) * 2.0 * math.pi / count if turn else np.linspace(at[0], at[-1], count)
        columns = [np.interp(knots, at, one, period=period) for one in both]
        left = [np.interp(at, knots, new, period=period) - old for new, old in zip(columns, both, strict=True)]
        if np.sqrt(np.mean(np.square(left))) <= NEAR * np.sqrt(np.mean(np.square(both))):
            return CompensationTable(table.name, table.adds, table.over, knots, *columns)
    return None


def _over_acceleration(twin: Twin, reach: TableReach) -> CompensationTable:
    """Inertia of the axis as one body."""
    largest = reach.acceleration_m_s2
    torque = float(twin.chain.inertia_kg_m2.sum()) / twin.gains.ratio_m_rad * largest
    at, values = np.array([-largest, largest]), np.array([-torque, torque])
    return CompensationTable("inertia", Adds.TORQUE, Over.ACCELERATION, at, values, values)


def _over_velocity(twin: Twin, reach: TableReach) -> CompensationTable:
    """Mean over the places; friction goes over from one direction to the other within the first knots about rest."""
    speeds = reach.direction_m_s * np.geomspace(1.0, 1.0 / SLOWEST, SPEEDS)
    at = np.concatenate([-speeds[::-1], speeds])
    places = reach.places.ravel()[::_STRIDE]
    values = np.array([needed_torque(twin, places, float(speed)).mean() for speed in at])
    return CompensationTable("friction and load", Adds.TORQUE, Over.VELOCITY, at, values, values)


def _after_reversal(twin: Twin, reach: TableReach) -> CompensationTable:
    """Torque that is missing on the way since a reversal in the middle of the travel; 0 if it does not end there."""
    middle = 0.5 * (reach.low_m + reach.high_m)
    columns = [torque_after_reversal(twin, middle, sign, WAYS_M) for sign in (1.0, -1.0)]
    ends = all(abs(column[-1]) <= UNFINISHED * abs(column[0]) for column in columns)
    return CompensationTable(
        PULSE, Adds.TORQUE, Over.REVERSAL_WAY, WAYS_M, *((column - column[-1]) * ends for column in columns)
    )


def _along(what: str, adds: Adds, reach: TableReach, curves: list[FloatArray]) -> list[CompensationTable]:
    """Tables over angle and position of curves forward and backward (turns, PER_TURN)."""
    place, found = reach.places, []
    angle = [np.zeros(place.shape[1])] * 2
    if len(place) > 1:
        angle = [curve.mean(axis=0) - curve.mean() for curve in curves]
        knots = 2.0 * math.pi * np.arange(PER_TURN) / PER_TURN
        found.append(CompensationTable(f"{what} over angle", adds, Over.ANGLE, knots, *angle))
    rest = [(curve - one).ravel() for curve, one in zip(curves, angle, strict=True)]
    return [*found, CompensationTable(f"{what} over position", adds, Over.POSITION, place.ravel(), *rest)]
