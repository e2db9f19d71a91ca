"""The twin of an axis in the time domain: its physics, its active mechanisms, its simulation.

The same packed arrays and kernel serve offline simulation in closed loop and the live twin in the control loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.control import cascade
from hil.twin.library import BY_ID, SLOTS
from hil.twin.mechanism import WIDTH, Stage
from hil.twin.physics import Active, Physics
from hil.twin.stepping import loops
from hil.twin.stepping.packing import Arrays, Steps, pack_constants, pack_mechanisms, pack_modes
from hil.twin.stepping.static_equilibrium import settle
from hil.twin.structure.chain import Chain
from hil.twin.structure.modal import Modal, modal, truncate

# Internal steps. Fine: the friction impulse of the step in which the motor reverses is right to Fc x 20 us, 0.003 N m
# of velocity-loop torque on the reference axis, below its current noise. Coarse: sliding friction is constant over a
# step, modes are exact.
FINE_STEP_S = 20e-6
COARSE_STEP_S = 200e-6

_NOTHING = np.empty(0)
_RIGHT = np.empty((2, 0))
_ANSWER = "torque"  # the recorded channel that is an answer of the axis only, and no input of any block


class Response(NamedTuple):
    """What the twin answers with, each (n,): SI values in the units of the axis."""

    motor_position: FloatArray
    table_position_m: FloatArray
    torque_command: FloatArray
    torque: FloatArray


class Start(NamedTuple):
    """Where a simulation starts: table position, velocity, and the torque of the integrator."""

    position_m: float = 0.0
    velocity_m_s: float = 0.0
    torque: float = 0.0
    tick: int = 0


_AT_REST = Start()


@dataclass(frozen=True)
class Twin:
    """An axis with its control law and its active mechanisms.

    `modes` keeps only the lowest modes of the chain (None: all). `fine_step_s` and `coarse_step_s` are the longest
    internal steps, of which a whole number makes a control tick; equal values give a fixed step.
    """

    physics: Physics
    gains: cascade.Gains
    active: Sequence[Active] = ()
    modes: int | None = None
    coarse_step_s: float = COARSE_STEP_S
    fine_step_s: float = FINE_STEP_S
    observer_s: float = loops.OBSERVER_S

    @cached_property
    def chain(self) -> Chain:
        """The chain of the axis, with those mechanisms that change it."""
        chain = self.physics.chain
        for active in self.active:
            variant = BY_ID[active.effect].variants[active.variant]
            if variant.stage is Stage.CHAIN:
                chain = variant.contribution(chain, active.values, active.variant)
        return chain

    @cached_property
    def modal(self) -> Modal:
        """Modes of the chain."""
        modes = modal(self.chain)
        return modes if self.modes is None else truncate(modes, self.modes)

    @cached_property
    def _arrays(self) -> Arrays:
        steps = Steps(
            *(
                max(math.ceil(self.gains.period_s / longest_s - 1e-6), 1)
                for longest_s in (self.coarse_step_s, self.fine_step_s)
            )
        )
        modes = pack_modes(self.physics.chain, self.chain, self.modal, self.gains.period_s, steps)
        constants = pack_constants(self.physics, self.active, self.gains, self.observer_s, modes, steps)
        return constants, modes, *pack_mechanisms(self.active, coupled=self.chain.damping_n_m_s_rad is not None)

    @cached_property
    def loop_gains(self) -> cascade.Gains:
        """The gains, with the velocity filter of an active mechanism."""
        gains = self.gains
        for active in self.active:
            if BY_ID[active.effect].variants[active.variant].stage is Stage.VELOCITY_FILTER:
                gains = gains._replace(filter_coefficient=1.0 - math.exp(-gains.period_s / max(active.values[0], 1e-9)))
        return gains

    def state(self, start: Start = _AT_REST) -> tuple[FloatArray, FloatArray]:
        """Modal state (2, modes) and memory of an axis that moves as one body at `start`, at rest under its loads."""
        modes, ratio = self.modal, self.gains.ratio_m_rad
        delta = np.zeros((2, modes.frequency_rad_s.size))
        rigid = modes.shape[modes.motor, 0]
        delta[0, 0] = start.position_m / ratio / rigid
        delta[1, 0] = start.velocity_m_s / ratio / rigid
        memory = np.zeros((len(SLOTS) + 1, WIDTH))
        settle(*self.arrays(), delta, memory)
        return delta, memory

    def arrays(self) -> Arrays:
        """Constants, modes, mechanism values and codes, as the kernel takes them."""
        return self._arrays

    def simulate(
        self,
        position_command_m: FloatArray,
        velocity_command_m_s: FloatArray,
        start: Start = _AT_REST,
        measured_table_m: FloatArray = _NOTHING,
        misread: FloatArray = _RIGHT,
    ) -> Response:
        """The axis in closed loop over set-points (n,), one per control tick, from `start`.

        `measured_table_m` (n,) holds a table that floats in a gap, see `hil.twin.stepping.loops`. `misread` (2, n):
        what the motor encoder [motor units] and the table encoder [m] tell the controller too much.
        """
        delta, memory = self.state(start)
        channels = loops.closed_loop(
            self.loop_gains,
            self._controller(start),
            position_command_m,
            velocity_command_m_s,
            misread,
            measured_table_m,
            *self.arrays(),
            delta,
            memory,
        )
        return self._channels(Response(*channels))

    def drive(self, torque_command: FloatArray, start: Start = _AT_REST) -> Response:
        """The axis without its controller under a given torque command (n,), from `start`."""
        delta, memory = self.state(start)
        motor, table, torque = loops.open_loop(torque_command, *self.arrays(), delta, memory)
        return self._channels(Response(motor, table, torque_command, torque))

    def observe(
        self,
        position_command_m: FloatArray,
        velocity_command_m_s: FloatArray,
        measured: Response,
        start: Start = _AT_REST,
    ) -> Response:
        """The axis block by block, each fed with measured inputs; see `hil.twin.stepping.loops`.

        `measured.table_position_m` is empty without a linear encoder. Recorded lateness of a channel must
        have been undone, see `undelayed`.
        """
        delta, memory = self.state(start)
        channels = loops.observe(
            self.loop_gains,
            self._controller(start),
            position_command_m,
            velocity_command_m_s,
            measured.torque_command,
            measured.motor_position,
            measured.table_position_m,
            *self.arrays(),
            delta,
            memory,
        )
        response = Response(*channels)
        for active in self.active:  # lateness of an input is taken back, that of the answer is simulated
            variant = BY_ID[active.effect].variants[active.variant]
            if variant.stage is Stage.CHANNEL and variant.name == _ANSWER:
                response = Response(
                    *variant.contribution(tuple(response), active.values, active.variant, self.gains.period_s)
                )
        return response

    def undelayed(self, measured: Response) -> Response:
        """Measured inputs with the lateness that active mechanisms give them taken back."""
        for active in self.active:
            variant = BY_ID[active.effect].variants[active.variant]
            present = not variant.needs_table or measured.table_position_m.size
            if variant.stage is Stage.CHANNEL and variant.name != _ANSWER and present:
                back = tuple(-value for value in active.values)
                measured = Response(*variant.contribution(tuple(measured), back, active.variant, self.gains.period_s))
        return measured

    def _controller(self, start: Start) -> cascade.State:
        ratio = self.gains.ratio_m_rad
        return cascade.init(
            start.position_m / ratio, start.velocity_m_s / ratio, start.torque, self.gains.period_s, start.tick
        )

    def _channels(self, response: Response) -> Response:
        for active in self.active:
            variant = BY_ID[active.effect].variants[active.variant]
            if variant.stage is Stage.CHANNEL:
                response = Response(
                    *variant.contribution(tuple(response), active.values, active.variant, self.gains.period_s)
                )
        return response
