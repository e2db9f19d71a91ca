"""Twin of an axis in the time domain: physics, active mechanisms, simulation.

The same packed arrays and kernel serve offline simulation in closed loop and the live twin in the control loop.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.control import cascade
from hil.twin.mechanism import Stage
from hil.twin.physics import Active, Physics
from hil.twin.stepping import loops
from hil.twin.stepping.records import Arrays, Axis, pack, start_memory
from hil.twin.stepping.static_equilibrium import settle
from hil.twin.structure.chain import Chain
from hil.twin.structure.modal import Modal, lowest_modes

# Internal steps grow with rows longer than 1 ms, whose torque is held for longer: up to 4 times, and as far as a fine
# step is short against the fastest mode [rad], for forces of the transmission that act against its spring.
_ROWS_S, _MOST_GROWTH, _SHORT_RAD = 1e-3, 4.0, 0.4

_NOTHING = np.empty(0)
_RIGHT = np.empty((2, 0))
_ANSWER = "torque"  # the recorded channel that is an answer of the axis only, and no input of any block


class Steps(NamedTuple):
    """Longest internal steps of a twin at ticks of 1 ms [s]: fine about a reversal, else coarse; equal: a fixed step.

    Of 20 us the friction impulse of the step in which the motor reverses is right to 0.003 N m of velocity-loop torque
    on the reference axis, below its current noise. Sliding friction is constant over a coarse step; modes are exact.
    """

    fine_s: float = 20e-6
    coarse_s: float = 200e-6


TWIN_STEPS = Steps()


class Response(NamedTuple):
    """Channels of the twin, each (n,): SI values in the units of the axis."""

    motor_position: FloatArray
    table_position_m: FloatArray
    torque_command: FloatArray
    torque: FloatArray


class Start(NamedTuple):
    """Start of a simulation: table position, velocity, torque of the integrator, control tick, time of mechanisms."""

    position_m: float = 0.0
    velocity_m_s: float = 0.0
    torque: float = 0.0
    tick: int = 0
    time_s: float = 0.0


_AT_REST = Start()


@dataclass(frozen=True)
class Twin:
    """Axis with its control law and its active mechanisms.

    `modes` keeps only the lowest modes of the chain (None: all). A whole number of internal `steps` makes a tick.
    `push_n` (n,) is a force on the table over each tick of a simulation, beside those of the mechanisms; empty: none.
    """

    physics: Physics
    gains: cascade.Gains
    active: Sequence[Active] = ()
    modes: int | None = None
    steps: Steps = TWIN_STEPS
    observer_s: float = loops.OBSERVER_S
    push_n: FloatArray = field(default_factory=lambda: _NOTHING)

    @cached_property
    def chain(self) -> Chain:
        """Chain of the axis, with the mechanisms that change it."""
        chain = self.physics.chain
        for active in self.active:
            if active.form.stage is Stage.CHAIN:
                chain = active.form.contribution(chain, active.values)
        return chain

    @cached_property
    def modal(self) -> Modal:
        """Modes of the chain."""
        return lowest_modes(self.chain, self.modes)

    @cached_property
    def _arrays(self) -> Arrays:
        period_s, fastest = self.gains.period_s, float(np.max(self.modal.frequency_rad_s))
        growth = min(period_s / _ROWS_S, _MOST_GROWTH, _SHORT_RAD / max(fastest * self.steps.fine_s, 1e-9))
        coarse, fine = (
            max(math.ceil(period_s / (max(growth, 1.0) * longest_s) - 1e-6), 1)
            for longest_s in (self.steps.coarse_s, self.steps.fine_s)
        )
        arrays = pack(self.physics, self.chain, self.modes, self.gains, self.active, (coarse, fine), self.observer_s)
        arrays.constants["any_active"] |= self.push_n.size > 0
        return arrays

    @property
    def late(self) -> tuple[Active, ...]:
        """Active mechanisms by which measured inputs are recorded late."""
        return tuple(one for one in self.active if one.form.stage is Stage.CHANNEL)

    @property
    def slow_velocity(self) -> float:
        """Speed of the motor [rad/s, m/s] below which it rests for the observer of the table."""
        return float(self._arrays[0][0]["slow_velocity"])

    @cached_property
    def loop_gains(self) -> cascade.Gains:
        """Gains, with the velocity filter of an active mechanism."""
        gains = self.gains
        for active in self.active:
            if active.form.stage is Stage.VELOCITY_FILTER:
                gains = gains._replace(filter_coefficient=1.0 - math.exp(-gains.period_s / max(active.values[0], 1e-9)))
        return gains

    def state(self, start: Start = _AT_REST) -> tuple[FloatArray, NDArray[np.void]]:
        """Modal state (2, modes) and memory of an axis that moves as one body at `start`, at rest under its loads."""
        modes, ratio = self.modal, self.gains.ratio_m_rad
        delta = np.zeros((2, modes.frequency_rad_s.size))
        delta[:, 0] = np.array(start[:2]) / ratio / modes.shape[modes.motor, 0]
        memory = start_memory()
        memory["clock"] = start.time_s
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
        feedforward: FloatArray = _NOTHING,
    ) -> Response:
        """Simulate the axis in closed loop over set-points (n,), one per control tick, from `start`.

        `measured_table_m` (n,) holds a table that floats in a gap, see `hil.twin.stepping.loops`. `misread` (2, n):
        error of the motor encoder [motor units] and of the table encoder [m] that the controller sees. `feedforward`
        (n,): torque that a compensation adds; empty: none.
        """
        setpoints = loops.Setpoints(position_command_m, velocity_command_m_s, feedforward)
        controller, axis = self._controller(start), self._axis(start)
        channels = loops.closed_loop(
            self.loop_gains, controller, setpoints, misread, measured_table_m, self.push_n, axis
        )
        return self._recorded(Response(*channels))

    def drive(self, torque_command: FloatArray, start: Start = _AT_REST) -> Response:
        """Simulate the axis without its controller under a given torque command (n,), from `start`."""
        motor, table, torque = loops.open_loop(torque_command, self._axis(start))
        return self._recorded(Response(motor, table, torque_command, torque))

    def observe(
        self,
        position_command_m: FloatArray,
        velocity_command_m_s: FloatArray,
        measured: Response,
        start: Start = _AT_REST,
        resting: NDArray[np.bool_] | None = None,
        feedforward: FloatArray = _NOTHING,
    ) -> Response:
        """Simulate the axis block by block, each on measured inputs; see `hil.twin.stepping.loops`.

        `measured.table_position_m` is empty without a linear encoder. `resting` (n,) marks the rows at which the motor
        rests; by default those at which its measured position hardly changes. Recorded lateness of a channel must have
        been undone, see `undelayed`. `feedforward` as in `simulate`.
        """
        setpoints = loops.Setpoints(position_command_m, velocity_command_m_s, feedforward)
        if resting is None:
            passed = np.abs(np.diff(measured.motor_position, prepend=measured.motor_position[:1]))
            resting = passed <= self.slow_velocity * self.gains.period_s
        channels = loops.observe(
            self.loop_gains,
            self._controller(start),
            setpoints,
            Response(*measured),
            resting,
            self.push_n,
            self._axis(start),
        )
        # lateness of an input is taken back, that of the answer is simulated
        return self._recorded(Response(*channels), (Stage.ANSWER,))

    def command(
        self,
        position_command_m: FloatArray,
        velocity_command_m_s: FloatArray,
        measured: Response,
        start: Start = _AT_REST,
    ) -> FloatArray:
        """Torque command (n,) of the controller alone, fed measured inputs as in `observe`."""
        setpoints = loops.Setpoints(position_command_m, velocity_command_m_s, _NOTHING)
        return np.asarray(
            loops.replay_law(self.loop_gains, self._controller(start), setpoints, Response(*measured)), dtype=np.float64
        )

    def undelayed(self, measured: Response) -> Response:
        """Undo the lateness that active mechanisms give to measured inputs."""
        return taken_back(measured, self.active, self.gains.period_s)

    def _axis(self, start: Start) -> Axis:
        return Axis(*self.arrays(), *self.state(start))

    def _controller(self, start: Start) -> cascade.State:
        ratio = self.gains.ratio_m_rad
        return cascade.init(
            start.position_m / ratio, start.velocity_m_s / ratio, start.torque, self.gains.period_s, start.tick
        )

    def _recorded(self, response: Response, stages: Sequence[Stage] = (Stage.CHANNEL, Stage.ANSWER)) -> Response:
        return _recorded(response, self.active, stages, self.gains.period_s)


def _recorded(
    response: Response, active: Sequence[Active], stages: Sequence[Stage], period_s: float, times: float = 1.0
) -> Response:
    """Apply mechanisms of the recording to the channels, with their parameters multiplied."""
    for one in active:
        if one.form.stage in stages:
            response = Response(*one.form.contribution(tuple(response), [times * v for v in one.values], period_s))
    return response


def taken_back(measured: Response, active: Sequence[Active], period_s: float) -> Response:
    """Undo the lateness that mechanisms give to measured inputs."""
    return _recorded(measured, active, (Stage.CHANNEL,), period_s, -1.0)
