"""A run in virtual time, its uneventful ticks in one compiled call: some three times as fast as frame by frame.

Arming, disarming and every event go over the simulated bus (`hil.loop.session`). Between them the same compiled cycle
and the same compiled axis take turns, with values rounded as CAN frames round them: every row has the bits that the bus
would give. When a limit of the axis is passed, the ticks since the last snapshot are run again over the bus.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numba import njit

from drivers.canopen_encoder import CanopenEncoder
from drivers.port import DriveSample, EncoderSample
from drivers.sim import kernel
from drivers.sim.plant import Plant
from hil.arrays import FloatArray
from hil.bench.hardware import DriveMode
from hil.compiled.source_digest import source_digest
from hil.loop import cycle as compiled
from hil.loop.devices import Rig
from hil.loop.session import Rows, Session

SNAPSHOT_TICKS = 2000
LAST_TICKS = 20  # over the bus again, so that the devices know where the axis is when they disarm
_MAX_TORQUE, _RATED_TORQUE, _COUNTS = 0x6072, 0x6076, 0x608F

# Entries of `scales`: to counts and back, of the motor, the table, the commanded and the measured torque.
(
    COUNTS_PER_RAD,
    RAD_PER_COUNT,
    COUNTS_PER_M,
    M_PER_COUNT,
    COMMAND_MILLE_PER_N_M,
    COMMAND_N_M_PER_MILLE,
    MILLE_PER_N_M,
    N_M_PER_MILLE,
    MAX_MILLE,
    SCALES,
) = range(10)
# Entries of `sample`: motor [rad or m], table [m], torque [N m or N].
MOTOR, TABLE, TORQUE = range(3)


class BlockRows(Rows, Protocol):
    """What takes rows one by one and many at once."""

    def record_block(self, rows: FloatArray) -> None: ...


_cycle, _advance = compiled.compiled_cycle, kernel.advance


def _build_ticks(digest: str) -> Any:
    @njit(cache=True, _nrt=False, error_model="numpy")
    def ticks(  # type: ignore[no-untyped-def]
        first,
        count,
        drive_state,
        sample,
        scales,
        block,
        plant,
        state,
        lines,
        steps,
        setpoints,
        watch,
        laws,
        states,
        constants,
        modes,
        values,
        codes,
        delta,
        memory,
        rows,
        place,
    ):
        """Ticks first .. first + count - 1; block[k] is the row before tick first + k. Whether no limit was passed."""
        assert digest
        width = block.shape[1]
        for k in range(count):
            tick = first + k
            setpoint, passed = _cycle(
                tick,
                tick,
                sample[MOTOR],
                sample[TABLE],
                sample[TORQUE],
                drive_state,
                0,
                0.0,
                0.0,
                setpoints,
                watch,
                laws,
                states,
                constants,
                modes,
                values,
                codes,
                delta,
                memory,
                rows,
                place,
            )
            for column in range(width):
                block[k, column] = rows[(tick + 1) & 1, column]
            if passed:
                return False
            mille = np.rint(setpoint * scales[COMMAND_MILLE_PER_N_M])
            mille = min(max(mille, -scales[MAX_MILLE]), scales[MAX_MILLE])
            _advance(plant[0], state[0], lines, mille * scales[COMMAND_N_M_PER_MILLE], steps)
            sample[MOTOR] = np.rint(state[0].motor_recorded * scales[COUNTS_PER_RAD]) * scales[RAD_PER_COUNT]
            sample[TABLE] = np.rint(state[0].table_recorded * scales[COUNTS_PER_M]) * scales[M_PER_COUNT]
            torque = np.rint(state[0].torque_recorded * scales[MILLE_PER_N_M])
            sample[TORQUE] = min(max(torque, -32768.0), 32767.0) * scales[N_M_PER_MILLE]
        return True

    return ticks


# The sources of the simulated axis stamp the types of its records.
_ticks = _build_ticks(source_digest("loop/cycle.py"))


class VirtualSession(Session):
    """A session in virtual time on a simulated bench; see the module."""

    def _loop(self, sample: DriveSample, seen: EncoderSample, tick: int = 0) -> int:
        if self._can_be_compiled():
            tick, sample, seen = self._run_compiled(sample, seen)
        return super()._loop(sample, seen, tick)

    def _can_be_compiled(self) -> bool:
        """Torque control of a simulated axis on an ideal bus; the rest goes over the bus."""
        rig, section = self._rig, self._rig.section
        if not isinstance(rig, Rig):  # other devices have no compiled counterpart
            return False
        encoder_is_ideal = rig.encoder is None or isinstance(rig.encoder, CanopenEncoder)
        return (
            section.mode is DriveMode.CST
            and section.interface == "inprocess"
            and encoder_is_ideal
            and rig.nodes is not None
            and isinstance(rig.nodes.plant, Plant)
            and not rig.ports
        )

    def _run_compiled(self, sample: DriveSample, seen: EncoderSample) -> tuple[int, DriveSample, EncoderSample]:
        """The tick to go on with over the bus, and its samples."""
        assert isinstance(self._rig, Rig)
        nodes = self._rig.nodes
        assert nodes is not None
        plant = nodes.plant
        assert isinstance(plant, Plant)
        cycle, recorder = self._cycle, self._recorder
        cycle.follow(self._trajectory)
        numbers = np.array([sample.motor_position_rad, seen.position_m, sample.torque_n_m])
        scales, steps = self._scales(), plant.steps_in(self._period_s)
        moving = (plant.state, plant.lines, numbers, *cycle.state_arrays)
        block = np.empty((SNAPSHOT_TICKS, len(cycle.channels)))
        tick, end = 0, max(0, len(self._trajectory) - LAST_TICKS)
        while tick < end and not self._stops_asked:
            snapshot = [array.copy() for array in moving]
            count = min(SNAPSHOT_TICKS, end - tick)
            if not _ticks(
                tick,
                count,
                int(sample.state),
                numbers,
                scales,
                block,
                plant.parameters,
                plant.state,
                plant.lines,
                steps,
                cycle.setpoints,
                *cycle.arrays,
            ):
                for array, before in zip(moving, snapshot, strict=True):
                    array[...] = before
                break
            recorder.record_block(block[tick == 0 : count])  # type: ignore[attr-defined]   # no row before the first
            tick += count
        self._lateness_s.extend([0.0] * tick)
        motor, table, torque = numbers.tolist()
        return (tick, sample._replace(motor_position_rad=motor, torque_n_m=torque), seen._replace(position_m=table))

    def _scales(self) -> FloatArray:
        """As the simulated drive and the real driver convert, in the same order of operations."""
        rig = self._rig
        assert isinstance(rig, Rig)
        assert rig.nodes is not None
        number = rig.nodes.drive.dictionary.number
        scales = np.ones(SCALES)
        info, rated_mn_m = rig.drive.info, number(_RATED_TORQUE)
        scales[COUNTS_PER_RAD], scales[RAD_PER_COUNT] = number(_COUNTS, 1) / (2.0 * math.pi), info.rad_per_count
        scales[COMMAND_MILLE_PER_N_M] = 1 / info.torque_resolution_n_m
        scales[COMMAND_N_M_PER_MILLE] = rated_mn_m / 1e6
        scales[MILLE_PER_N_M], scales[N_M_PER_MILLE] = 1e6 / rated_mn_m, info.torque_resolution_n_m
        scales[MAX_MILLE] = number(_MAX_TORQUE)
        table = rig.bench.encoders.table
        if isinstance(rig.encoder, CanopenEncoder) and table is not None:
            scales[COUNTS_PER_M], scales[M_PER_COUNT] = 1.0 / table.resolution_m, rig.encoder.step_m
        return scales
