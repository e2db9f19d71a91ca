"""The loops inside a simulated drive at work on its plant: what they follow, step by step, and stop ramps."""

from __future__ import annotations

import math

from drivers.port import PlantLike, ServoLike, ServoTarget

_LOOP_PERIOD_S = 0.001  # of the servo, where the SYNC is slower
_AT_REST_RAD_S = 0.5  # a stop ramp has ended


def ramp(velocity: float, wanted: float, acceleration: float, period_s: float) -> float:
    """Velocity one period later, changed by at most acceleration x period (any consistent units)."""
    step = acceleration * period_s
    return wanted if abs(wanted - velocity) <= step else velocity + math.copysign(step, wanted - velocity)


class DriveLoops:
    """servo None: the drive has no loops of its own; whatever it should follow, its motor coasts."""

    def __init__(self, plant: PlantLike, servo: ServoLike | None) -> None:
        self._plant, self._servo = plant, servo
        self._velocity_rad_s = 0.0  # of the stop ramp

    @property
    def closed(self) -> bool:
        """Whether there are loops to close."""
        return self._servo is not None

    def start(self, velocity_rad_s: float) -> None:
        """Begin to follow, from where the motor is and, if it is to stop, from its velocity."""
        self._velocity_rad_s = velocity_rad_s
        if self._servo is not None:
            self._servo.reset(self._plant.motor_position_rad)

    def stop_target(self, deceleration_rad_s2: float, velocity_rad_s: float, period_s: float) -> ServoTarget | None:
        """Next point of the stop ramp; None when the motor rests, or cannot be braked."""
        self._velocity_rad_s = ramp(self._velocity_rad_s, 0.0, deceleration_rad_s2, period_s)
        resting = self._velocity_rad_s == 0.0 and abs(velocity_rad_s) < _AT_REST_RAD_S
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
