"""Edits of the measured torque of an axis whose control law is not known: the motion stays, what it takes is another.

An axis with the effect would have needed the edited torque for the recorded motion. So each edit is the law of the
effect solved for the torque of the motor, exact on every row where the axis moves.
"""

from collections.abc import Callable, Mapping
from math import inf, pi

import numpy as np

from hil.arrays import FloatArray
from hil.twin.mechanism import Mechanism
from hil.twin.mechanisms import (
    asymmetric_friction,
    cogging_torque,
    constant_load,
    external_force,
    friction_drift,
    load_dependent_friction,
    local_friction,
    local_torque_constant,
    nonlinear_viscous_friction,
    stribeck_friction,
    torque_constant_drift,
    torque_constant_gradient,
    torque_constant_saturation,
    torque_ripple,
)
from hil.validation.proof.conceal.edit import Edit, current_for
from hil.validation.proof.conceal.half import EditedChannel, Half, rigid

Rng = np.random.Generator
Drawn = Callable[[Half, Rng], Edit | None]  # None: this half cannot show it
_MOST = 0.5  # of the largest torque: largest change of an edit, 30 standard errors or less
_ORDERS = (4, 6, 8, 12, 18, 24, 36)  # of motors with 2 to 6 pole pairs
_HIGHEST = 2.0  # of the Coulomb friction: in a zone
_STEEPEST_M = 1e-3  # flank of a zone
_COMPRESSED = 0.5  # of the largest torque: level above which the measured torque is too small
MOMENTS = (0.25, 0.75)  # shares of the half between which a change lies
_SLOPED = 0.3  # of the torque constant: change at the farthest place
_CHANGED = 0.3  # of the torque constant, over the angle, time or a zone
_SATURATED = 0.25  # of the largest torque: torque per ampere that is lost there


def _peak(half: Half) -> float:
    return float(np.max(np.abs(half.torque)))


def _added(half: Half, shape: FloatArray, mechanism: Mechanism | None, most: float = inf, **more: object) -> Edit:
    """An edit that adds strength times a shape (n,) to the torque, of a strength up to `most`."""
    largest = min(_MOST * _peak(half) / max(float(np.max(np.abs(shape))), 1e-300), most)
    torque = half.torque
    return Edit(EditedChannel.TORQUE, lambda a: torque + a * shape, largest, mechanism, **more)  # type: ignore[arg-type]


def _offset(half: Half, rng: Rng) -> Edit:
    ones = np.ones(half.torque.size)
    return _added(half, ones, constant_load.MECHANISM, told=(0,), instead="offset", signed=True, adds=True)


def _by_direction(half: Half, rng: Rng) -> Edit | None:
    coulomb, viscous = half.plain["coulomb"], half.plain["viscous"]
    if not (coulomb.significant and viscous.significant and min(coulomb.value, viscous.value) > 0.0):
        return None
    shape = np.abs(half.moved.velocity) * viscous.value / coulomb.value
    return _added(half, shape, asymmetric_friction.MECHANISM, variant=1, signed=True)


def _by_speed(half: Half, rng: Rng) -> Edit | None:
    speed, coulomb = half.moved.velocity, half.plain["coulomb"].value
    fades = float(np.exp(rng.uniform(np.log(0.02), np.log(0.2)))) * float(np.max(np.abs(speed)))
    shape = np.exp(-((speed / fades) ** 2)) * half.moved.direction
    return _added(half, shape, stribeck_friction.MECHANISM, values=lambda a: (coulomb + a, fades), told=(1,))


def _by_square(half: Half, rng: Rng) -> Edit:
    speed = half.moved.velocity
    return _added(half, speed * np.abs(speed), nonlinear_viscous_friction.MECHANISM, told=(0,))


def _zone(half: Half, rng: Rng) -> tuple[tuple[float, float, float], FloatArray] | None:
    """Begin, end and flank [m] of a zone of the travel, and the share of it at each row (n,)."""
    at = half.position_m
    travel = float(np.ptp(at))
    width = travel * rng.uniform(0.15, 0.4)
    flank = 0.2 * width
    if flank < _STEEPEST_M:
        return None
    begin = float(np.min(at)) + rng.uniform(0.1, 0.5) * travel
    return (begin, begin + width, flank), np.clip(np.minimum(at - begin, begin + width - at) / flank + 0.5, 0.0, 1.0)


