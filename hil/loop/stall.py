"""What a late loop may do to an axis: acceleration under full torque, deadline of the drive, lateness allowed.

In CST the drive holds its last torque until its deadline of the RPDO (0x1400:5, CiA 301). The deadline is the time in
which the whole axis under the torque limit moves by following_error_m: t = sqrt(2 e / a), a = r tau / J.
"""

import math
from typing import NamedTuple

from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode, DriveSection
from hil.control.cascade import Gains

SHORTEST_PERIODS = 3  # of a deadline: one set-point lost, one late
LONGEST_S = 0.05  # of a deadline by default: the heartbeat of the master is missed after about as long
ANSWER_PERIODS = 2  # between the lateness of a tick and the time without RPDO: the tick before, and its own delay
SETTLING_TIMES = 3.0  # of the position loop, 1 / gain, until 95 % of a step of the set-points is followed


class Stall(NamedTuple):
    """Lateness for which ticks were left out [s], and the first row after them."""

    lateness_s: float
    row: int

    def acts_s(self, row: int, gains: Gains) -> float:
        """Lateness if a loop with these gains may still show it at a row, else 0."""
        settling_s = SETTLING_TIMES / gains.position_gain_1_s if gains.position_gain_1_s > 0.0 else 0.0
        return self.lateness_s if (row - self.row) * gains.period_s <= self.lateness_s + settling_s else 0.0


NO_STALL = Stall(0.0, 0)


def full_torque_acceleration_m_s2(bench: Bench) -> float:
    """Acceleration at the table of the whole axis as one body under the torque limit, without friction."""
    gains = bench.gains
    return gains.ratio_m_rad * gains.torque_limit_n_m / float(bench.twin().chain.inertia_kg_m2.sum())


def command_deadline_s(bench: Bench) -> float:
    """Time without an RPDO after which the drive stops by itself: `drive.command_deadline_s`, or as the module says."""
    section, period_s = bench.drive or DriveSection(), bench.gains.period_s
    deadline_s = section.command_deadline_s or LONGEST_S
    if section.command_deadline_s is None and section.mode is DriveMode.CST:
        moved_s = math.sqrt(2.0 * section.following_error_m / full_torque_acceleration_m_s2(bench))
        deadline_s = min(LONGEST_S, moved_s)
    return max(deadline_s, SHORTEST_PERIODS * period_s)


def late_limit_s(bench: Bench) -> float:
    """Lateness of a tick at which the axis is stopped: before the drive's deadline does it, at most overrun_s."""
    section = bench.drive or DriveSection()
    return min(section.overrun_s, command_deadline_s(bench) - ANSWER_PERIODS * bench.gains.period_s)
