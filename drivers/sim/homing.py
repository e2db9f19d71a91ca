"""Homing runs inside a simulated drive, as pure steps from cycle to cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

from drivers.sim.drive_loops import ramp


class HomingMethod(IntEnum):
    """Homing methods of CiA 402 that the drive offers."""

    INDEX_NEGATIVE = 33  # next index pulse in negative direction
    INDEX_POSITIVE = 34  # next index pulse in positive direction
    CURRENT_POSITION = 37  # where it stands


@dataclass(frozen=True, slots=True)
class Homing:
    """A homing run; counts as the motor encoder counts them. Index pulses lie at multiples of counts_per_rev.

    attained: the reference is found (bit 12); done: and the axis is at rest (bit 10).
    """

    method: HomingMethod
    speed: float  # counts/s, > 0
    acceleration: float  # counts/s^2
    counts_per_rev: int
    started: bool = False
    velocity: float = 0.0
    reference: int = 0
    attained: bool = False
    done: bool = False


def step_homing(run: Homing, counts: int, previous_counts: int, period_s: float) -> Homing:
    """One cycle: from the encoder's counts to the velocity to follow. The first cycle reports "in progress"."""
    if run.done:
        return run
    if not run.started:
        return replace(run, started=True)
    if run.method is HomingMethod.CURRENT_POSITION:
        return replace(run, attained=True, done=True, reference=counts)
    direction = -1 if run.method is HomingMethod.INDEX_NEGATIVE else 1
    if not run.attained:
        first, last = sorted((previous_counts, counts))
        index = -(-(first + 1) // run.counts_per_rev) * run.counts_per_rev  # first multiple above `first`
        if index <= last:
            run = replace(run, attained=True, reference=index)
    wanted = 0.0 if run.attained else direction * run.speed
    velocity = ramp(run.velocity, wanted, run.acceleration, period_s)
    at_rest = run.attained and velocity == 0.0 and abs(counts - previous_counts) <= run.speed * period_s * 0.01
    return replace(run, velocity=velocity, done=at_rest)
