"""The twin of an axis in the time domain: its physics, its active mechanisms, its simulation.

`Twin` packs a chain's modes, friction and mechanisms into the arrays of the compiled kernel. The
same arrays and kernel serve offline simulation in closed loop and the live twin in the control loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil import control
from hil.twin import layout, loops, stages
from hil.twin.chain import Chain
from hil.twin.library import BY_ID, SLOTS
from hil.twin.mechanism import PARAMETERS, WIDTH, Stage
from hil.twin.modal import Modal, discretise, modal, truncate
from hil.twin.settle import settle

FloatArray = NDArray[np.float64]

# Internal steps. Fine: the friction impulse of the step in which the motor reverses is right to Fc x 20 us, 0.003 N m
# of velocity-loop torque on the reference axis, below its current noise. Coarse: sliding friction is constant over a
# step, modes are exact.
FINE_STEP_S = 20e-6
COARSE_STEP_S = 200e-6
# The step is fine while the motor moves slower than this, or could reverse within two ticks. Alike for a lead of 10 mm.
SLOW_RAD_S, SLOW_M_S = 0.02, 32e-6

_NOTHING = np.empty(0)
_RIGHT = np.empty((2, 0))
_ANSWER = "torque"      # the recorded channel that is an answer of the axis only, and no input of any block


@dataclass(frozen=True)
class Active:
    """A mechanism that is on: its id, its parameters in the library's order, its variant."""

    effect: str
    values: tuple[float, ...]
    variant: int = 0


