"""The compiled loops over the ticks of a recording: closed, block by block from measured inputs, and open."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from hil.compiled.source_digest import source_digest
from hil.control import cascade
from hil.twin.stepping import kernel, layout
from hil.twin.stepping.contact import COMPILE

# Time constant of the observer that holds a floating table: long against a 2 ms table-encoder count at creep,
# short against a flight through the gap (tens of ms).
OBSERVER_S = 0.008
# Time constant with which the replayed integrator follows the recorded command: slow against every filter or delay.
INTEGRATOR_S = 0.1

_control_step = cascade.step
_read, _advance = kernel.read, kernel.advance


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
    @njit(cache=True, nogil=True, **COMPILE)
    def closed_loop(  # type: ignore[no-untyped-def]
        gains,
        state,
        position_command,
        velocity_command,
        misread,
        measured_table,
        constants,
        modes,
        values,
        codes,
        delta,
        memory,
    ):
        """Controller and axis from tick to tick: motor, table, torque command, torque, each (n,).

        Where `measured_table` (n,) is given (else empty), it holds a table that floats in a gap:
        its flight is nobody's to predict from the commands, a bounce early or late would stay for good. `misread`
        (2, n), or (2, 0), is what motor and table encoder tell the controller beside where they are.
        """
        assert digest
        n = position_command.size
        motor, table, command, torque = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
        datum, told = 0.0, 0
        for k in range(n):
            motor[k], table[k] = _read(constants, modes, values, codes, delta, memory)
            if measured_table.size and memory[layout.OWN, layout.FLOATING] == 0.0:
                told += 1
                datum += (measured_table[k] - table[k] - datum) / told
            seen_motor, seen_table = motor[k], table[k]
            if misread.size:
                seen_motor += misread[0, k]
                seen_table += misread[1, k]
            inputs = cascade.Inputs(position_command[k], velocity_command[k], seen_motor, seen_table)
            state, outputs = _control_step(gains, state, inputs)
            command[k] = outputs.torque_n_m
            if told > 0 and memory[layout.OWN, layout.FLOATING] > 0.0:
                error = (measured_table[k] - datum - table[k]) / constants[layout.RATIO]
                _correct(layout.TABLE_IMPULSE, error, constants[layout.PERIOD], OBSERVER_S, modes, delta)
            torque[k] = _advance(command[k], constants, modes, values, codes, delta, memory)
        return motor, table, command, torque

    return closed_loop


def _build_observe(digest: str) -> Any:
    @njit(cache=True, nogil=True, **COMPILE)
    def observe(  # type: ignore[no-untyped-def]
        gains,
        state,
        position_command,
        velocity_command,
        command,
        measured_motor,
        measured_table,
        constants,
        modes,
        values,
        codes,
        delta,
        memory,
    ):
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
        period = constants[layout.PERIOD]
        seen = measured_motor * constants[layout.RATIO] if measured_table.size == 0 else measured_table
        datum, settled, moved = 0.0, 0, 0
        for k in range(n):
            motor[k], table[k] = _read(constants, modes, values, codes, delta, memory)
            inputs = cascade.Inputs(position_command[k], velocity_command[k], measured_motor[k], seen[k])
            state, outputs = _control_step(gains, state, inputs)
            wanted[k] = outputs.torque_n_m
            # rounding of recorded set-points piles up in the integrator: let it go
            resumed = state.integral_n_m + period / INTEGRATOR_S * (command[k] - wanted[k])
            state = cascade.State(
                state.tick,
                state.velocity_reference_m_s,
                resumed,
                state.previous_motor_rad,
                state.previous2_motor_rad,
                state.filtered_velocity_rad_s,
            )
            error = measured_motor[k] - motor[k]
            _correct(layout.MOTOR_IMPULSE, error, period, constants[layout.OBSERVER], modes, delta)
            if measured_table.size:
                passed = abs(measured_motor[k] - measured_motor[max(k - 1, 0)])
                free = passed <= constants[layout.SLOW_VELOCITY] * period or memory[layout.OWN, layout.FLOATING] > 0.0
                apart = measured_table[k] - table[k] - constants[layout.RATIO] * error
                if not free:
                    moved += 1
                    datum += (apart - datum) / (moved + min(settled, 1))
                elif moved == 0 and memory[layout.OWN, layout.FLOATING] == 0.0:
                    # where it rests at first is a datum, until motion tells a better one; not so within a gap
                    settled += 1
                    datum += (apart - datum) / settled
                if free and moved + settled > 0:
                    error = (measured_table[k] - datum - table[k]) / constants[layout.RATIO]
                    _correct(layout.TABLE_IMPULSE, error, period, OBSERVER_S, modes, delta)
            torque[k] = _advance(command[k], constants, modes, values, codes, delta, memory)
        return motor, table, wanted, torque

    return observe


def _build_open_loop(digest: str) -> Any:
    @njit(cache=True, nogil=True, **COMPILE)
    def open_loop(torque_in, constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """The axis driven by a given torque command (n,): motor, table, torque, each (n,)."""
        assert digest
        n = torque_in.size
        motor, table, torque = np.empty(n), np.empty(n), np.empty(n)
        for k in range(n):
            motor[k], table[k] = _read(constants, modes, values, codes, delta, memory)
            torque[k] = _advance(torque_in[k], constants, modes, values, codes, delta, memory)
        return motor, table, torque

    return open_loop


# Bound into each kernel, so that numba's cache knows when a source compiled into it has changed.
_DIGEST = source_digest()
closed_loop = _build_closed_loop(_DIGEST)
observe = _build_observe(_DIGEST)
open_loop = _build_open_loop(_DIGEST)
