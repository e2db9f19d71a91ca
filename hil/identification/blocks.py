"""Block by block: each block of the bench is fed with what was measured, so that its error stays its own.

    controller          set-points and measured positions                  -> torque command
    drive               measured torque command                            -> torque
    motor and load      measured torque, and the torque that keeps the     -> that torque: what the
                        twin on the measured motor position                   twin's mechanics lack
    transmission        the twin on the measured motor position            -> table less motor position

The third holds the twin on the measured motor by u = J (w^2 e + 2 D w de/dt), e = measured - twin motor
position, J the inertia of the whole axis. Where the twin is right, u is noise; what the axis has beyond
the twin shows in u up to w / 2 pi = 30 Hz (a disturbance observer).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.control import cascade
from hil.identification.dataset import Measured
from hil.identification.residuals import datum_m
from hil.twin.axis import Response
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage
from hil.twin.stepping import kernel
from hil.twin.stepping.stages import stage_of

OBSERVER_RAD_S = 2.0 * np.pi * 30.0
OBSERVER_DAMPING = 0.7
WINDOW_S = 0.1  # of the controller's replay: rounded set-points add up in the integrator


@dataclass(frozen=True, eq=False)
class BlockDeviation:
    """Output of one block (n,), measured and by the twin's block fed with measured inputs."""

    block: str
    inputs: str
    output: str
    unit: str
    measured: FloatArray
    simulated: FloatArray
    noise: float  # standard deviation of the measured output's white noise; 0 if not known
    remark: str = ""

    @property
    def deviation(self) -> FloatArray:
        """Measured less simulated (n,)."""
        return np.asarray(self.measured - self.simulated)


def compare_blocks(
    measured: Measured, bench: Bench, progress: Callable[[float], None] = lambda _: None
) -> tuple[BlockDeviation, ...]:
    """All blocks that the recording can tell apart; `progress` is told the share of the rows done."""
    torque_unit = "N" if bench.axis.linear else "N m"
    name = "force" if bench.axis.linear else "torque"
    command = replayed_command(measured, bench.gains)
    if np.array_equal(command, measured.torque_command):
        remark = "the replay is bit-identical to the recording"
    elif bench.gains.integral_gain_n_m_rad:
        remark = f"integrator set from the recording every {WINDOW_S:g} s: rounded set-points add up in it"
    else:
        remark = ""
    blocks = [
        BlockDeviation(
            "controller",
            "set-points, measured positions",
            f"{name} command",
            torque_unit,
            measured.torque_command,
            command,
            0.0,
            remark,
        )
    ]
    if not measured.torque_is_command:
        response = bench.twin().drive(measured.torque_command, measured.start)
        blocks.append(
            BlockDeviation(
                "drive",
                f"measured {name} command",
                name,
                torque_unit,
                measured.torque,
                response.torque,
                measured.noise.torque,
            )
        )
    correction, motor, table = follow(measured, bench, progress)
    blocks.append(
        BlockDeviation(
            "motor and load",
            f"measured {name}, held on the measured motor position",
            name,
            torque_unit,
            measured.torque,
            measured.torque + correction,
            measured.noise.torque,
            f"deviation: what the twin's mechanics need less or more, up to {OBSERVER_RAD_S / (2.0 * np.pi):.0f} Hz",
        )
    )
    if measured.table_m.size:
        ratio = bench.axis.ratio_m_rad
        held = Response(motor, table, measured.torque_command, measured.torque + correction)
        datum = datum_m(measured.response, held, ratio, measured.judged)
        blocks.append(
            BlockDeviation(
                "transmission and table",
                "measured motor position (twin held on it)",
                "table less motor position",
                "m",
                measured.table_m - datum - ratio * measured.motor,
                table - ratio * motor,
                measured.noise.table_m,
            )
        )
    return tuple(blocks)


def replayed_command(measured: Measured, gains: cascade.Gains) -> FloatArray:
    """Torque command (n,) of the control law fed with measured positions.

    In windows, unless it is bit-identical in one piece: each begins at a tick of the position loop with the
    integrator that gives the window's first command. A P velocity loop has no integrator and runs through.
    """
    channels = (
        measured.position_command_m,
        measured.velocity_command_m_s,
        measured.motor,
        measured.table_m if measured.table_m.size else gains.ratio_m_rad * measured.motor,
    )
    start, ratio = measured.start, gains.ratio_m_rad
    state = cascade.init(measured.motor[0], start.velocity_m_s / ratio, start.torque, gains.period_s)
    command, _ = cascade.replay(gains, state, *channels)
    if gains.integral_gain_n_m_rad == 0.0 or np.array_equal(command, measured.torque_command):
        return np.asarray(command)
    motor = measured.motor
    rows = max(round(WINDOW_S / gains.period_s / gains.position_ticks), 1) * gains.position_ticks
    for begin in range(gains.position_ticks, motor.size, rows):
        end = min(begin + rows, motor.size)
        state = cascade.State(
            0, 0.0, 0.0, motor[begin - 1], motor[begin - 2], (motor[begin - 1] - motor[begin - 2]) / gains.period_s
        )
        proportional, _ = cascade.replay(gains, state, *(values[begin : begin + 1] for values in channels))
        state = state._replace(integral_n_m=float(measured.torque_command[begin] - proportional[0]))
        command[begin:end], _ = cascade.replay(gains, state, *(values[begin:end] for values in channels))
    return np.asarray(command)


def follow(
    measured: Measured, bench: Bench, progress: Callable[[float], None] = lambda _: None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The twin under the measured torque, held on the measured motor position: torque of the holding,
    motor and table position of the twin, each (n,)."""
    twin = bench.twin()
    # the measured torque is what the drive made: what the drive does to it must not happen twice
    mechanical = tuple(
        active
        for active in twin.active
        if stage_of(BY_ID[active.effect], active.variant) not in (Stage.CURRENT, Stage.CHANNEL)
    )
    twin = replace(twin, active=mechanical)
    constants, modes, values, codes = twin.arrays()
    delta, memory = twin.state(measured.start)
    inertia = float(twin.physics.chain.inertia_kg_m2.sum())
    stiffness = inertia * OBSERVER_RAD_S**2
    damping = inertia * 2.0 * OBSERVER_DAMPING * OBSERVER_RAD_S / measured.period_s
    n = measured.motor.size
    correction, motor, table = np.empty(n), np.empty(n), np.empty(n)
    previous = 0.0
    for k in range(n):
        motor[k], table[k] = kernel.read(constants, modes, values, codes, delta, memory)
        error = measured.motor[k] - motor[k]
        correction[k] = stiffness * error + damping * (error - previous)
        previous = error
        kernel.advance(measured.torque[k] + correction[k], constants, modes, values, codes, delta, memory)
        if k % 4096 == 0:
            progress(k / n)
    return correction, motor, table
