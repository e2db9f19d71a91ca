"""Fit before and after, channel by channel, on training and on held-out recordings, against the noise floor.

Figures are of the closed loop unless that is chaotic: where stick-slip or play let two recordings of the same axis
diverge, a twin at the noise floor in every block still deviates from the recording in closed loop. Then the figures
are those of the block, which is fed measured inputs. The same holds for the position of the motor: its encoder
resolves far less than the motion caused by the torque noise.
"""

import math
from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS, CHANNELS
from hil.diagnosis.result import ChannelFit, FitFigures, Mode
from hil.identification.dataset import Dataset, Measured
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.noise_floor import floor, noise_response, rms, sensor_noise

STRAYS = 1.15  # times its floor: a closed loop above, though its block is at the floor, counts as chaotic


def channel_names(bench: Bench, run: Measured) -> dict[str, str]:
    """Channel of the twin -> name of the recorded channel."""
    names = AXIS_CHANNELS[run.kind]
    found = {"motor": names.motor_position, "torque": names.torque, "command": names.torque_command}
    if bench.has_table_encoder:
        found["table"] = names.table_position
    return found


def channel_residuals(hypothesis: Hypothesis, data: Dataset, mode: Mode) -> tuple[dict[str, FloatArray], ...]:
    """Residuals (n,) of each run by channel, in its unit.

    In closed loop the table is compared as it is, block by block less the motor.
    """
    if mode is Mode.BLOCKS:
        return hypothesis.residuals(data).channels
    ratio = hypothesis.bench.axis.ratio_m_rad
    return tuple(
        {**found, "table": found["table"] + ratio * found["motor"]} if "table" in found else found
        for found in hypothesis.residuals(data, closed=True).channels
    )


@dataclass(frozen=True, eq=False)
class _ChannelTable:
    """Figures of one channel in one mode for the three hypotheses."""

    owner: Hypothesis
    nominal: Hypothesis
    final: Hypothesis
    noise: dict[Measured, dict[str, float]]  # closed-loop response of the axis to the noise of its encoders
    channel: str
    mode: Mode

    def figures(self, data: Dataset, other: Dataset) -> FitFigures:
        """Figures on a data set; the laps of the `other` give the floor where it has none itself."""
        own = self._floors(data)
        lapped = [rms for rms, repeated in own if repeated] or [
            rms for rms, repeated in self._floors(other) if repeated
        ]
        return FitFigures(
            before_rms=self._rms(self.nominal, data),
            after_rms=self._rms(self.final, data),
            noise_floor_rms=float(np.sqrt(np.mean(np.square(lapped or [rms for rms, _ in own])))),
            owner_rms=self._rms(self.owner, data),
        )

    def _of(self, hypothesis: Hypothesis, data: Dataset) -> list[FloatArray]:
        return [found[self.channel] for found in channel_residuals(hypothesis, data, self.mode)]

    def _rms(self, hypothesis: Hypothesis, data: Dataset) -> float:
        pairs = zip(self._of(hypothesis, data), data.runs, strict=True)
        return rms(np.concatenate([values[run.judged] for values, run in pairs]))

    def _floors(self, data: Dataset) -> list[tuple[float, bool]]:
        """Floor of each run, and whether it is from repeated laps.

        The lower one of two hypotheses: a difference from lap to lap that only one of them has is its own error.
        """
        found = []
        runs = zip(data.runs, self._of(self.nominal, data), self._of(self.final, data), strict=True)
        for index, (run, *pair) in enumerate(runs):
            white = self._white(data, index)
            best = min((floor(values, white, run.laps) for values in pair), key=lambda one: one.rms)
            found.append((best.rms, best.source == "repeated_laps"))
        return found

    def _white(self, data: Dataset, index: int) -> float:
        """White noise of the channel in a run.

        Block by block that of its scale: the motor counts from the torque that the torque channel resolves. In closed
        loop the response of the axis to the noise of its encoders adds to that of the sensor.
        """
        run = data.runs[index]
        if self.mode is Mode.BLOCKS:
            return rms(data.noise[index][self.channel][run.judged])
        return math.hypot(sensor_noise(run)[self.channel], self.noise[run][self.channel])


def fit_table(owner: Fit, nominal: Fit, final: Fit, held_out: Dataset) -> dict[str, ChannelFit]:
    """The table, by recorded channel."""
    train = final.data
    sets = [data for data in (train, held_out) if data.runs]
    laps = any(data.laps for data in sets)
    noise = {run: noise_response(final.hypothesis, run) for data in sets for run in data.runs}
    result = {}
    for channel, recorded in channel_names(final.bench, train.runs[0]).items():
        if channel == "command":
            continue
        figures = {
            mode: [table.figures(data, held_out if data is train else train) for data in sets]
            for mode in (Mode.CLOSED_LOOP, Mode.BLOCKS)
            for table in [_ChannelTable(owner.hypothesis, nominal.hypothesis, final.hypothesis, noise, channel, mode)]
        }
        closed, block = (max(one.after_rms / one.noise_floor_rms for one in figures[mode]) for mode in figures)
        chaotic = closed > STRAYS >= block and not train.runs[0].torque_is_command
        mode = Mode.BLOCKS if chaotic else Mode.CLOSED_LOOP
        result[recorded] = ChannelFit(
            unit=CHANNELS[recorded].unit,
            mode=mode,
            floor_from="repeated_laps" if laps else "white_noise",
            train=figures[mode][0],
            validate_=figures[mode][1] if held_out.runs else None,
        )
    return result
