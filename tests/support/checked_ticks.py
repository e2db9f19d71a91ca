"""Ticks that are checked without devices: all bounds off but those given, a motor and a table that stand still."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from hil.loop.checks import check
from hil.loop.limits import Bounds, Facts, Limit, Memory

PERIOD_S = 2.0**-10  # nearly a millisecond; powers of two, so that a value can be equal to its bound
OFF = Bounds(has_table=True, commands_torque=True, following_error_m=math.inf, following_error_s=0.0,
             travel_low_m=-math.inf, travel_high_m=math.inf, deceleration_m_s2=math.inf, velocity_m_s=math.inf,
             encoder_difference_m=math.inf, frozen_m=math.inf, frozen_torque=math.inf, torque=math.inf,
             torque_difference=math.inf, drive_torque=math.inf, continuous_torque=math.inf, thermal_time_s=1.0,
             residual_motor_m=math.inf, residual_table_m=math.inf, residual_torque=math.inf,
             load_torque=math.inf, runaway_m_s=math.inf, position_gain_1_s=0.0, sign_m=math.inf)  # fmt: skip
STILL = Facts(position_m=0.0, velocity_m_s=0.0, motor_m=0.0, table_m=0.0, fed_back_m=0.0, torque=0.0, command=0.0,
              reference=0.0, twin_motor_m=0.0, twin_table_m=0.0, twin_torque=0.0, motor_age=0, table_age=0, skipped=0,
              period_s=PERIOD_S)  # fmt: skip


class Checked:
    """Checks that remember the ticks before; the first tick has the values of `STILL` or those of `first`."""

    def __init__(self, first: Facts = STILL, **bounds: float) -> None:
        self.bounds, self.memory = np.array(OFF._replace(**bounds), dtype=np.float64), np.zeros(len(Memory))
        self.first = first
        assert self.tick() == Limit.NONE

    def tick(self, **values: float) -> Limit:
        """Check a tick; values that are not given are those of the first."""
        return Limit(check(self.bounds, self.memory, self.first._replace(**values)))

    def ticks_until_passed(self, ticks: Iterable[dict[str, float]]) -> tuple[int, Limit]:
        """Return how many ticks it took to pass a bound, and which; (0, NONE) if none was passed."""
        for count, values in enumerate(ticks, 1):
            if passed := self.tick(**values):
                return count, passed
        return 0, Limit.NONE
