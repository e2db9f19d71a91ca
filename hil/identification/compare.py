"""Compare a recording with the twin, simulated in closed loop from the recorded set-points, and block by block."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode
from hil.errors import InputError
from hil.identification import comparison_text
from hil.identification.comparison_text import EXPLAINED
from hil.identification.dataset import Dataset, prepare_dataset
from hil.identification.derived_channels import completed, reduced
from hil.identification.honest_refit import rms_of_channels, stays, unstable
from hil.identification.hypothesis import Hypothesis
from hil.identification.inverse_dynamics import InverseDynamics, fit_inverse_dynamics
from hil.identification.measured import SETTLE_S, Measured, take
from hil.identification.noise_floor import rms
from hil.identification.nominal_fit import MOST_STEPS, FitResult, fit_nominal
from hil.identification.residuals import datum_m, differences
from hil.identification.twin_deviation import (
    CONTROLLER_BLOCK,
    LOW_PASS_HZ,
    MOTOR_BLOCK,
    TABLE_BLOCK,
    BlockDeviation,
    Deviation,
    compare_blocks,
    motion_channels,
)
from hil.recording.recording import Recording

if TYPE_CHECKING:
    from hil.figures.drawing import Drawing

SCHEMA_VERSION = 1
# Least noise of table less motor position: error of the integration step and beat of the encoder counts in closed loop.
TABLE_ACCURACY_M = 0.15e-6

_UNKNOWN_LAW = (
    "The control law is unknown: the twin is compared block by block, from measured torque to measured motion, and not "
    "in closed loop."
)

Progress = Callable[[str, float | None], None]  # name of the step, share that is done or None if unknown


@dataclass(frozen=True, eq=False)
class Comparison:
    """Deviations of a recording from the twin of `bench`; with a `fit`, `bench` has the fitted parameters.

    `channels` are in closed loop, the torque last; there are none if the twin is unstable there. `blocks` are block by
    block.
    """

    recording: Recording
    measured: Measured
    bench: Bench
    channels: tuple[Deviation, ...]
    blocks: tuple[BlockDeviation, ...]
    fit: FitResult | None
    inverse_dynamics: InverseDynamics | None
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return comparison_text.in_lines(self)

    def _repr_html_(self) -> str:
        return comparison_text.as_html(self)

    @property
    def statement(self) -> str:
        """Whether the twin explains the recording and, if not, which block deviates most, in words."""
        return comparison_text.statement(self)

    def channel(self, name: str) -> Deviation:
        """The deviation of a channel by its name."""
        return next(channel for channel in self.channels if channel.name == name)

    @property
    def held(self) -> bool:
        """False if the control law is unknown or the twin is unstable with it: all figures are block by block then."""
        return bool(self.channels)

    def _block(self, name: str) -> BlockDeviation | None:
        return next((block for block in self.blocks if block.deviation.name == name), None)

    @property
    def torque(self) -> Deviation:
        """Deviation of the motor torque, on a linear axis the force."""
        motor = self._block(MOTOR_BLOCK)
        return self.channels[-1] if self.held or motor is None else motor.deviation

    @property
    def torque_over_noise(self) -> float:
        """rms deviation of the torque over its white noise."""
        return self.torque.rms / self.measured.noise.torque if self.measured.noise.torque > 0.0 else np.inf

    @property
    def table_over_noise(self) -> float:
        """rms deviation of table less motor position over its noise; 0 without a linear encoder."""
        if not self.measured.table_m.size:
            return 0.0
        table = self._block(TABLE_BLOCK)
        if not self.held and table is not None:
            return table.deviation.rms / max(table.noise, TABLE_ACCURACY_M)
        values = self.channels[0].values - self.channel("motor_position").values
        return rms(values[self.measured.evaluated]) / max(self.measured.noise.table_m, TABLE_ACCURACY_M)

    @property
    def explained(self) -> bool:
        """True if torque and table less motor position deviate by at most 1.25 x their noise (rms) in closed loop."""
        return self.held and bool(max(self.torque_over_noise, self.table_over_noise) <= EXPLAINED)

    def plot(self, blocks: bool = False, fastest_move: bool = False) -> Drawing:
        """Draw measured, simulated and their deviation over time: the whole axis in closed loop or block by block.

        With `fastest_move` only the move with the greatest speed is drawn.
        """
        from hil.figures.drawing import over_time
        from hil.identification import figures

        blocks = blocks or not self.held
        what = "fastest move" if fastest_move else "block by block" if blocks else "whole recording"
        panels = figures.block_panels(self) if blocks else figures.motion_panels(self)
        rows = figures.fastest_move(self) if fastest_move else slice(None)
        return over_time(f"{self.recording.name}: {what}", self.measured.time_s, panels, rows)

    def as_json(self) -> dict[str, Any]:
        """Return the numbers as written to compare.json; SI units in the names or beside them."""
        noise = self.measured.noise
        return {
            "schema_version": SCHEMA_VERSION,
            "recording": self.recording.name,
            "bench": self.bench.name,
            "rows": len(self.recording),
            "period_s": self.recording.period_s,
            "explained": self.explained,
            "stable_in_closed_loop": self.held,
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
                block.deviation.name: {
                    "inputs": block.inputs,
                    "output": block.deviation.label,
                    **_figures(block.deviation),
                }
                for block in self.blocks
            },
            "parameters": [vars(parameter) for parameter in self.fit.parameters] if self.fit else None,
            "inverse_dynamics": vars(self.inverse_dynamics) if self.inverse_dynamics else None,
            "notes": list(self.notes),
        }


def compare(
    recording: Recording, bench: Bench, *, fit: bool = False, progress: Progress = lambda _task, _share: None
) -> Comparison:
    """Compare a recording with the twin of a bench.

    With `fit` the nominal parameters are fitted to the recording first. `progress` gets the name of each step. Raises
    InputError if recording and bench do not belong together, HilError if the fit fails. For an unknown control law, and
    for a twin that is unstable in closed loop, there are figures block by block only.
    """
    if not bench.law_known:
        bench = reduced(bench, [recording])
        recording = completed(recording, bench)
    measured = take(recording, bench)
    data, fitted = prepare_dataset([measured], bench), None
    if fit:
        progress("fitting", None)
        fitted = fit_nominal(data, partial(_figures_of, measured, data))
        bench = fitted.bench
    progress("simulating", None)
    closed_loop = measured.observability.closed_loop
    channels, datum = _closed_loop(measured, bench) if closed_loop else ([], 0.0)
    progress("block by block", None)
    blocks = compare_blocks(Hypothesis(bench), data)
    if not closed_loop:
        blocks = tuple(block for block in blocks if block.deviation.name != CONTROLLER_BLOCK)
    inverse, remarks = _inverse_dynamics(recording) if bench.axis.linear else (None, [])
    notes = (*_notes(measured, bench, fitted, datum), *remarks)
    if not channels:
        notes = (unstable(measured) if closed_loop else _UNKNOWN_LAW, *notes)
    return Comparison(recording, measured, bench, tuple(channels), blocks, fitted, inverse, notes)


def _figures_of(measured: Measured, data: Dataset, hypothesis: Hypothesis) -> dict[str, float]:
    """Every rms deviation that a comparison with a hypothesis reports; infinite in closed loop if it is unstable."""
    figures = rms_of_channels(hypothesis, data)
    if not measured.observability.closed_loop:
        return figures
    channels, _ = _closed_loop(measured, hypothesis.resolved.bench)
    return (
        figures
        | {name: math.inf for name in ("velocity_m_s", "acceleration_m_s2", "jerk_m_s3")}
        | {channel.name: channel.rms for channel in channels if channel.name not in ("torque_n_m", "force_n")}
    )


def _closed_loop(measured: Measured, bench: Bench) -> tuple[list[Deviation], float]:
    """Deviations in closed loop, none if the twin is unstable, and the datum of the linear encoder [m]."""
    response = bench.twin().simulate(
        measured.position_command_m,
        measured.velocity_command_m_s,
        measured.start,
        measured.table_m,
        feedforward=measured.feedforward,
    )
    if not stays(
        differences(measured.response, response, bench, measured.evaluated), measured.response, measured.evaluated
    ):
        return [], 0.0
    ratio = bench.axis.ratio_m_rad
    datum = datum_m(measured.response, response, ratio, measured.evaluated)
    # the datum of the encoder that closes the position loop is that of the set-points
    of_table, of_motor = (0.0, -datum) if bench.gains.position_from_table else (datum, 0.0)
    evaluated, linear = measured.evaluated, bench.axis.linear
    motor_m, simulated_m = ratio * measured.motor, ratio * response.motor_position
    if measured.table_m.size:
        channels = motion_channels(measured, measured.table_m - of_table, response.table_position_m)
        label = "motor position at the table"
        channels.append(Deviation("motor_position", label, "m", motor_m - of_motor, simulated_m, evaluated))
    else:
        channels = motion_channels(measured, motor_m, simulated_m)
    name, label, unit = ("force_n", "motor force", "N") if linear else ("torque_n_m", "motor torque", "N m")
    channels.append(Deviation(name, label, unit, measured.torque, response.torque, evaluated))
    return channels, datum


def _inverse_dynamics(recording: Recording) -> tuple[InverseDynamics | None, list[str]]:
    try:
        return fit_inverse_dynamics(recording), []
    except InputError as error:  # too short or in one direction only: the comparison itself is possible
        return None, [f"No inverse-dynamics fit: {error}"]


def _notes(measured: Measured, bench: Bench, fit: FitResult | None, datum: float) -> list[str]:
    notes = [
        "Velocity, acceleration and jerk: derivatives after a Butterworth low-pass of 4th order at "
        f"{LOW_PASS_HZ:g} Hz, forwards and backwards, on measured and simulated alike.",
        f"The rows before the first motion, {SETTLE_S:g} s at least, are simulated but not evaluated: the friction "
        "state in which the axis rests is unknown.",
    ]
    if measured.table_m.size:
        other = "motor" if bench.gains.position_from_table else "linear"
        notes.append(
            f"The offset between the zeros of the two encoders, {1e6 * abs(datum):.3g} µm, was subtracted from the "
            f"position of the {other} encoder."
        )
    if bench.drive is not None and bench.drive.mode is not DriveMode.CST:
        notes.append(
            f"In {bench.drive.mode} the drive closes its own control loops; the twin simulates them with the control "
            f"law and the periods of the bench file (velocity loop {1e3 * measured.period_s:g} ms). A drive with "
            "another control law or period deviates from the twin even if the axis is modelled exactly."
        )
    if not measured.observability.torque_and_command:
        notes.append(
            "Only one of torque and torque command is recorded: the drive cannot be compared, and the noise of the "
            "torque is the noise of its command, caused by the encoder through the controller."
        )
    if fit is not None:
        notes.append("The parameters were fitted to this recording: validate the fitted bench on another recording.")
    if fit is not None and fit.note:
        notes.append(fit.note)
    stuck = [parameter.name for parameter in fit.parameters if parameter.at_bound] if fit else []
    if stuck:
        notes.append(
            f"{', '.join(stuck)}: not identifiable from this motion, the fit ended at the bound of the allowed range."
        )
    if fit is not None and not fit.converged:
        notes.append(
            f"The fit was stopped after {MOST_STEPS} steps before it converged: the recording does not determine all "
            "parameters, or the twin lacks an effect."
        )
    return notes


def _figures(deviation: Deviation) -> dict[str, Any]:
    return {"unit": deviation.unit, "rms": deviation.rms, "peak": deviation.peak, "relative": deviation.relative}
