"""What a late loop may do to an axis: acceleration under full torque, deadline of the drive, lateness allowed.

Both watchdogs of the drive see a loop that is late: the deadline of the set-points (0x1400:5) and the heartbeat
consumer (0x1016, CONSUMED_HEARTBEATS of the master's). The lateness allowed follows from both, so that the loop ends
the run and names itself before the drive does it under another name.

In CST the drive holds its last torque until its deadline of the RPDO (0x1400:5, CiA 301). The deadline is the time in
which the whole axis under the torque limit moves by following_error_m: t = sqrt(2 e / a), a = r tau / J.
"""

import math
from typing import NamedTuple

from drivers.canopen_master import CONSUMED_HEARTBEATS
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode, DriveSection
from hil.control.cascade import Gains

SHORTEST_PERIODS = 3  # of a deadline: one set-point lost, one late
LONGEST_S = 0.05  # of a deadline by default: the heartbeat of the master is missed after about as long
ANSWER_PERIODS = 2  # between the lateness of a tick and the time without a frame: the tick before, and its own delay
SETTLING_TIMES = 3.0  # of the position loop, 1 / gain, until 95 % of a step of the set-points is followed


class Stall(NamedTuple):
    """Time without set-points [s], how far the axis may have left them meanwhile [m], and the first row after it."""

    lateness_s: float
    deviation_m: float
    row: int

    def acts(self, row: int, gains: Gains) -> bool:
        """Return True if a loop with these gains may still show it at a row."""
        settling_s = SETTLING_TIMES / gains.position_gain_1_s if gains.position_gain_1_s > 0.0 else 0.0
        return (row - self.row) * gains.period_s <= self.lateness_s + settling_s


NO_STALL = Stall(0.0, 0.0, 0)


def stalled(bench: Bench, lateness_s: float, row: int, velocity_m_s: float) -> Stall:
    """Return the stall before a row with this set-point: the drive held its last torque (CST), velocity or position."""
    held_torque = (bench.drive or DriveSection()).mode is DriveMode.CST
    acceleration_m_s2 = full_torque_acceleration_m_s2(bench) if held_torque else 0.0
    return Stall(lateness_s, abs(velocity_m_s) * lateness_s + acceleration_m_s2 * lateness_s**2 / 2.0, row)


def full_torque_acceleration_m_s2(bench: Bench) -> float:
    """Acceleration at the table of the whole axis as one body under the torque limit, without friction."""
    return acceleration_m_s2(bench, bench.gains.torque_limit_n_m)


def acceleration_m_s2(bench: Bench, torque: float) -> float:
    """Acceleration at the table of the whole axis as one body under a torque [N m or N], without friction."""
    return bench.gains.ratio_m_rad * torque / float(bench.twin().chain.inertia_kg_m2.sum())


def command_deadline_s(bench: Bench) -> float:
    """Time without an RPDO after which the drive stops by itself: `drive.command_deadline_s`, or as the module says.

    Whole milliseconds, as the object counts: rounded down, but never below SHORTEST_PERIODS.
    """
    section, period_s = bench.drive or DriveSection(), bench.gains.period_s
    deadline_s = section.command_deadline_s or LONGEST_S
    if section.command_deadline_s is None and section.mode is DriveMode.CST:
        moved_s = math.sqrt(2.0 * section.following_error_m / full_torque_acceleration_m_s2(bench))
        deadline_s = min(LONGEST_S, moved_s)
    return 1e-3 * max(math.floor(round(1e3 * deadline_s, 6)), math.ceil(round(1e3 * SHORTEST_PERIODS * period_s, 6)))


def late_limit_s(bench: Bench) -> float:
    """Lateness at which the axis is stopped: before a watchdog of the drive does it, at most overrun_s.

    A heartbeat may have been due when the loop became late: the time without one is heartbeat_s longer.
    """
    section, period_s = bench.drive or DriveSection(), bench.gains.period_s
    without_heartbeat_s = (CONSUMED_HEARTBEATS - 1) * section.heartbeat_s
    allowed_s = min(command_deadline_s(bench), without_heartbeat_s) - ANSWER_PERIODS * period_s
    return min(section.overrun_s, max(allowed_s, period_s))
