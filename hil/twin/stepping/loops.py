"""Compiled loops over the ticks of a recording: closed, block by block from measured inputs, and open."""

from typing import NamedTuple

import numpy as np
from numba import njit

from hil.arrays import FloatArray
from hil.control import cascade
from hil.twin.stepping import kernel
from hil.twin.stepping.contact import COMPILE
from hil.twin.stepping.records import shapes_of
from hil.twin.stepping.transmission import along

# Time constant of the observer that holds a floating table: long against a 2 ms table-encoder count at creep,
# short against a flight through the gap (tens of ms).
OBSERVER_S = 0.008
# Least time constant of any observer in ticks: the sampled error of a rigid body decays by 3/4 per tick with 2, grows
# with 1.
LEAST_TICKS = 2.0
# Time constant with which the replayed integrator follows the recorded command: slow against every filter or delay.
INTEGRATOR_S = 0.1

_control_step = cascade.step
_read, _advance = kernel.read, kernel.advance


class Setpoints(NamedTuple):
    """Commands of the table (n,), one per control tick, and the torque of a compensation (n,); (0,): none."""

    position_m: FloatArray
    velocity_m_s: FloatArray
    torque: FloatArray


@njit(**COMPILE)
def _inputs(setpoints, k, motor, table):  # type: ignore[no-untyped-def]
    """Inputs of the controller at tick k, with the positions that it sees."""
    torque = setpoints.torque[k] if setpoints.torque.size else 0.0
    return cascade.Inputs(setpoints.position_m[k], setpoints.velocity_m_s[k], motor, table, torque)


@njit(**COMPILE)
def _correct(impulse, error, period, time_constant, delta):  # type: ignore[no-untyped-def]
    """Correct the state of one side of the transmission by the error of its position [motor units]: a Luenberger
    observer. The side moves as one body: a motor alone would wind up its coupling."""
    shift = 2.0 * period / time_constant * error
    kick = period / time_constant**2 * error
    for i in range(delta.shape[1]):
        delta[0, i] += impulse[i] * shift
        delta[1, i] += impulse[i] * kick


@njit(cache=True, nogil=True, **COMPILE)
def closed_loop(gains, state, setpoints, misread, measured_table, push, axis):  # type: ignore[no-untyped-def]
    """Run controller and axis from tick to tick: motor, table, torque command, torque, each (n,).

    Where `measured_table` (n,) is given (else empty), it holds a table that floats in a gap: its flight cannot be
    predicted from the commands, and a bounce early or late would stay for good. `misread` (2, n), or (2, 0), is
    added to the readings of motor and table encoder for the controller. `push` (n,), or (0,), is a force on the table
    over each tick.
    """
    constants, modes, values, codes, delta, memory = axis
    c, own, shapes = constants[0], memory[0], shapes_of(modes)
    n = setpoints.position_m.size
    motor, table, command, torque = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    datum, told = 0.0, 0
    for k in range(n):
        motor[k], table[k] = _read(constants, modes, values, codes, delta, memory)
        if measured_table.size and own.floating == 0.0:
            told += 1
            datum += (measured_table[k] - table[k] - datum) / told
        seen_motor, seen_table = motor[k], table[k]
        if misread.size:
            seen_motor += misread[0, k]
            seen_table += misread[1, k]
        inputs = _inputs(setpoints, k, seen_motor, seen_table)
        state, outputs = _control_step(gains, state, inputs)
        command[k] = outputs.torque_n_m
        if told > 0 and own.floating > 0.0:
            error = (measured_table[k] - datum - table[k]) / c.ratio
            _correct(shapes.table_impulse, error, c.period, max(OBSERVER_S, LEAST_TICKS * c.period), delta)
        if push.size:
            own.push = push[k]
        torque[k] = _advance(command[k], constants, modes, values, codes, delta, memory)
    return motor, table, command, torque


@njit(**COMPILE)
def _follow(gains, state, inputs, command, period):  # type: ignore[no-untyped-def]
    """Compute one tick of the controller on recorded inputs, and let its integrator follow the recorded `command`:
    rounding of recorded set-points accumulates in it."""
    state, outputs = _control_step(gains, state, inputs)
    wanted = outputs.torque_n_m
    resumed = state.integral_n_m + period / INTEGRATOR_S * (command - wanted)
    state = cascade.State(
        state.tick,
        state.velocity_reference_m_s,
        resumed,
        state.previous_motor_rad,
        state.previous2_motor_rad,
        state.filtered_velocity_rad_s,
    )
    return state, wanted