def _in_zone(half: Half, rng: Rng) -> Edit | None:
    coulomb, zone = half.plain["coulomb"], _zone(half, rng)
    if zone is None or not coulomb.significant or coulomb.value <= 0.0:
        return None
    edges, inside = zone

    def values(added: float) -> tuple[float, ...]:
        return added / coulomb.value, *edges

    most = _HIGHEST * coulomb.value
    return _added(half, inside * half.moved.direction, local_friction.MECHANISM, most, values=values, told=(1, 2))


def _windows(most: int) -> Drawn:
    def draw(half: Half, rng: Rng) -> Edit | None:
        if not rigid(half):  # on a load behind a spring, the encoders would show it too
            return None
        period_s, whole_s = half.recording.period_s, half.time_s[-1]
        length_s = whole_s * rng.uniform(0.04, 0.15 if most > 1 else 0.3)
        starts_s = np.sort(rng.uniform(0.05, 0.85, rng.integers(2, most + 1) if most > 1 else 1)) * whole_s
        over = np.zeros(half.torque.size)
        for start_s in starts_s:
            inside_s = np.minimum(start_s + length_s, half.time_s + period_s) - np.maximum(start_s, half.time_s)
            over = np.maximum(over, np.maximum(inside_s, 0.0) / period_s)
        told = (0,) if most == 1 else ()

        def values(force: float) -> tuple[float, ...]:
            return force, float(starts_s[0]), float(starts_s[0] + length_s)

        shape = -half.ratio * over  # a force forwards takes torque off the motor
        return _added(half, shape, external_force.MECHANISM, values=values, told=told, signed=True)

    return draw


def _warming(half: Half, rng: Rng) -> Edit | None:
    coulomb, viscous = half.plain["coulomb"], half.plain["viscous"]
    whole_s = half.time_s[-1]
    time_s = max(whole_s * rng.uniform(0.2, 1.0), 1.0)
    friction = coulomb.value * half.moved.direction + max(viscous.value, 0.0) * half.moved.velocity
    if not coulomb.significant or coulomb.value <= 0.0:
        return None
    shape = -np.expm1(-half.time_s / time_s) * friction
    return _added(half, shape, friction_drift.MECHANISM, 1.0, values=lambda a: (a, time_s))


def _wave(half: Half, rng: Rng) -> tuple[int, float, FloatArray] | None:
    """Order, phase [rad] and wave (n,) over the motor angle that the travel holds and the rows resolve."""
    angle, physics = half.angle_rad, half.bench.axis.physics()
    order, phase = int(rng.choice(_ORDERS)), float(rng.uniform(-pi, pi))
    fastest = float(np.quantile(np.abs(np.diff(angle)), 0.5))
    if not physics.turn_known or order * np.ptp(angle) < 4.0 * pi or order * fastest > 0.5 * pi:
        return None
    return order, phase, np.sin(order * angle + phase)


def _cogging(half: Half, rng: Rng) -> Edit | None:
    found = _wave(half, rng)
    if found is None:
        return None
    order, phase, wave = found
    return _added(half, -wave, cogging_torque.MECHANISM, values=lambda a: (a, order, phase), told=(0, 2))


def _rippling(half: Half, rng: Rng) -> Edit | None:
    found = _wave(half, rng)
    if found is None:
        return None
    order, phase, wave = found
    return _scaled(half, wave, torque_ripple.MECHANISM, lambda a: (a, order, phase), (0, 2))


def _scaled(
    half: Half,
    shape: FloatArray,
    mechanism: Mechanism,
    values: Callable[[float], tuple[float, ...]],
    told: tuple[int, ...],
) -> Edit:
    """A torque per ampere that differs by up to `_CHANGED` times a shape (n,) of -1 to 1."""
    torque = half.torque
    return Edit(EditedChannel.TORQUE, lambda a: torque / (1.0 + a * shape), _CHANGED, mechanism, values, told=told)


