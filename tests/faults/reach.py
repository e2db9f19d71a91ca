"""How far an axis may go after a fault: derived from torque limit, inertia and the bounds of detection, not assumed.

A false encoder has the loop push with full torque until it is detected, at the latest when motor and table differ by
`encoder_difference_m` (reversed: when both have moved by `frozen_m` against each other, twice that from where they last
agreed). Over a way d the speed v grows to sqrt(v^2 + 2 a d), a = r tau / J. In a stall in CST the drive holds its last
torque until its deadline of the RPDO: v + a_held t.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from observed_run import ACCELERATION_M_S2, JERK_M_S3, PERIOD_S, SPEED_M_S, Observed

from hil.loop.bounds import make_bounds
from hil.loop.checks import FRESH_PERIODS
from hil.loop.devices import Rig
from hil.loop.stall import command_deadline_s, full_torque_acceleration_m_s2

if TYPE_CHECKING:
    from fault_kinds import Kind

RAMP_M_S2 = 160 * 0.01  # 0x6085 of the simulated drive, 160 rev/s^2, on a lead of 10 mm
WATCHDOG_S = 0.1  # heartbeat time-out of 60 ms, the heartbeat before it, and an answer
ALONE_M_S2 = 1.0  # friction of the axis without power, and the deceleration of a stop that has begun
ANSWER_S = 0.01  # from a stop command until the drive brakes
OVERSHOOT = 1.05  # of the speed of the move
REST_M = 0.002  # elastic and settling


def peak_speed_m_s(kind: Kind, rig: Rig, seen: Observed) -> float:
    """Highest speed that the axis can have when the fault is detected, or when the drive begins to brake by itself."""
    speed, full = OVERSHOOT * SPEED_M_S, full_torque_acceleration_m_s2(rig.bench)
    bounds = make_bounds(rig, None)
    if "encoder" in kind.name and "TPDO" not in kind.name and "heartbeat" not in kind.name:
        way_m = 2.0 * bounds.frozen_m if "reversed" in kind.name else bounds.encoder_difference_m
        apart_s = FRESH_PERIODS * PERIOD_S * (2.0 if "reversed" in kind.name else 1.0)  # added to the bound, x speed
        # v^2 = speed^2 + 2 a (way + v apart)
        return full * apart_s + math.sqrt((full * apart_s) ** 2 + speed**2 + 2.0 * full * way_m)
    if "corrupted" in kind.name:
        return speed + full * PERIOD_S * (kind.cycles or 0)
    if kind.stalls:
        assert seen.injected is not None
        gains = rig.bench.gains
        held = abs(seen.ticks[seen.injected].held_torque_n_m) / gains.torque_limit_n_m * full
        return speed + held * command_deadline_s(rig.bench)
    return speed


def stopping_m(kind: Kind, rig: Rig, seen: Observed) -> float:
    """Longest way to rest, begin of the stop and ramp: from detection, or from the fault where the loop stalls."""
    speed = peak_speed_m_s(kind, rig, seen)
    deceleration = min(RAMP_M_S2, ACCELERATION_M_S2, ALONE_M_S2 if kind.coasts else RAMP_M_S2)
    begins_s = (ANSWER_S if kind.hears else WATCHDOG_S) + 2.0 * ACCELERATION_M_S2 / JERK_M_S3
    if kind.stalls:
        begins_s += command_deadline_s(rig.bench)
    return speed * begins_s + speed**2 / (2.0 * deceleration) + REST_M