@dataclass(frozen=True)
class Physics:
    """What the nominal twin knows of an axis, in motor units (rad, N m; on a linear axis m, N)."""

    chain: Chain
    coulomb_n_m: float
    viscous_n_m_s_rad: float
    linear: bool = False
    angle_per_unit: float = 1.0     # motor angle per motor unit: 1, or 2 pi / screw lead on a linear axis

    @property
    def viscous_speed(self) -> float:
        """Speed at which viscous friction equals Coulomb friction [rad/s, m/s]; 0 without viscous friction."""
        return self.coulomb_n_m / self.viscous_n_m_s_rad if self.viscous_n_m_s_rad > 0.0 else 0.0


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
    gains: control.Gains
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
            mechanism = BY_ID[active.effect]
            if mechanism.stage is Stage.CHAIN:
                chain = mechanism.contribution(chain, active.values, active.variant)
        return chain

    @cached_property
    def modal(self) -> Modal:
        """Modes of the chain."""
        modes = modal(self.chain)
        return modes if self.modes is None else truncate(modes, self.modes)

    def _steps(self, longest_s: float) -> int:
        """Internal steps per control tick, of which none is longer (but for rounding)."""
        return max(math.ceil(self.gains.period_s / longest_s - 1e-6), 1)

    @cached_property
    def _modes(self) -> FloatArray:
        modes = self.modal
        rows = np.empty((layout.COUPLING + modes.frequency_rad_s.size, modes.frequency_rad_s.size))
        period = self.gains.period_s
        rows[layout.COARSE:layout.COARSE + 6] = discretise(modes, period / self._steps(self.coarse_step_s))
        rows[layout.FINE:layout.FINE + 6] = discretise(modes, period / self._steps(self.fine_step_s))
        rows[layout.SHAPE_MOTOR] = modes.shape[modes.motor]
        rows[layout.SHAPE_TABLE] = modes.shape[modes.table]
        rows[layout.SHAPE_SPRING] = modes.transmission
        rows[layout.SHAPE_SCREW] = modes.screw
        chain = self.physics.chain      # the coordinates that mechanisms add come after it, and stay
        for row, place in ((layout.TABLE_IMPULSE, chain.table), (layout.MOTOR_IMPULSE, chain.motor)):
            rows[row] = chain.inertia_kg_m2 @ chain.side(place) @ modes.shape[:len(chain.names)]
        own = np.diag(2.0 * modes.damping_ratio * modes.frequency_rad_s)
        given = self.chain.damping_n_m_s_rad
        damping = own if given is None else modes.shape.T @ given @ modes.shape
        rows[layout.COUPLING:] = damping - own
        rows[layout.SHAPE_DAMPER] = -damping @ self._table_side
        return rows

    @cached_property
    def _table_side(self) -> FloatArray:
        """All behind the transmission moving as one, in modal coordinates (m,)."""
        return np.asarray(self.chain.inertia_kg_m2 @ self.chain.side(self.chain.table) @ self.modal.shape)

    @cached_property
    def _constants(self) -> FloatArray:
        constants = np.zeros(layout.CONSTANTS)
        physics, chain, ratio = self.physics, self.physics.chain, self.gains.ratio_m_rad
        constants[layout.PERIOD] = self.gains.period_s
        constants[layout.RATIO] = ratio
        constants[layout.ANGLE_PER_UNIT] = physics.angle_per_unit
        constants[layout.COULOMB] = physics.coulomb_n_m
        constants[layout.VISCOUS] = physics.viscous_n_m_s_rad
        constants[layout.VISCOUS_SPEED] = physics.viscous_speed
        constants[layout.SPRING] = chain.transmission_stiffness_n_m_rad
        constants[layout.SCREW] = chain.screw_stiffness_n_m_rad
        constants[layout.SCREW_APART] = float(not np.array_equal(chain.screw, chain.transmission))
        elastic = (self.modal.frequency_rad_s > 0.0) & (self.modal.transmission != 0.0)
        # C s and s^T C s: what of the damping resists the two sides of the transmission moving apart as two bodies. In
        # play it is gone; where a lead errs, it counts from where that puts the table. What is left drives no mode.
        constants[layout.DAMPER] = -self._modes[layout.SHAPE_DAMPER] @ self._table_side
        constants[layout.COARSE_STEPS] = self._steps(self.coarse_step_s)
        constants[layout.OBSERVER] = self.observer_s
        constants[layout.FINE_STEPS] = self._steps(self.fine_step_s)
        constants[layout.SLOW_VELOCITY] = SLOW_M_S if physics.linear else SLOW_RAD_S
        second = [BY_ID[active.effect] for active in self.active if active.variant == 1]
        constants[layout.PLAY] = float(any(mechanism.play for mechanism in second))
        constants[layout.SLIPS] = float(any(mechanism.slips for mechanism in second))
        modes = self._modes
        motor, table = modes[layout.SHAPE_MOTOR], modes[layout.SHAPE_TABLE]
        for at, first in ((layout.COARSE_GAINS, layout.COARSE), (layout.FINE_GAINS, layout.FINE)):
            per_torque = modes[first + 5]
            constants[at:at + 3] = motor * per_torque @ motor, motor * per_torque @ table, table * per_torque @ table
        bends = any(BY_ID[active.effect].stage in (Stage.TRANSMISSION, Stage.SCREW) for active in self.active)
        constants[layout.ALWAYS_FINE] = float(bends and np.count_nonzero(elastic) > 1)
        return constants

    @cached_property
    def _mechanisms(self) -> tuple[FloatArray, NDArray[np.int64]]:
        values = np.zeros((len(SLOTS), PARAMETERS))
        codes = np.zeros(layout.CODES, dtype=np.int64)
        codes[layout.ON_COUPLING] = codes[layout.ON_ANY] = self.chain.damping_n_m_s_rad is not None
        free = dict(enumerate(SLOTS))
        for active in self.active:
            mechanism = BY_ID[active.effect]
            slot = next((slot for slot, other in free.items() if other is mechanism), None)
            if slot is None:
                raise ValueError(f"{mechanism.id} must act at most {mechanism.most} times at once, got more")
            del free[slot]
            stage = stages.stage_of(mechanism, active.variant)
            if stage not in stages.KERNEL_STAGES:
                continue
            values[slot, :len(active.values)] = active.values
            values[slot, PARAMETERS - 1] = active.variant
            codes[slot] = active.variant + 1
            codes[len(SLOTS) + stages.KERNEL_STAGES.index(stage)] = 1
            codes[layout.ON_ANY] = 1
        return values, codes

    @cached_property
    def loop_gains(self) -> control.Gains:
        """The gains, with the velocity filter of an active mechanism."""
        gains = self.gains
        for active in self.active:
            if BY_ID[active.effect].stage is Stage.VELOCITY_FILTER:
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

    def arrays(self) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.int64]]:
        """Constants, modes, mechanism values and codes, as the kernel takes them."""
        return self._constants, self._modes, *self._mechanisms

    def simulate(self, position_command_m: FloatArray, velocity_command_m_s: FloatArray,
                 start: Start = _AT_REST, measured_table_m: FloatArray = _NOTHING,
                 misread: FloatArray = _RIGHT) -> Response:
        """The axis in closed loop over set-points (n,), one per control tick, from `start`.

        `measured_table_m` (n,) holds a table that floats in a gap, see `hil.twin.loops`. `misread` (2, n): what the
        motor encoder [motor units] and the table encoder [m] tell the controller too much.
        """
        delta, memory = self.state(start)
        channels = loops.closed_loop(self.loop_gains, self._controller(start), position_command_m,
                                      velocity_command_m_s, misread, measured_table_m, *self.arrays(), delta, memory)
        return self._channels(Response(*channels))

    def drive(self, torque_command: FloatArray, start: Start = _AT_REST) -> Response:
        """The axis without its controller under a given torque command (n,), from `start`."""
        delta, memory = self.state(start)
        motor, table, torque = loops.open_loop(torque_command, *self.arrays(), delta, memory)
        return self._channels(Response(motor, table, torque_command, torque))

    def observe(self, position_command_m: FloatArray, velocity_command_m_s: FloatArray, measured: Response,
                start: Start = _AT_REST) -> Response:
        """The axis block by block, each fed with measured inputs; see `hil.twin.loops`.

        `measured.table_position_m` is empty without a linear encoder. Recorded lateness of a channel must
        have been undone, see `undelayed`.
        """
        delta, memory = self.state(start)
        channels = loops.observe(self.loop_gains, self._controller(start), position_command_m, velocity_command_m_s,
                                  measured.torque_command, measured.motor_position, measured.table_position_m,
                                  *self.arrays(), delta, memory)
        response = Response(*channels)
        for active in self.active:      # lateness of an input is taken back, that of the answer is simulated
            mechanism = BY_ID[active.effect]
            if mechanism.stage is Stage.CHANNEL and mechanism.variants[active.variant] == _ANSWER:
                response = Response(*mechanism.contribution(tuple(response), active.values, active.variant,
                                                            self.gains.period_s))
        return response

    def undelayed(self, measured: Response) -> Response:
        """Measured inputs with the lateness that active mechanisms give them taken back."""
        for active in self.active:
            mechanism = BY_ID[active.effect]
            variant = mechanism.variants[active.variant]
            present = variant != "table_position" or measured.table_position_m.size
            if mechanism.stage is Stage.CHANNEL and variant != _ANSWER and present:
                back = tuple(-value for value in active.values)
                measured = Response(*mechanism.contribution(tuple(measured), back, active.variant, self.gains.period_s))
        return measured

    def _controller(self, start: Start) -> control.State:
        ratio = self.gains.ratio_m_rad
        return control.init(start.position_m / ratio, start.velocity_m_s / ratio, start.torque, self.gains.period_s,
                            start.tick)

    def _channels(self, response: Response) -> Response:
        for active in self.active:
            mechanism = BY_ID[active.effect]
            if mechanism.stage is Stage.CHANNEL:
                response = Response(*mechanism.contribution(
                    tuple(response), active.values, active.variant, self.gains.period_s))
        return response
