"""The compiled stepping kernel: modal states, friction, active mechanisms, controller.

Each internal step h moves every modal oscillator exactly under the torques held over the step
(Eq. 8 of the source), then lets contact friction act as an impulse (`hil.twin.contact`).
Position-dependent torques are taken at the predicted middle of the step, which makes them second order. While the
motor is slow the step is fine, for the reversals; else it is coarse.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from hil import control
from hil.twin import contact, stages
from hil.twin.library import SLOTS
from hil.twin.mechanism import Moment

# Rows of `modes` (MODE_ROWS, n): exact discretisation for the coarse and the fine step, then shapes.
COARSE, FINE, SHAPE_MOTOR, SHAPE_TABLE, SHAPE_SPRING, SHAPE_SCREW, TABLE_IMPULSE, MOTOR_IMPULSE, MODE_ROWS = (
    0, 6, 12, 13, 14, 15, 16, 17, 18)

# Entries of `constants`.
(PERIOD, RATIO, ANGLE_PER_UNIT, COULOMB, VISCOUS, SPRING, DAMPER, COARSE_STEPS, FINE_STEPS, SLOW_VELOCITY,
 ALWAYS_FINE, OBSERVER, PLAY, VISCOUS_SPEED, SCREW, SCREW_APART, COARSE_GAINS, FINE_GAINS, CONSTANTS) = (
    *range(17), 19, 22)

# Entries of `codes`: variant + 1 of the mechanism in each slot (0: off), then whether each stage is entered.
(ON_CURRENT, ON_TORQUE, ON_MOTOR_TORQUE, ON_COULOMB, ON_FRICTION_SCALE, ON_DRAG, ON_BIAS, ON_BRISTLE,
 ON_TABLE_SHARE, ON_TRANSMISSION, ON_SCREW, ON_TABLE_FORCE, ON_MOTOR_READING, ON_TABLE_READING, ON_ANY, CODES) = range(
    len(SLOTS), len(SLOTS) + 16)

# Rows of `memory` (slots + 1, WIDTH): each mechanism's own, then the kernel's.
OWN = len(SLOTS)
CLOCK, BRISTLE_DEFLECTION, SPRING_EXTRA, FLOATING, LAST_SPEED = range(5)

_current, _torque, _motor_torque = stages.current, stages.torque, stages.motor_torque
_coulomb, _friction_scale, _drag, _bias = stages.coulomb, stages.friction_scale, stages.drag, stages.bias
_bristle, _table_share, _transmission = stages.bristle, stages.table_share, stages.transmission
_screw, _table_force = stages.screw, stages.table_force
_motor_reading, _table_reading = stages.motor_reading, stages.table_reading
# Time constant of the observer that holds a floating table: long against a 2 ms table-encoder count at creep,
# short against a flight through the gap (tens of ms).
OBSERVER_S = 0.008
# Time constant with which the replayed integrator follows the recorded command: slow against every filter or delay.
INTEGRATOR_S = 0.1

_control_step = control.step
_contact, _bristle_contact = contact.rigid, contact.elastic
# A motor slower than this sticks: what is left of its speed is rounding, which no step size may hang on.
RESTING = 1e-9
SETTLING = 80           # halvings in which the table comes to rest at the start, of
STROKE = 10.0           # so much deflection [motor units]: more than any play
# `_nrt=False` below leaves out the counting of references to arrays, `forceinline` the handing over of arrays:
# both cost more than the mathematics of a step.
_COMPILE = contact.COMPILE


@njit(**_COMPILE)
def _along(shape, values):  # type: ignore[no-untyped-def]
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


def _build_settle(digest: str) -> Any:
    @njit(cache=True, nogil=True, **_COMPILE)
    def settle(constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """Put the table to where it rests under what acts on it and on the transmission at the start, the motor held.

        Quasi-static, in the elastic modes: delta_i = g_i / w_i^2, w^2 = (1 - a11) / b1 of the exact discretisation. The
        deflection of the transmission is found by bisection: the torque that it carries grows with it. What is late or
        hysteretic has not begun.
        """
        assert digest
        if not (codes[ON_TRANSMISSION] or codes[ON_TABLE_FORCE]):
            return
        at_motor, at_table, at_spring = modes[SHAPE_MOTOR], modes[SHAPE_TABLE], modes[SHAPE_SPRING]
        at_screw = modes[SHAPE_SCREW]
        at = Moment(0.0, 0.0, constants[PERIOD], 0.0, _along(at_motor, delta[0]) * constants[ANGLE_PER_UNIT], 0.0,
                    _along(at_table, delta[0]) * constants[RATIO], constants[RATIO], constants[VISCOUS_SPEED])
        push = 0.0
        if codes[ON_TABLE_FORCE]:
            push = _table_force(0.0, at, values, codes, memory) * constants[RATIO]
        stiffer = 0.0
        if codes[ON_SCREW]:
            stiffer = constants[SCREW] * (_screw(1.0, at, values, codes, memory) - 1.0)
        apart = constants[SCREW_APART] > 0.0
        soft = np.zeros(at_motor.size)      # 1 / w^2 of each elastic mode
        spring_push = spring_spring = spring_screw = screw_push = screw_screw = 0.0
        for i in range(1, at_motor.size):
            soft[i] = modes[COARSE + 4, i] / (1.0 - modes[COARSE, i])
            spring_push += at_spring[i] * soft[i] * (at_table[i] - at_motor[i]) * push
            spring_spring += at_spring[i] * soft[i] * at_spring[i]
            spring_screw += at_spring[i] * soft[i] * at_screw[i]
            screw_push += at_screw[i] * soft[i] * (at_table[i] - at_motor[i]) * push
            screw_screw += at_screw[i] * soft[i] * at_screw[i]
        bent = effective = spring = screw = low = high = 0.0
        for trial in range(SETTLING):
            effective = _transmission(bent, at, values, codes, memory) if codes[ON_TRANSMISSION] else bent
            spring = -constants[SPRING] * (effective - bent)
            if apart:
                screw = -stiffer * (screw_push + spring_screw * spring) / (1.0 + stiffer * screw_screw)
            else:
                screw = -stiffer * effective
            missing = spring_push + spring_spring * spring + spring_screw * screw - bent
            if abs(missing) <= 1e-15:
                break
            if trial == 0:      # from no deflection on towards the load
                low, high = min(4.0 * missing - STROKE, 0.0), max(4.0 * missing + STROKE, 0.0)
            if missing > 0.0:
                low = bent
            else:
                high = bent
            bent = 0.5 * (low + high)
        moved = 0.0
        for i in range(1, at_motor.size):
            shift = soft[i] * (push * (at_table[i] - at_motor[i]) + spring * at_spring[i] + screw * at_screw[i])
            delta[0, i] += shift
            moved += at_motor[i] * shift
        delta[0, 0] -= moved / at_motor[0]
        memory[OWN, SPRING_EXTRA] = effective - bent

    return settle


def _build_advance(digest: str) -> Any:
    @njit(cache=True, nogil=True, _nrt=False, forceinline=True, **_COMPILE)
    def advance(command, constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """Move the axis by one control period under a held torque command; mean measured torque."""
        assert digest
        n = delta.shape[1]
        own = memory[OWN]
        ratio, period = constants[RATIO], constants[PERIOD]
        at_motor, at_table, at_spring = modes[SHAPE_MOTOR], modes[SHAPE_TABLE], modes[SHAPE_SPRING]
        at_screw = modes[SHAPE_SCREW]
        positions, velocities = delta[0], delta[1]
        any_on = codes[ON_ANY] > 0
        position = table = table_speed = stretch = stretch_rate = 0.0
        if any_on:
            position, speed, table, table_speed, stretch, stretch_rate = _look(
                at_motor, at_table, at_spring, positions, velocities)
        else:
            speed = _along(at_motor, velocities)
        reversing = abs(speed) < constants[SLOW_VELOCITY] + 2.0 * abs(speed - own[LAST_SPEED])
        fine = constants[ALWAYS_FINE] > 0.0 or (reversing and abs(speed) > RESTING)
        own[LAST_SPEED] = speed
        first = FINE if fine else COARSE
        steps = int(constants[FINE_STEPS]) if fine else int(constants[COARSE_STEPS])
        h = period / steps
        gains = FINE_GAINS if fine else COARSE_GAINS
        gain, cross, table_gain = constants[gains], constants[gains + 1], constants[gains + 2]
        from_position, from_velocity, from_torque = modes[first], modes[first + 1], modes[first + 4]
        rate_position, rate_velocity, rate_torque = modes[first + 2], modes[first + 3], modes[first + 5]
        measured = 0.0
        for j in range(steps):
            at = Moment(own[CLOCK] + j * h, j * h, period, h,
                        (position + 0.5 * h * speed) * constants[ANGLE_PER_UNIT], speed,
                        (table + 0.5 * h * table_speed) * ratio, ratio, constants[VISCOUS_SPEED])
            made = command
            if codes[ON_CURRENT]:
                made = _current(made, at, values, codes, memory)
            measured += made
            drive = made
            if codes[ON_TORQUE]:
                drive = _torque(drive, at, values, codes, memory)
            if codes[ON_MOTOR_TORQUE]:
                drive = _motor_torque(drive, at, values, codes, memory)
            push = 0.0
            if codes[ON_TABLE_FORCE]:
                push = _table_force(0.0, at, values, codes, memory) * ratio
            spring = screw = 0.0
            bent = effective = stretch + 0.5 * h * stretch_rate
            if codes[ON_TRANSMISSION]:
                effective = _transmission(bent, at, values, codes, memory)
                extra = effective - bent
                floating = effective == 0.0
                rate = -stretch_rate if floating else (extra - own[SPRING_EXTRA]) / h
                own[FLOATING] = 1.0 if floating else 0.0
                own[SPRING_EXTRA] = extra
                spring = -(constants[SPRING] * extra + constants[DAMPER] * rate)
                if constants[PLAY] > 0.0 and not floating:
                    pressing = constants[SPRING] * effective + constants[DAMPER] * (stretch_rate + rate)
                    if pressing * effective < 0.0:      # flanks with play push, they do not pull
                        spring += pressing
            if codes[ON_SCREW]:
                if constants[SCREW_APART] > 0.0:
                    effective = _along(at_screw, positions) + 0.5 * h * _along(at_screw, velocities)
                screw = -constants[SCREW] * effective * (_screw(1.0, at, values, codes, memory) - 1.0)

            free = table_free = 0.0
            if any_on:
                for i in range(n):
                    g = at_motor[i] * drive + at_table[i] * push + at_spring[i] * spring + at_screw[i] * screw
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

            viscous, bound, opposing = constants[VISCOUS], constants[COULOMB], 0.0
            shift = share = stiffness = 0.0
            if codes[ON_BIAS]:
                shift = _bias(0.0, at, values, codes, memory)
            if codes[ON_TABLE_SHARE]:
                share = _table_share(0.0, at, values, codes, memory)
            if codes[ON_BRISTLE]:
                stiffness = _bristle(0.0, at, values, codes, memory)
            scale = 1.0
            if codes[ON_FRICTION_SCALE]:
                scale = max(_friction_scale(1.0, at, values, codes, memory), 0.0)
                viscous *= scale
            # Friction that depends on speed is taken at the middle of the step, where it is second order.
            passes = 2 if codes[ON_COULOMB] or codes[ON_DRAG] else 1
            for _ in range(passes):
                bound = constants[COULOMB]
                if codes[ON_COULOMB]:
                    bound = max(_coulomb(bound, at, values, codes, memory), 0.0)
                bound *= scale
                if codes[ON_DRAG]:
                    opposing = _drag(0.0, at, values, codes, memory)
                if passes == 2:
                    met = _contact(free, gain, (1.0 - share) * bound, (1.0 - share) * viscous, shift, opposing)
                    at = Moment(at.time_s, at.within_s, at.period_s, at.step_s, at.angle_rad,
                                0.5 * (speed + free - gain * met), at.table_position_m, at.ratio_m,
                                at.viscous_speed)
            rest = 1.0 - share
            if stiffness > 0.0:
                friction, own[BRISTLE_DEFLECTION] = _bristle_contact(
                    free, gain, rest * bound, rest * viscous, shift, opposing, stiffness,
                    own[BRISTLE_DEFLECTION], h)
            else:
                friction = _contact(free, gain, rest * bound, rest * viscous, shift, opposing)
            guide = 0.0
            if share > 0.0:
                guide = _contact(table_free - cross * friction, table_gain, share * bound, share * viscous,
                                 0.0, 0.0)

            for i in range(n):
                g = at_motor[i] * friction + at_table[i] * guide
                positions[i] -= from_torque[i] * g
                velocities[i] -= rate_torque[i] * g
            if any_on and j + 1 < steps:
                position, speed, table, table_speed, stretch, stretch_rate = _look(
                    at_motor, at_table, at_spring, positions, velocities)
        own[CLOCK] += period
        return measured / steps

    return advance


def _build_read(digest: str) -> Any:
    @njit(cache=True, nogil=True, _nrt=False, forceinline=True, **_COMPILE)
    def read(constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """What the two encoders read: motor position (rad, or m) and table position (m)."""
        assert digest
        position = table = 0.0
        for i in range(delta.shape[1]):
            position += modes[SHAPE_MOTOR, i] * delta[0, i]
            table += modes[SHAPE_TABLE, i] * delta[0, i]
        table *= constants[RATIO]
        if codes[ON_MOTOR_READING] or codes[ON_TABLE_READING]:
            at = Moment(memory[OWN, CLOCK], 0.0, constants[PERIOD], 0.0, position * constants[ANGLE_PER_UNIT],
                        0.0, table, constants[RATIO], constants[VISCOUS_SPEED])
            if codes[ON_MOTOR_READING]:
                position = _motor_reading(position, at, values, codes, memory)
            if codes[ON_TABLE_READING]:
                table = _table_reading(table, at, values, codes, memory)
        return position, table

    return read


@njit
def _correct(impulse, error, period, time_constant, modes, delta):  # type: ignore[no-untyped-def]
    """Correct the state of one side of the transmission by the error of its position [motor units]: a Luenberger
    observer. The side moves as one: a motor alone would wind up its coupling."""
    shift = 2.0 * period / time_constant * error
    kick = period / time_constant**2 * error
    for i in range(delta.shape[1]):
        delta[0, i] += modes[impulse, i] * shift
        delta[1, i] += modes[impulse, i] * kick


def _build_closed_loop(digest: str) -> Any:
    @njit(cache=True, nogil=True, **_COMPILE)
    def closed_loop(gains, state, position_command, velocity_command, measured_table, constants, modes,  # type: ignore[no-untyped-def]
                    values, codes, delta, memory):
        """Controller and axis from tick to tick: motor, table, torque command, torque, each (n,).

        Where `measured_table` (n,) is given (else empty), it holds a table that floats in a gap:
        its flight is nobody's to predict from the commands, a bounce early or late would stay for good.
        """
        assert digest
        n = position_command.size
        motor, table, command, torque = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
        datum, told = 0.0, 0
        for k in range(n):
            motor[k], table[k] = read(constants, modes, values, codes, delta, memory)
            if measured_table.size and memory[OWN, FLOATING] == 0.0:
                told += 1
                datum += (measured_table[k] - table[k] - datum) / told
            inputs = control.Inputs(position_command[k], velocity_command[k], motor[k], table[k])
            state, outputs = _control_step(gains, state, inputs)
            command[k] = outputs.torque_n_m
            if told > 0 and memory[OWN, FLOATING] > 0.0:
                error = (measured_table[k] - datum - table[k]) / constants[RATIO]
                _correct(TABLE_IMPULSE, error, constants[PERIOD], OBSERVER_S, modes, delta)
            torque[k] = advance(command[k], constants, modes, values, codes, delta, memory)
        return motor, table, command, torque

    return closed_loop


def _build_observe(digest: str) -> Any:
    @njit(cache=True, nogil=True, **_COMPILE)
    def observe(gains, state, position_command, velocity_command, command, measured_motor, measured_table,  # type: ignore[no-untyped-def]
                constants, modes, values, codes, delta, memory):
        """Each block fed with measured inputs: motor, table, torque command, torque, each (n,).

        The controller gets the measured positions, the drive the measured command, the axis that torque,
        and the transmission the measured motor: the twin's motor is corrected by it after each
        prediction, its table only while it floats in a gap or rests. So a mismatch shows in its own block, where and
        when it acts, and is then forgotten. `measured_table` is empty without a linear encoder. That has a datum of
        its own, which is the mean of what it differs by while the axis moves.
        """
        assert digest
        n = command.size
        motor, table, wanted, torque = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
        period = constants[PERIOD]
        seen = measured_motor * constants[RATIO] if measured_table.size == 0 else measured_table
        datum, settled, moved = 0.0, 0, 0
        for k in range(n):
            motor[k], table[k] = read(constants, modes, values, codes, delta, memory)
            inputs = control.Inputs(position_command[k], velocity_command[k], measured_motor[k], seen[k])
            state, outputs = _control_step(gains, state, inputs)
            wanted[k] = outputs.torque_n_m
            # rounding of recorded set-points piles up in the integrator: let it go
            resumed = state.integral_n_m + period / INTEGRATOR_S * (command[k] - wanted[k])
            state = control.State(state.tick, state.velocity_reference_m_s, resumed, state.previous_motor_rad,
                                  state.previous2_motor_rad, state.filtered_velocity_rad_s)
            error = measured_motor[k] - motor[k]
            _correct(MOTOR_IMPULSE, error, period, constants[OBSERVER], modes, delta)
            if measured_table.size:
                resting = abs(measured_motor[k] - measured_motor[max(k - 1, 0)]) <= constants[SLOW_VELOCITY] * period
                free = resting or memory[OWN, FLOATING] > 0.0
                apart = measured_table[k] - table[k] - constants[RATIO] * error
                if not free:
                    moved += 1
                    datum += (apart - datum) / (moved + min(settled, 1))
                elif moved == 0 and memory[OWN, FLOATING] == 0.0:
                    # where it rests at first is a datum, until motion tells a better one; not so within a gap
                    settled += 1
                    datum += (apart - datum) / settled
                if free and moved + settled > 0:
                    error = (measured_table[k] - datum - table[k]) / constants[RATIO]
                    _correct(TABLE_IMPULSE, error, period, OBSERVER_S, modes, delta)
            torque[k] = advance(command[k], constants, modes, values, codes, delta, memory)
        return motor, table, wanted, torque

    return observe


def _build_open_loop(digest: str) -> Any:
    @njit(cache=True, nogil=True, **_COMPILE)
    def open_loop(torque_in, constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """The axis driven by a given torque command (n,): motor, table, torque, each (n,)."""
        assert digest
        n = torque_in.size
        motor, table, torque = np.empty(n), np.empty(n), np.empty(n)
        for k in range(n):
            motor[k], table[k] = read(constants, modes, values, codes, delta, memory)
            torque[k] = advance(torque_in[k], constants, modes, values, codes, delta, memory)
        return motor, table, torque

    return open_loop


# Bound into each kernel, so that numba's cache knows when a mechanism compiled into it has changed.
_DIGEST = stages.library_digest()
settle = _build_settle(_DIGEST)
advance = _build_advance(_DIGEST)
read = _build_read(_DIGEST)
closed_loop = _build_closed_loop(_DIGEST)
observe = _build_observe(_DIGEST)
open_loop = _build_open_loop(_DIGEST)
