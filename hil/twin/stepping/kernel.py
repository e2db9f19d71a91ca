"""The compiled step of the twin: modal states, friction, active mechanisms; and what its encoders read.

Each internal step h moves every modal oscillator exactly under the torques held over the step
(Eq. 8 of the source), then lets contact friction act as an impulse (`hil.twin.stepping.contact`).
Position-dependent torques are taken at the predicted middle of the step, which makes them second order. While the
motor is slow the step is fine, for the reversals; else it is coarse.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from hil.compiled.source_digest import source_digest
from hil.twin.mechanism import Moment
from hil.twin.stepping import contact, layout, stages

_current, _torque, _motor_torque = stages.current, stages.torque, stages.motor_torque
_coulomb, _friction_scale, _drag = stages.coulomb, stages.friction_scale, stages.drag
_bias, _bristle, _table_share = stages.bias, stages.bristle, stages.table_share
_transmission, _screw, _table_force = stages.transmission, stages.screw, stages.table_force
_motor_reading, _table_reading = stages.motor_reading, stages.table_reading
_contact, _bristle_contact, _slipping_contact = contact.rigid, contact.elastic, contact.slipping
# A motor slower than this sticks: what is left of its speed is rounding, which no step size may hang on.
RESTING = 1e-9
NUDGE = 1e-9  # of the deflection [motor units], to see its stiffness
# `_nrt=False` below leaves out the counting of references to arrays, `forceinline` the handing over of arrays:
# both cost more than the mathematics of a step.
_COMPILE = contact.COMPILE


@njit(**_COMPILE)
def along(shape, values):  # type: ignore[no-untyped-def]
    """Modal values (n,) seen at one place of the chain."""
    total = 0.0
    for i in range(shape.size):
        total += shape[i] * values[i]
    return total


@njit(**_COMPILE)
def _look(at_motor, at_table, at_spring, positions, velocities):  # type: ignore[no-untyped-def]
    """Position and velocity of motor, table and transmission spring."""
    position = speed = table = table_speed = stretch = stretch_rate = 0.0
    for i in range(positions.size):
        d, v = positions[i], velocities[i]
        position += at_motor[i] * d
        speed += at_motor[i] * v
        table += at_table[i] * d
        table_speed += at_table[i] * v
        stretch += at_spring[i] * d
        stretch_rate += at_spring[i] * v
    return position, speed, table, table_speed, stretch, stretch_rate


def _build_advance(digest: str) -> Any:
    @njit(cache=True, nogil=True, _nrt=False, forceinline=True, **_COMPILE)
    def advance(command, constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """Move the axis by one control period under a held torque command; mean measured torque."""
        assert digest
        n = delta.shape[1]
        own = memory[layout.OWN]
        ratio, period, damper = constants[layout.RATIO], constants[layout.PERIOD], constants[layout.DAMPER]
        at_motor, at_table, at_spring = modes[layout.SHAPE_MOTOR], modes[layout.SHAPE_TABLE], modes[layout.SHAPE_SPRING]
        at_screw, at_damper = modes[layout.SHAPE_SCREW], modes[layout.SHAPE_DAMPER]
        positions, velocities = delta[0], delta[1]
        any_on = codes[layout.ON_ANY] > 0
        position = table = table_speed = stretch = stretch_rate = 0.0
        if any_on:
            position, speed, table, table_speed, stretch, stretch_rate = _look(
                at_motor, at_table, at_spring, positions, velocities
            )
        else:
            speed = along(at_motor, velocities)
        reversing = abs(speed) < constants[layout.SLOW_VELOCITY] + 2.0 * abs(speed - own[layout.LAST_SPEED])
        fine = constants[layout.ALWAYS_FINE] > 0.0 or (reversing and abs(speed) > RESTING)
        own[layout.LAST_SPEED] = speed
        first = layout.FINE if fine else layout.COARSE
        steps = int(constants[layout.FINE_STEPS]) if fine else int(constants[layout.COARSE_STEPS])
        h = period / steps
        gains = layout.FINE_GAINS if fine else layout.COARSE_GAINS
        gain, cross, table_gain = constants[gains], constants[gains + 1], constants[gains + 2]
        from_position, from_velocity, from_torque = modes[first], modes[first + 1], modes[first + 4]
        rate_position, rate_velocity, rate_torque = modes[first + 2], modes[first + 3], modes[first + 5]
        measured = 0.0
        for j in range(steps):
            at = Moment(
                own[layout.CLOCK] + j * h,
                j * h,
                period,
                h,
                (position + 0.5 * h * speed) * constants[layout.ANGLE_PER_UNIT],
                speed,
                (table + 0.5 * h * table_speed) * ratio,
                ratio,
                constants[layout.VISCOUS_SPEED],
            )
            made = command
            if codes[layout.ON_CURRENT]:
                made = _current(made, at, values, codes, memory)
            measured += made
            drive = made
            if codes[layout.ON_TORQUE]:
                drive = _torque(drive, at, values, codes, memory)
            if codes[layout.ON_MOTOR_TORQUE]:
                drive = _motor_torque(drive, at, values, codes, memory)
            push = 0.0
            if codes[layout.ON_TABLE_FORCE]:
                push = _table_force(0.0, at, values, codes, memory) * ratio
            spring = damped = screw = 0.0
            bent = effective = stretch + 0.5 * h * stretch_rate
            if codes[layout.ON_TRANSMISSION]:
                effective = _transmission(bent, at, values, codes, memory)
                extra = effective - bent
                floating = effective == 0.0
                apart = along(at_damper, velocities) / damper if damper > 0.0 else 0.0
                rate = -apart if floating else (extra - own[layout.SPRING_EXTRA]) / h
                if constants[layout.ALWAYS_FINE] > 0.0 and not floating:
                    # what of it comes of the spring's bending counts as the sides move apart
                    softer = (_transmission(bent + NUDGE, at, values, codes, memory) - effective) / NUDGE - 1.0
                    rate += softer * (apart - stretch_rate)
                own[layout.FLOATING] = 1.0 if floating else 0.0
                own[layout.SPRING_EXTRA] = extra
                spring = -constants[layout.SPRING] * extra
                damped = -rate
                if constants[layout.PLAY] > 0.0 and not floating:
                    pressing = constants[layout.SPRING] * effective + damper * (apart + rate)
                    if pressing * effective < 0.0:  # flanks with play push, they do not pull
                        spring += constants[layout.SPRING] * effective
                        damped += apart + rate
            if codes[layout.ON_SCREW]:
                if constants[layout.SCREW_APART] > 0.0:
                    effective = along(at_screw, positions) + 0.5 * h * along(at_screw, velocities)
                screw = -constants[layout.SCREW] * effective * (_screw(1.0, at, values, codes, memory) - 1.0)

            free = table_free = 0.0
            if any_on:
                for i in range(n):
                    g = (
                        at_motor[i] * drive
                        + at_table[i] * push
                        + at_spring[i] * spring
                        + at_damper[i] * damped
                        + at_screw[i] * screw
                    )
                    if codes[layout.ON_COUPLING]:
                        g -= along(modes[layout.COUPLING + i], velocities)
                    d, v = positions[i], velocities[i]
                    positions[i] = from_position[i] * d + from_velocity[i] * v + from_torque[i] * g
                    moved = rate_position[i] * d + rate_velocity[i] * v + rate_torque[i] * g
                    velocities[i] = moved
                    free += at_motor[i] * moved
                    table_free += at_table[i] * moved
            else:
                for i in range(n):
                    g = at_motor[i] * drive
                    d, v = positions[i], velocities[i]
                    positions[i] = from_position[i] * d + from_velocity[i] * v + from_torque[i] * g
                    moved = rate_position[i] * d + rate_velocity[i] * v + rate_torque[i] * g
                    velocities[i] = moved
                    free += at_motor[i] * moved

            viscous, bound, opposing = constants[layout.VISCOUS], constants[layout.COULOMB], 0.0
            shift = share = stiffness = 0.0
            if codes[layout.ON_BIAS]:
                shift = _bias(0.0, at, values, codes, memory)
            if codes[layout.ON_TABLE_SHARE]:
                share = _table_share(0.0, at, values, codes, memory)
            rest = 1.0 - share
            if codes[layout.ON_BRISTLE]:
                stiffness = _bristle(0.0, at, values, codes, memory)
            scale = 1.0
            if codes[layout.ON_FRICTION_SCALE]:
                scale = max(_friction_scale(1.0, at, values, codes, memory), 0.0)
                viscous *= scale
            # Friction that depends on speed is taken at the middle of the step, where it is second order.
            passes = 2 if codes[layout.ON_COULOMB] or codes[layout.ON_DRAG] else 1
            for _ in range(passes):
                bound = constants[layout.COULOMB]
                if codes[layout.ON_COULOMB]:
                    bound = max(_coulomb(bound, at, values, codes, memory), 0.0)
                bound *= scale
                if codes[layout.ON_DRAG]:
                    opposing = scale * _drag(0.0, at, values, codes, memory)
                if passes == 2:
                    met = _contact(free, gain, rest * bound, rest * viscous, shift, rest * opposing)
                    at = Moment(
                        at.time_s,
                        at.within_s,
                        at.period_s,
                        at.step_s,
                        at.angle_rad,
                        0.5 * (speed + free - gain * met),
                        at.table_position_m,
                        at.ratio_m,
                        at.viscous_speed,
                    )
            if stiffness > 0.0 and constants[layout.SLIPS] > 0.0:
                friction = _slipping_contact(
                    free,
                    gain,
                    rest * bound,
                    rest * viscous,
                    shift,
                    rest * opposing,
                    stiffness,
                    own[layout.SLIP_ELEMENTS :],
                    h,
                    speed,
                )
            elif stiffness > 0.0:
                friction, own[layout.BRISTLE_DEFLECTION] = _bristle_contact(
                    free,
                    gain,
                    rest * bound,
                    rest * viscous,
                    shift,
                    rest * opposing,
                    stiffness,
                    own[layout.BRISTLE_DEFLECTION],
                    h,
                    speed,
                )
            else:
                friction = _contact(free, gain, rest * bound, rest * viscous, shift, rest * opposing)
            guide = 0.0
            if share > 0.0:
                met, opposing = table_free - cross * friction, 0.0
                if codes[layout.ON_DRAG]:  # at the table's own speed: at the motor's it would drive one that swings
                    guide = _contact(met, table_gain, share * bound, share * viscous, 0.0, 0.0)
                    at = Moment(
                        at.time_s,
                        at.within_s,
                        at.period_s,
                        at.step_s,
                        at.angle_rad,
                        0.5 * (table_speed + met - table_gain * guide),
                        at.table_position_m,
                        at.ratio_m,
                        at.viscous_speed,
                    )
                    opposing = scale * _drag(0.0, at, values, codes, memory)
                # a torque that differs by direction, alike at every speed, stays on the motor: there it is a load
                guide = _contact(met, table_gain, share * bound, share * viscous, 0.0, share * opposing)

            for i in range(n):
                g = at_motor[i] * friction + at_table[i] * guide
                positions[i] -= from_torque[i] * g
                velocities[i] -= rate_torque[i] * g
            if any_on and j + 1 < steps:
                position, speed, table, table_speed, stretch, stretch_rate = _look(
                    at_motor, at_table, at_spring, positions, velocities
                )
        own[layout.CLOCK] += period
        return measured / steps

    return advance


def _build_read(digest: str) -> Any:
    @njit(cache=True, nogil=True, _nrt=False, forceinline=True, **_COMPILE)
    def read(constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """What the two encoders read: motor position (rad, or m) and table position (m)."""
        assert digest
        position = table = 0.0
        for i in range(delta.shape[1]):
            position += modes[layout.SHAPE_MOTOR, i] * delta[0, i]
            table += modes[layout.SHAPE_TABLE, i] * delta[0, i]
        table *= constants[layout.RATIO]
        if codes[layout.ON_MOTOR_READING] or codes[layout.ON_TABLE_READING]:
            at = Moment(
                memory[layout.OWN, layout.CLOCK],
                0.0,
                constants[layout.PERIOD],
                0.0,
                position * constants[layout.ANGLE_PER_UNIT],
                0.0,
                table,
                constants[layout.RATIO],
                constants[layout.VISCOUS_SPEED],
            )
            if codes[layout.ON_MOTOR_READING]:
                position = _motor_reading(position, at, values, codes, memory)
            if codes[layout.ON_TABLE_READING]:
                table = _table_reading(table, at, values, codes, memory)
        return position, table

    return read


# Bound into each kernel, so that numba's cache knows when a source compiled into it has changed.
_DIGEST = source_digest()
advance = _build_advance(_DIGEST)
read = _build_read(_DIGEST)
