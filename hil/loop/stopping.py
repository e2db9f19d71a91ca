"""Plan a controlled stop in the loop: in bounded time, and only from a state that an axis can have."""

import math

from hil.loop.limits import Bounds
from hil.motion.pieces import MotionLimits
from hil.motion.time_optimal import MotionState
from hil.motion.trajectory import Trajectory, stop_from

LONGEST_STOP_S = 10.0  # its set-points are planned in less than a period of 4 ms; no axis needs longer
SPEED_MARGIN = 2.0  # without a bound of velocity: of the profile's limit


def plan_stop(state: MotionState, limits: MotionLimits, bounds: Bounds, period_s: float) -> Trajectory | None:
    """Return the shortest stop, None where the drive must stop by itself: from values that are not finite, faster than
    the axis can be, or with a stop that takes too long."""
    position, velocity, acceleration = state
    allowed_m_s = bounds.velocity_m_s if math.isfinite(bounds.velocity_m_s) else SPEED_MARGIN * limits.velocity_m_s
    if not (math.isfinite(position) and math.isfinite(acceleration) and abs(velocity) <= allowed_m_s):
        return None
    longest_s = abs(velocity) / limits.acceleration_m_s2 + 2.0 * limits.acceleration_m_s2 / limits.jerk_m_s3
    if longest_s + abs(acceleration) / limits.jerk_m_s3 > LONGEST_STOP_S:
        return None
    return stop_from(position, velocity, acceleration, limits, period_s)
