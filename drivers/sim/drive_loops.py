"""Motion inside a simulated drive: its control loops on the plant, stop ramps, and homing step by step."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum

from drivers.object_index import ObjectIndex as Index
from drivers.port import PlantLike, ServoLike, ServoTarget

_LOOP_PERIOD_S = 0.001  # of the servo, if the SYNC period is longer
_AT_REST_RAD_S = 0.5  # below it a stop ramp ends: 5 rpm
_AT_REST_S = 1e-3  # of the ramp, if that is less: on a linear axis half a metre per second is no rest


def ramp(velocity: float, wanted: float, acceleration: float, period_s: float) -> float:
    """Velocity one period later, changed by at most acceleration x period (any consistent units)."""
    step = acceleration * period_s
    return wanted if abs(wanted - velocity) <= step else velocity + math.copysign(step, wanted - velocity)


class DriveLoops:
    """Control loops and stop ramp of the drive. servo None: no loops; the torque is zero and the motor coasts."""

    def __init__(self, plant: PlantLike, servo: ServoLike | None) -> None:
        self._plant, self._servo = plant, servo
        self._velocity_rad_s = 0.0  # of the stop ramp

    @property
    def closed(self) -> bool:
        """True if the drive has loops of its own."""
        return self._servo is not None

    def start(self, velocity_rad_s: float) -> None:
        """Reset the loops at the present motor position, and the stop ramp at this velocity."""
        self._velocity_rad_s = velocity_rad_s
        if self._servo is not None:
            self._servo.reset(self._plant.motor_position_rad)

    def stop_target(self, deceleration_rad_s2: float, velocity_rad_s: float, period_s: float) -> ServoTarget | None:
        """Next point of the stop ramp; None if the motor is at rest or there is no servo to brake it."""
        self._velocity_rad_s = ramp(self._velocity_rad_s, 0.0, deceleration_rad_s2, period_s)
        at_rest = min(_AT_REST_RAD_S, _AT_REST_S * deceleration_rad_s2)
        resting = self._velocity_rad_s == 0.0 and abs(velocity_rad_s) < at_rest
        return None if resting or self._servo is None else ServoTarget(self._velocity_rad_s)

    def advance(self, target: ServoTarget | None, period_s: float, limit_n_m: float) -> float:
        """Move the plant by one period; mean measured torque [N m]. target None: power stage off."""
        plant, servo = self._plant, self._servo
        steps = max(1, round(period_s / _LOOP_PERIOD_S))
        step_s = period_s / steps
        mean_n_m = 0.0
        for step in range(1, steps + 1):
            torque_n_m = 0.0
            if servo is not None and target is not None:
                position_rad = target.position_rad
                if position_rad is not None:  # set-points of the bus, linear between the SYNCs
                    position_rad -= target.velocity_rad_s * (steps - step) * step_s
                inner = ServoTarget(target.velocity_rad_s, position_rad)
                torque_n_m = servo.torque(inner, plant.motor_position_rad, step_s)
            plant.advance(max(-limit_n_m, min(limit_n_m, torque_n_m)), step_s)
            mean_n_m += plant.torque_n_m / steps
        return mean_n_m


class HomingMethod(IntEnum):
    """Homing methods of CiA 402 that the drive offers."""

    INDEX_NEGATIVE = 33  # next index pulse in negative direction
    INDEX_POSITIVE = 34  # next index pulse in positive direction
    CURRENT_POSITION = 37  # the present position


@dataclass(frozen=True, slots=True)
class Homing:
    """A homing run in counts of the motor encoder. Index pulses lie at multiples of counts_per_rev.

    attained: the reference is found (bit 12); done: the axis is also at rest (bit 10).
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


def new_homing(number: Callable[..., int], counts_per_rev: int) -> Homing:
    """Begin a homing run as the objects 0x6098, 0x6099:2 and 0x609A say; number: reads an object."""
    method, speed = HomingMethod(number(Index.HOMING_METHOD)), number(Index.HOMING_SPEEDS, 2)
    return Homing(method, speed, number(Index.HOMING_ACCELERATION), counts_per_rev)


def step_homing(run: Homing, counts: int, previous_counts: int, period_s: float) -> Homing:
    """Advance homing by one cycle: encoder counts in, velocity target out. The first cycle reports "in progress"."""
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
