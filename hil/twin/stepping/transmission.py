"""Forces of the transmission beside its nominal spring: lead errors, play, soft zones, a screw of varying stiffness.

On a rigid axis no spring gives way: the table is where the transmission is not deflected, and rests in a gap.
"""

from typing import NamedTuple

from numba import njit

from hil.twin.mechanism import Moment
from hil.twin.stepping import stages
from hil.twin.stepping.contact import COMPILE

_transmission, _screw = stages.transmission, stages.screw
NUDGE = 1e-9  # of the deflection [motor units], to measure the local stiffness
FOLLOWS = 20  # steps in which a table follows its motor: one for a lead error or a flank, more for a soft zone


class AxisMotion(NamedTuple):
    """AxisMotion of motor, table and transmission spring, in motor units."""

    position: float
    speed: float
    table: float
    table_speed: float
    stretch: float
    stretch_rate: float


class Force(NamedTuple):
    """Forces on the modes: through the shapes of spring, damper and screw, and of the motor."""

    spring: float
    damper: float
    screw: float
    motor: float


@njit(**COMPILE)
def along(shape, values):  # type: ignore[no-untyped-def]
    """Modal values (n,) seen at one place of the chain."""
    total = 0.0
    for i in range(shape.size):
        total += shape[i] * values[i]
    return total


@njit(**COMPILE)
def moment(c, time, within, step, position, speed, table_m):  # type: ignore[no-untyped-def]
    """Present state of the axis for the contributions; `position` in motor units."""
    angle = position * c.angle_per_unit
    return Moment(time, within, c.period, step, angle, speed, table_m, c.ratio, c.viscous_speed, 0.0)


@njit(**COMPILE)
def turned(at, angle_rad):  # type: ignore[no-untyped-def]
    """The same moment with the motor turned further."""
    angle = at.angle_rad + angle_rad
    return Moment(
        at.time_s,
        at.within_s,
        at.period_s,
        at.step_s,
        angle,
        at.velocity,
        at.table_position_m,
        at.ratio_m,
        at.viscous_speed,
        at.torque,
    )


@njit(_nrt=False, forceinline=True, **COMPILE)
def transmit(c, own, shapes, motion, at, effects, delta):  # type: ignore[no-untyped-def]
    """Forces on the modes at the middle of a step, and whether the table floats in a gap."""
    h = at.step_s
    spring = damped = screw = motor = 0.0
    bent = effective = motion.stretch + 0.5 * h * motion.stretch_rate
    if effects.codes.transmission:
        effective = _transmission(bent, at, effects)
        extra = effective - bent
        floating = effective == 0.0
        apart = along(shapes.damper, delta[1]) / c.damper if c.damper > 0.0 else 0.0
        rate = -apart if floating else (extra - own.spring_extra) / h
        if c.always_fine > 0 and not floating:
            # damping acts on the relative velocity of the sides: correct the rate by the local stiffness ratio
            softer = (_transmission(bent + NUDGE, at, effects) - effective) / NUDGE - 1.0
            rate += softer * (apart - motion.stretch_rate)
        own.floating = 1.0 if floating else 0.0
        own.spring_extra = extra
        spring = -c.spring * extra
        damped = -rate
        pressing = c.spring * effective + c.damper * (apart + rate)
        if c.play > 0 and not floating and pressing * effective < 0.0:  # flanks with play push, they do not pull
            spring += c.spring * effective
            damped += apart + rate
            pressing = 0.0
        # an error of the transmission over the angle varies its ratio: the motor feels what it carries by that, too
        further = _transmission(bent, turned(at, NUDGE * c.angle_per_unit), effects)
        motor = -pressing * (further - effective) / NUDGE
    if effects.codes.screw:
        if c.screw_apart > 0:
            effective = along(shapes.screw, delta[0]) + 0.5 * h * along(shapes.screw, delta[1])
        screw = -c.screw * effective * (_screw(1.0, at, effects) - 1.0)
    return Force(spring, damped, screw, motor)


@njit(**COMPILE)
def follow(own, position, at, effects):  # type: ignore[no-untyped-def]
    """Position of the table of a rigid axis [motor units], which friction holds in a gap: hysteresis of play.

    M. Brokate and J. Sprekels, Hysteresis and Phase Transitions, 1996, section 2.1.
    """
    for _ in range(FOLLOWS):
        effective = _transmission(position - own.carried, at, effects)
        if effective == 0.0:
            break
        own.carried += effective
    return own.carried
