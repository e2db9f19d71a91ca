"""Friction torques of motor and table over one internal step, with the mechanisms that change them."""

from numba import njit

from hil.twin.mechanism import Moment
from hil.twin.stepping import contact, stages
from hil.twin.stepping.contact import COMPILE, Resistance

_coulomb, _friction_scale, _drag = stages.coulomb, stages.friction_scale, stages.drag
_bias, _bristle, _table_share = stages.bias, stages.bristle, stages.table_share
_table_viscous_share, _viscous_scale = stages.table_viscous_share, stages.viscous_scale
_rigid, _elastic, _slipping = contact.rigid, contact.elastic, contact.slipping


@njit(**COMPILE)
def under(at, torque, speed):  # type: ignore[no-untyped-def]
    """Change torque and speed of a moment."""
    return Moment(
        at.time_s,
        at.within_s,
        at.period_s,
        at.step_s,
        at.angle_rad,
        speed,
        at.table_position_m,
        at.ratio_m,
        at.viscous_speed,
        torque,
    )


@njit(_nrt=False, forceinline=True, **COMPILE)
def level(c, scale, viscous, at, effects):  # type: ignore[no-untyped-def]
    """Coulomb friction and drag at the speed of the moment, whose torque is that of the motor."""
    drag = scale * _drag(0.0, at, effects)
    loaded = under(at, at.torque - viscous * at.velocity - drag, at.velocity)
    return scale * max(_coulomb(c.coulomb, loaded, effects), 0.0), drag


@njit(_nrt=False, forceinline=True, **COMPILE)
def _contact(slips, free, gain, resistance, stiffness, elements, step, before):  # type: ignore[no-untyped-def]
    """Friction torque of one contact that meets velocity `free`; `elements` (ELEMENTS,) is its memory."""
    if stiffness <= 0.0:
        return _rigid(free, gain, resistance)
    if slips > 0:
        return _slipping(free, gain, resistance, stiffness, elements, step, before)
    torque, elements[0] = _elastic(free, gain, resistance, stiffness, elements[0], step, before)
    return torque


@njit(_nrt=False, forceinline=True, **COMPILE)
def friction(c, own, internal, motion, at, effects, free, table_free):  # type: ignore[no-untyped-def]
    """Friction torques on motor and table, which without friction would have velocities `free` and `table_free`.

    A contact that yields before it slides does so on either side, as stiff as its share of the friction.
    """
    gain = internal.motor_gain
    shift = _bias(0.0, at, effects)
    share = _table_share(0.0, at, effects)
    stiffness = _bristle(0.0, at, effects)
    scale = max(_friction_scale(1.0, at, effects), 0.0)
    viscous_share = _table_viscous_share(share, at, effects)
    every, rest = scale * max(_viscous_scale(1.0, at, effects), 0.0) * c.viscous, 1.0 - share
    viscous, guide_viscous = (1.0 - viscous_share) * every, viscous_share * every
    bound, opposing = level(c, scale, every, at, effects)
    if effects.codes.coulomb or effects.codes.drag:  # at the middle of the step friction over speed is second order
        met = _rigid(free, gain, Resistance(rest * bound, viscous, shift, rest * opposing))
        bound, opposing = level(
            c, scale, every, under(at, at.torque, 0.5 * (motion.speed + free - gain * met)), effects
        )
    resistance = Resistance(rest * bound, viscous, shift, rest * opposing)
    motor = _contact(c.slips, free, gain, resistance, rest * stiffness, own.motor_contact, at.step_s, motion.speed)
    guide = 0.0
    if share > 0.0 or viscous_share > 0.0:
        met, gain, opposing = table_free - internal.cross_gain * motor, internal.table_gain, 0.0
        if effects.codes.drag:  # at the table's own speed: at the motor's it would drive a table that swings
            guide = _rigid(met, gain, Resistance(share * bound, guide_viscous, 0.0, 0.0))
            speed = 0.5 * (motion.table_speed + met - gain * guide)
            opposing = scale * _drag(0.0, under(at, at.torque, speed), effects)
        # a torque that differs by direction, alike at every speed, is a load and stays on the motor
        resistance = Resistance(share * bound, guide_viscous, 0.0, share * opposing)
        guide = _contact(
            c.slips, met, gain, resistance, share * stiffness, own.table_contact, at.step_s, motion.table_speed
        )
    return motor, guide
