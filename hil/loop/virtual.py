"""A run in virtual time, its uneventful ticks in one compiled call: some three times as fast as frame by frame.

Arming, disarming and every event go over the simulated bus (`hil.loop.session`). Between them the same compiled cycle
and the same compiled axis take turns, with values rounded as CAN frames round them: every row has the bits that the bus
would give. When a limit of the axis is passed, the ticks since the last snapshot are run again over the bus.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba import njit

from drivers.canopen_encoder import CanopenEncoder
from drivers.object_index import ObjectIndex as Index
from drivers.port import DriveSample, EncoderSample
from drivers.sim import kernel
from drivers.sim.plant import Plant
from hil.arrays import FloatArray
from hil.bench.hardware import DriveMode
from hil.loop.cycle import Cycle, Samples, compiled_cycle
from hil.loop.devices import Devices, Rig
from hil.loop.session import Rows

SNAPSHOT_TICKS = 2000
LAST_TICKS = 20  # over the bus again, so that the devices know where the axis is when they disarm


class Scales(NamedTuple):
    """Conversions of the simulated drive and encoder and of their drivers, to counts and back."""

    counts_per_rad: float
    rad_per_count: float
    counts_per_m: float
    m_per_count: float
    command_mille_per_n_m: float
    command_n_m_per_mille: float
    mille_per_n_m: float
    n_m_per_mille: float
    max_mille: float


class SimulatedAxis(NamedTuple):
    """Arguments of the compiled axis (`drivers.sim.kernel.advance`) and the conversions of its devices."""

    parameters: np.ndarray[Any, Any]
    state: np.ndarray[Any, Any]
    lines: FloatArray
    steps: int
    scales: Scales


class BlockRows(Rows, Protocol):
    """Destination of rows one by one and in blocks (n, columns)."""

    def record_block(self, rows: FloatArray) -> None: ...


_cycle, _advance = compiled_cycle, kernel.advance


@njit(cache=True, _nrt=False, error_model="numpy")
def _ticks(first, count, drive_state, measured, block, setpoints, loop, axis):  # type: ignore[no-untyped-def]
    """Run ticks first .. first + count - 1 with the set-points of row `tick`; returns False if a limit was passed.

    measured: motor [rad or m], table [m] and torque [N m or N] of the next tick. block[k] becomes the row before
    tick first + k.
    """
    width, scales, state = block.shape[1], axis.scales, axis.state[0]
    for k in range(count):
        tick = first + k
        samples = Samples(measured[0], measured[1], measured[2], drive_state, 0, 0.0, 0.0, 0, 0, 0)
        setpoint, passed = _cycle(tick, 0, samples, setpoints, loop)
        for column in range(width):
            block[k, column] = loop.rows[(tick + 1) & 1, column]
        if passed:
            return False
        mille = np.rint(setpoint * scales.command_mille_per_n_m)
        mille = min(max(mille, -scales.max_mille), scales.max_mille)
        _advance(axis.parameters[0], state, axis.lines, mille * scales.command_n_m_per_mille, axis.steps)
        measured[0] = np.rint(state.motor_recorded * scales.counts_per_rad) * scales.rad_per_count
        measured[1] = np.rint(state.table_recorded * scales.counts_per_m) * scales.m_per_count
        torque = np.rint(state.torque_recorded * scales.mille_per_n_m)
        measured[2] = min(max(torque, -32768.0), 32767.0) * scales.n_m_per_mille
    return True


class CompiledTicks:
    """The uneventful ticks of a run on a simulated axis, in one compiled call for each block; see the module."""

    def __init__(self, axis: SimulatedAxis, recorder: BlockRows) -> None:
        self._axis, self._recorder = axis, recorder

    def run(
        self, cycle: Cycle, sample: DriveSample, seen: EncoderSample, stop_asked: Callable[[], bool]
    ) -> tuple[int, DriveSample, EncoderSample]:
        """Run and record ticks from 0 on; see `hil.loop.session.FastForward`."""
        measured = np.array([sample.motor_position_rad, seen.position_m, sample.torque_n_m])
        moving = (self._axis.state, self._axis.lines, measured, *cycle.state_arrays)
        block = np.empty((SNAPSHOT_TICKS, len(cycle.channels)))
        tick, end = 0, max(0, len(cycle.setpoints) - LAST_TICKS)
        while tick < end and not stop_asked():
            snapshot = [array.copy() for array in moving]
            count = min(SNAPSHOT_TICKS, end - tick)
            state = int(sample.state)
            if not _ticks(tick, count, state, measured, block, cycle.setpoints, cycle.loop, self._axis):
                for array, before in zip(moving, snapshot, strict=True):
                    array[...] = before
                break
            self._recorder.record_block(block[tick == 0 : count])  # no row before the first
            tick += count
        motor, table, torque = measured.tolist()
        return tick, sample._replace(motor_position_rad=motor, torque_n_m=torque), seen._replace(position_m=table)


def compiled_ticks(rig: Devices, recorder: BlockRows) -> CompiledTicks | None:
    """Compile the ticks of a rig in torque control of a simulated axis on an ideal bus; None for any other rig."""
    if not isinstance(rig, Rig):
        return None
    plant = rig.nodes.plant if rig.nodes is not None else None
    if (
        rig.section.mode is not DriveMode.CST
        or rig.section.interface != "inprocess"
        or not isinstance(plant, Plant)
        or not (rig.encoder is None or isinstance(rig.encoder, CanopenEncoder))
    ):
        return None
    steps = plant.steps_in(rig.bench.gains.period_s)
    return CompiledTicks(SimulatedAxis(plant.parameters, plant.state, plant.lines, steps, _scales(rig)), recorder)


def _scales(rig: Rig) -> Scales:
    """Conversions of the simulated devices and the drivers, in the same order of operations."""
    assert rig.nodes is not None
    number = rig.nodes.drive.dictionary.number
    info, rated_mn_m = rig.drive.info, number(Index.RATED_TORQUE)
    table = rig.bench.encoders.table
    resolution_m, step_m = 1.0, 1.0
    if isinstance(rig.encoder, CanopenEncoder) and table is not None:
        resolution_m, step_m = table.resolution_m, rig.encoder.step_m
    return Scales(
        counts_per_rad=number(Index.POSITION_ENCODER_RESOLUTION, 1) / (2.0 * math.pi),
        rad_per_count=info.rad_per_count,
        counts_per_m=1.0 / resolution_m,
        m_per_count=step_m,
        command_mille_per_n_m=1 / info.torque_resolution_n_m,
        command_n_m_per_mille=rated_mn_m / 1e6,
        mille_per_n_m=1e6 / rated_mn_m,
        n_m_per_mille=info.torque_resolution_n_m,
        max_mille=float(number(Index.MAX_TORQUE)),
    )
