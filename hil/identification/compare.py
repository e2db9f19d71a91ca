"""Measured over simulated: the twin in closed loop from a recording's own set-points, and block by block.

Velocity, acceleration and jerk are derivatives of the table position (the motor's where there is no linear
encoder), measured and simulated alike low-passed first: Butterworth, 4th order, 100 Hz, forwards and backwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import butter, filtfilt

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode
from hil.errors import HilError, InputError
from hil.identification.blocks import BlockDeviation, compare_blocks
from hil.identification.dataset import SETTLE_S, Measured, prepare_dataset, take
from hil.identification.hypothesis import Hypothesis
from hil.identification.inverse_dynamics import InverseDynamics, fit_inverse_dynamics
from hil.identification.noise_floor import FLOOR
from hil.identification.nominal_fit import MOST_STEPS, FitResult, fit_nominal
from hil.identification.residuals import datum_m
from hil.recording.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
LOW_PASS_HZ, LOW_PASS_ORDER = 100.0, 4
EXPLAINED: float = FLOOR**0.5  # rms over noise up to which a channel is explained, as in the diagnosis
TABLE_ACCURACY_M = 0.15e-6  # of the twin in closed loop: its own step, and counts that beat with the motion

Progress = Callable[[str, float | None], None]  # what is going on; the share that is done, None if not known


@dataclass(frozen=True, eq=False)
class Deviation:
    """One channel (n,), measured and simulated; figures are taken over the rows `judged`."""

    name: str
    label: str
    unit: str
    measured: FloatArray
    simulated: FloatArray
    judged: slice

    @property
    def values(self) -> FloatArray:
        """Measured less simulated (n,)."""
        return self.measured - self.simulated

    @cached_property
    def rms(self) -> float:
        """Root mean square of measured less simulated."""
        return _rms(self.values[self.judged])

    @cached_property
    def peak(self) -> float:
        """Largest absolute deviation."""
        return float(np.max(np.abs(self.values[self.judged])))

    @cached_property
    def relative(self) -> float:
        """rms of the deviation over rms of the measured channel; 0 where the channel is 0 throughout."""
        return self.rms / (_rms(self.measured[self.judged]) or np.inf)


@dataclass(frozen=True, eq=False)
class Comparison:
    """A recording against the twin of a bench, which `fit`, if it was asked for, has corrected."""

    recording: Recording
    measured: Measured
    bench: Bench
    channels: tuple[Deviation, ...]
    blocks: tuple[tuple[BlockDeviation, Deviation], ...]
    fit: FitResult | None
    inverse_dynamics: InverseDynamics | None
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        width = max(len(channel.name) for channel in self.channels)
        lines = [
            f"Comparison of {self.recording.name} with the twin of {self.bench.name}: "
            f"{'explained' if self.explained else 'not explained'} (allowed {EXPLAINED:g} x noise: torque "
            f"{self.torque_over_noise:.2f}, table against motor {self.table_over_noise:.2f})",
            f"  {'measured less simulated':{width}}  {'rms':>10}  {'largest':>10}  relative",
        ]
        lines += [
            f"  {channel.name:{width}}  {channel.rms:10.3g}  {channel.peak:10.3g}  {100.0 * channel.relative:7.3f} %"
            for channel in self.channels
        ]
        return "\n".join(lines)

    def channel(self, name: str) -> Deviation:
        """The deviation of a channel by its name."""
        return next(channel for channel in self.channels if channel.name == name)

    @property
    def torque(self) -> Deviation:
        """Deviation of the motor torque, on a linear axis the force."""
        return self.channels[-1]

    @property
    def torque_over_noise(self) -> float:
        """rms deviation of the torque over its white noise."""
        return self.torque.rms / self.measured.noise.torque if self.measured.noise.torque > 0.0 else np.inf

    @property
    def table_over_noise(self) -> float:
        """rms deviation of table less motor position over its noise; 0 without a linear encoder."""
        if not self.measured.table_m.size:
            return 0.0
        values = self.channels[0].values - self.channel("motor_position").values
        return _rms(values[self.measured.judged]) / max(self.measured.noise.table_m, TABLE_ACCURACY_M)

    @property
    def explained(self) -> bool:
        """Whether the twin explains the recording: torque, and table less motor, within 1.25 x their noise."""
        return bool(max(self.torque_over_noise, self.table_over_noise) <= EXPLAINED)

    def plot(self, blocks: bool = False, fastest_move: bool = False) -> Figure:
        """Draw measured, simulated and their deviation over time: the whole axis in closed loop or block by block.

        With `fastest_move` only the move with the greatest speed is drawn.
        """
        from hil.figures.drawing import over_time
        from hil.identification import figures

        what = "fastest move" if fastest_move else "block by block" if blocks else "whole recording"
        panels = figures.block_panels(self) if blocks else figures.motion_panels(self)
        rows = figures.fastest_move(self) if fastest_move else slice(None)
        return over_time(f"{self.recording.name}: {what}", self.measured.time_s, panels, rows)

    def as_json(self) -> dict[str, Any]:
        """The numbers, SI units in the names or beside them."""
        noise = self.measured.noise
        return {
            "schema_version": SCHEMA_VERSION,
            "recording": self.recording.name,
            "bench": self.bench.name,
            "rows": len(self.recording),
            "period_s": self.recording.period_s,
            "explained": self.explained,
            "torque_over_noise": self.torque_over_noise,
            "table_over_noise": self.table_over_noise,
            "low_pass_hz": LOW_PASS_HZ,
            "noise": {
                "motor_position": noise.motor,
                "table_less_motor_position_m": noise.table_m,
                "torque": noise.torque,
            },
            "channels": {channel.name: _figures(channel) for channel in self.channels},
            "blocks": {
                block.block: {"inputs": block.inputs, "output": block.output, **_figures(deviation)}
                for block, deviation in self.blocks
            },
            "parameters": [vars(parameter) for parameter in self.fit.parameters] if self.fit else None,
            "inverse_dynamics": vars(self.inverse_dynamics) if self.inverse_dynamics else None,
            "notes": list(self.notes),
        }


def compare(
    recording: Recording, bench: Bench, *, fit: bool = False, progress: Progress = lambda _task, _share: None
) -> Comparison:
    """Compare a recording with the twin of a bench; with `fit` its nominal parameters are fitted to it first.

    `progress` is told what is going on. Raises InputError where recording and bench
    do not belong together, HilError where the fit fails.
    """
    measured = take(recording, bench)
    data, fitted = prepare_dataset([measured], bench), None
    if fit:
        progress("fitting", None)
        fitted = fit_nominal(data)
        bench = fitted.bench
    progress("simulating", None)
    hypothesis = Hypothesis(bench)
    response = bench.twin().simulate(
        measured.position_command_m, measured.velocity_command_m_s, measured.start, measured.table_m
    )
    if not all(np.isfinite(values).all() for values in response):
        raise HilError(f"{bench.name}: the twin is unstable in closed loop; check the masses and gains of the bench")
    ratio = bench.axis.ratio_m_rad
    datum = datum_m(measured.response, response, ratio, measured.judged)
    # the encoder that the position loop goes by has that of the set-points
    of_table, of_motor = (0.0, -datum) if bench.gains.position_from_table else (datum, 0.0)
    progress("block by block", None)
    blocks = compare_blocks(hypothesis, data)
    table = measured.table_m.size > 0
    positions = (
        (measured.table_m - of_table, response.table_position_m)
        if table
        else (ratio * measured.motor, ratio * response.motor_position)
    )
    channels = [_channel(measured, *entry) for entry in _motion(measured, *positions, table)]
    if table:
        channels.append(
            _channel(
                measured,
                "motor_position",
                "motor position at the table",
                "m",
                ratio * measured.motor - of_motor,
                ratio * response.motor_position,
            )
        )
    linear = bench.axis.linear
    channels.append(
        _channel(
            measured,
            "force_n" if linear else "torque_n_m",
            "motor force" if linear else "motor torque",
            "N" if linear else "N m",
            measured.torque,
            response.torque,
        )
    )
    pairs = tuple(
        (block, _channel(measured, block.block, block.output, block.unit, block.measured, block.simulated))
        for block in blocks
    )
    inverse, remark = _inverse_dynamics(recording) if linear else (None, [])
    return Comparison(
        recording,
        measured,
        bench,
        tuple(channels),
        pairs,
        fitted,
        inverse,
        tuple(_notes(measured, bench, fitted, datum) + remark),
    )


def low_pass(values: FloatArray, period_s: float) -> FloatArray:
    """Low-passed without phase; the corner is kept below 0.4 of the sampling rate."""
    corner = min(2.0 * LOW_PASS_HZ * period_s, 0.8)
    return np.asarray(filtfilt(*butter(LOW_PASS_ORDER, corner), values), dtype=np.float64)


def _motion(
    measured: Measured, position: FloatArray, simulated: FloatArray, table: bool
) -> Iterator[tuple[str, str, str, FloatArray, FloatArray]]:
    where = "table" if table else "motor"
    command, period_s = measured.position_command_m, measured.period_s
    yield f"{where}_position_m", f"{where} position", "m", position, simulated
    yield "following_error_m", "following error", "m", command - position, command - simulated
    pair = [low_pass(position, period_s), low_pass(simulated, period_s)]
    for name, label, unit in (
        ("velocity_m_s", "velocity", "m/s"),
        ("acceleration_m_s2", "acceleration", "m/s^2"),
        ("jerk_m_s3", "jerk", "m/s^3"),
    ):
        pair = [np.gradient(values, period_s) for values in pair]
        yield name, label, unit, pair[0], pair[1]


def _channel(
    measured: Measured, name: str, label: str, unit: str, values: FloatArray, simulated: FloatArray
) -> Deviation:
    return Deviation(name, label, unit, values, simulated, measured.judged)


def _inverse_dynamics(recording: Recording) -> tuple[InverseDynamics | None, list[str]]:
    try:
        return fit_inverse_dynamics(recording), []
    except InputError as error:  # a short or one-way recording can still be compared
        return None, [f"No inverse-dynamics fit: {error}"]


def _notes(measured: Measured, bench: Bench, fit: FitResult | None, datum: float) -> list[str]:
    notes = [
        "Velocity, acceleration and jerk: derivatives after a Butterworth low-pass of 4th order at "
        f"{LOW_PASS_HZ:g} Hz, forwards and backwards, on measured and simulated alike.",
        f"The rows before the first motion, {SETTLE_S:g} s at least, are simulated but not judged: how the axis came "
        "to rest there is not known.",
    ]
    if measured.table_m.size:
        other = "motor" if bench.gains.position_from_table else "linear"
        notes.append(
            f"The {other} encoder has a datum of its own: {1e6 * abs(datum):.3g} µm from that of the twin, "
            "taken off its position."
        )
    if bench.drive is not None and bench.drive.mode is not DriveMode.CST:
        notes.append(
            f"In {bench.drive.mode} the drive closes loops of its own; the twin closes them with the law and "
            f"the periods of the bench file (velocity loop {1e3 * measured.period_s:g} ms). A drive whose "
            "loops run otherwise, faster for instance, deviates from it whatever the axis."
        )
    if measured.torque_is_command:
        notes.append(
            "Only one of torque and torque command is recorded: the drive cannot be compared, and the noise "
            "of the torque is what the encoder puts into its command."
        )
    if fit is not None:
        notes.append("The parameters were fitted to this recording; judge them on another one with the fitted bench.")
    if fit is not None and not fit.converged:
        notes.append(
            f"The fit was ended after {MOST_STEPS} steps while its parameters still crept along a valley: the "
            "recording does not determine them all, or the twin leaves something out."
        )
    return notes


def _figures(deviation: Deviation) -> dict[str, Any]:
    return {"unit": deviation.unit, "rms": deviation.rms, "peak": deviation.peak, "relative": deviation.relative}


def _rms(values: FloatArray | Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
