"""Moves with sine-squared velocity ramps, as the path generator of the source makes them.

    v(t) = V sin^2(pi t / (2 Tr)),  0 <= t <= Tr        ("square sine shape", Sec. 3.3 of the source)

ruckig cannot make this ramp: its jerk is -J, 0 or +J, and the jerk of this ramp is a cosine. The move is a
rectangular velocity V of the length Tr + Tc convolved with the half sine pi/(2 Tr) sin(pi t/Tr),
0 <= t <= Tr, since the running integral of that kernel is (1 - cos(pi t/Tr))/2 = sin^2(pi t/(2 Tr)).

Over a step dv in the time Tr the peaks are a = pi dv/(2 Tr) in the middle and j = pi^2 dv/(2 Tr^2) at
both ends.
"""

import math

from hil.errors import FieldError
from hil.motion.pieces import Cubic, MotionLimits, Move, Piece, Ramp


def ramp_duration_s(step_m_s: float, limits: MotionLimits) -> float:
    """Shortest ramp over a velocity step: Tr = max(pi dv/(2 A), pi sqrt(dv/(2 J))) [s]."""
    return math.pi * max(step_m_s / (2 * limits.acceleration_m_s2), math.sqrt(step_m_s / (2 * limits.jerk_m_s3)))


def bell_duration_s(stroke_m: float, limits: MotionLimits) -> float:
    """Shortest bell v = 2D/T sin^2(pi t/T): T = max(2D/V, sqrt(2 pi D/A), cbrt(4 pi^2 D/J)) [s]."""
    return max(
        2 * stroke_m / limits.velocity_m_s,
        math.sqrt(2 * math.pi * stroke_m / limits.acceleration_m_s2),
        math.cbrt(4 * math.pi**2 * stroke_m / limits.jerk_m_s3),
    )


def sine_squared(start_m: float, end_m: float, limits: MotionLimits) -> Move:
    """Ramp up, constant feed, ramp down; limits.velocity_m_s is the feed.

    The shortest ramps to the feed V cover V Tr together. A longer stroke D has Tc = D/V - Tr at constant
    feed. A shorter one is a bell, whose peak 2D/T stays below V: the feed is lowered and a note says so.
    """
    stroke, feed = abs(end_m - start_m), limits.velocity_m_s
    if stroke == 0:
        return Move((), end_m)
    notes: tuple[str, ...] = ()
    ramp_s = ramp_duration_s(feed, limits)
    constant_s = stroke / feed - ramp_s
    if constant_s < 0:
        ramp_s, constant_s = bell_duration_s(stroke, limits) / 2, 0.0
        feed = min(feed, stroke / ramp_s)
        notes = (
            f"feed lowered from {_feed(limits.velocity_m_s)} to {_feed(feed)}: over "
            f"{stroke * 1e3:.6g} mm {limits.acceleration_m_s2:.6g} m/s^2 and "
            f"{limits.jerk_m_s3:.6g} m/s^3 allow no more",
        )
    velocity = math.copysign(feed, end_m - start_m)
    ramp_m = velocity * ramp_s / 2
    pieces: list[Piece] = [Ramp(ramp_s, start_m, 0.0, velocity)]
    if constant_s > 0:
        pieces.append(Cubic(constant_s, start_m + ramp_m, velocity))
    pieces.append(Ramp(ramp_s, end_m - ramp_m, velocity, 0.0))
    return Move(tuple(pieces), end_m, notes)


def reversals(start_m: float, stroke_m: float, cycles: int, limits: MotionLimits) -> Move:
    """Triangles between start_m and start_m + stroke_m at constant feed, turning without a rest.

    One ramp of the length Tr turns V into -V; on it v = V cos(pi t/Tr), which covers V Tr/pi up to the point
    of rest. FieldError when ramps and turns leave no constant feed within the stroke.
    """
    feed = math.copysign(limits.velocity_m_s, stroke_m)
    start_s, turn_s = ramp_duration_s(abs(feed), limits), ramp_duration_s(2 * abs(feed), limits)
    ramp_m, turn_m = feed * start_s / 2, feed * turn_s / math.pi
    if abs(stroke_m) <= max(abs(ramp_m + turn_m), 2 * abs(turn_m)):
        raise FieldError(
            ("feed_m_s",),
            f"given {_feed(abs(feed))}, allowed a feed that the limits let turn "
            f"within {abs(stroke_m) * 1e3:.6g} mm; lower the feed or lengthen the stroke",
        )
    pieces: list[Piece] = [Ramp(start_s, start_m, 0.0, feed)]
    position, velocity = start_m + ramp_m, feed
    for leg in range(1, 2 * cycles + 1):
        end_m = start_m if leg % 2 == 0 else start_m + stroke_m
        last = leg == 2 * cycles
        constant_end_m = end_m - math.copysign(ramp_m if last else turn_m, velocity)
        pieces.append(Cubic((constant_end_m - position) / velocity, position, velocity))
        pieces.append(
            Ramp(start_s, constant_end_m, velocity, 0.0) if last else Ramp(turn_s, constant_end_m, velocity, -velocity)
        )
        position, velocity = constant_end_m, -velocity
    return Move(tuple(pieces), start_m)


def _feed(velocity_m_s: float) -> str:
    return f"{velocity_m_s:.4g} m/s ({velocity_m_s * 60:.4g} m/min)"