def _constant_fades(half: Half, rng: Rng) -> Edit:
    time_s = max(half.time_s[-1] * rng.uniform(0.2, 1.0), 1.0)
    shape = np.expm1(-half.time_s / time_s)
    return _scaled(half, shape, torque_constant_drift.MECHANISM, lambda a: (-a, time_s), (0,))


def _constant_in_zone(half: Half, rng: Rng) -> Edit | None:
    zone = _zone(half, rng)
    if zone is None or half.ratio != 1.0:
        return None
    edges, inside = zone
    return _scaled(half, -inside, local_torque_constant.MECHANISM, lambda a: (-a, *edges), (0, 1, 2))


def _along_the_travel(half: Half, rng: Rng) -> Edit | None:
    torque, at = half.torque, half.position_m
    mechanism, farthest_m = torque_constant_gradient.MECHANISM, float(np.max(np.abs(at)))
    if farthest_m == 0.0:
        return None
    largest = min(_SLOPED / farthest_m, mechanism.parameters[0].high)
    return Edit(EditedChannel.TORQUE, lambda a: torque / (1.0 + a * at), largest, mechanism, told=(0,), signed=True)


def _saturating(half: Half, rng: Rng) -> Edit:
    torque, largest = half.torque, _SATURATED / _peak(half) ** 2 / 2.0
    return Edit(
        EditedChannel.TORQUE, lambda c: current_for(torque, c), largest, torque_constant_saturation.MECHANISM, told=(0,)
    )


def _compressed(half: Half, rng: Rng) -> Edit:
    torque, level = half.torque, _COMPRESSED * _peak(half)
    above = np.sign(torque) * np.maximum(np.abs(torque) - level, 0.0)
    return Edit(EditedChannel.TORQUE, lambda a: torque - a * above, 0.9, None)


def _by_load(half: Half, rng: Rng) -> Edit:
    coulomb, viscous = half.plain["coulomb"].value, max(half.plain["viscous"].value, 0.0)
    load = half.torque - coulomb * half.moved.direction - viscous * half.moved.velocity
    return _added(half, np.abs(load) * half.moved.direction, load_dependent_friction.MECHANISM, 0.5, told=(0,))


def _ramp(half: Half, rng: Rng) -> Edit:
    return _added(half, half.time_s / half.time_s[-1], None, signed=True)


def _from_a_moment(half: Half, rng: Rng, shape: FloatArray) -> Edit:
    moment_s = float(half.time_s[-1] * rng.uniform(*MOMENTS))
    return _added(half, shape * (half.time_s >= moment_s), None, signed=True, moment_s=moment_s)


def _load_changes(half: Half, rng: Rng) -> Edit | None:
    return _from_a_moment(half, rng, half.moved.acceleration) if half.plain["inertia"].significant else None


def _friction_changes(half: Half, rng: Rng) -> Edit | None:
    return _from_a_moment(half, rng, half.moved.direction) if half.plain["coulomb"].significant else None


def _other_constant(half: Half, rng: Rng) -> Edit | None:
    torque, inertia = half.torque, half.plain["inertia"]
    if not inertia.significant:
        return None
    error = inertia.std_error / abs(inertia.value)
    return Edit(EditedChannel.TORQUE, lambda a: (1.0 + a) * torque, 0.5, signed=True, error=error)


TORQUE_EDITS: Mapping[str, Drawn] = {
    "offset": _offset,
    "friction by direction": _by_direction,
    "friction by speed": _by_speed,
    "friction by the square of speed": _by_square,
    "friction in a zone": _in_zone,
    "friction over time": _warming,
    "force in a window": _windows(1),
    "force in windows": _windows(3),
    "torque over the angle": _cogging,
    "torque constant over the angle": _rippling,
    "torque constant over the travel": _along_the_travel,
    "torque constant in a zone": _constant_in_zone,
    "torque constant over time": _constant_fades,
    "torque constant over current": _saturating,
    "current compressed": _compressed,
    "friction by load": _by_load,
    "ramp": _ramp,
    "another torque constant": _other_constant,
    "load from a moment on": _load_changes,
    "friction from a moment on": _friction_changes,
}