@njit(cache=True, nogil=True, **COMPILE)
def replay_law(gains, state, setpoints, measured):  # type: ignore[no-untyped-def]
    """Run the controller alone on measured inputs (a `Response`), as `observe` does: torque command (n,)."""
    command, motor, table = measured.torque_command, measured.motor_position, measured.table_position_m
    seen = motor * gains.ratio_m_rad if table.size == 0 else table
    wanted = np.empty(command.size)
    for k in range(command.size):
        inputs = _inputs(setpoints, k, motor[k], seen[k])
        state, wanted[k] = _follow(gains, state, inputs, command[k], gains.period_s)
    return wanted


@njit(cache=True, nogil=True, **COMPILE)
def observe(gains, state, setpoints, measured, resting, push, axis):  # type: ignore[no-untyped-def]
    """Run each block on measured inputs (a `Response`): motor, table, torque command, torque, each (n,).

    The controller gets the measured positions, the drive the measured command, the axis that torque, and the
    transmission the measured motor: the twin's motor is corrected by it after each prediction, its table only while
    it floats in a gap or rests. A table behind a spring that is stiff for the ticks moves with the motor. So a mismatch
    shows in its own block, at its own place and time, and is then forgotten. `resting` (n,) marks the rows at which the
    motor rests. The measured table is empty without a linear encoder. Its datum is the mean difference from the twin
    while the axis moves. `push` as in `closed_loop`.
    """
    constants, modes, values, codes, delta, memory = axis
    c, own, shapes = constants[0], memory[0], shapes_of(modes)
    command, measured_motor, measured_table = (
        measured.torque_command,
        measured.motor_position,
        measured.table_position_m,
    )
    n = command.size
    motor, table, wanted, torque = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    seen = measured_motor * c.ratio if measured_table.size == 0 else measured_table
    datum, settled, moved = 0.0, 0, 0
    hold = max(OBSERVER_S, LEAST_TICKS * c.period)
    for k in range(n):
        motor[k], table[k] = _read(constants, modes, values, codes, delta, memory)
        inputs = _inputs(setpoints, k, measured_motor[k], seen[k])
        state, wanted[k] = _follow(gains, state, inputs, command[k], c.period)
        error = measured_motor[k] - motor[k]
        # within a gap the motor moves alone
        impulse = shapes.motor_impulse if own.floating > 0.0 else shapes.held_impulse
        carried = along(shapes.table, impulse)  # share of the motor's shift that moves the table, too
        _correct(impulse, error, c.period, c.observer, delta)
        own_table = table[k]
        # it follows the mean of a motor that is put back by 2 T / time constant x error at each tick
        table[k] -= (1.0 - carried) * c.ratio * c.period / c.observer * error
        if measured_table.size:
            free = resting[k] or own.floating > 0.0
            apart = measured_table[k] - own_table - c.ratio * error
            if not free:
                moved += 1
                datum += (apart - datum) / (moved + min(settled, 1))
            elif moved == 0 and own.floating == 0.0:
                # its first rest is the datum until motion gives a better one; not within a gap
                settled += 1
                datum += (apart - datum) / settled
            if free and moved + settled > 0:
                error = (1.0 - carried) * (measured_table[k] - datum - own_table) / c.ratio
                _correct(shapes.table_impulse, error, c.period, hold, delta)
        if push.size:
            own.push = push[k]
        torque[k] = _advance(command[k], constants, modes, values, codes, delta, memory)
    return motor, table, wanted, torque


@njit(cache=True, nogil=True, **COMPILE)
def open_loop(torque_in, axis):  # type: ignore[no-untyped-def]
    """Drive the axis by a given torque command (n,): motor, table, torque, each (n,)."""
    constants, modes, values, codes, delta, memory = axis
    n = torque_in.size
    motor, table, torque = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        motor[k], table[k] = _read(constants, modes, values, codes, delta, memory)
        torque[k] = _advance(torque_in[k], constants, modes, values, codes, delta, memory)
    return motor, table, torque
