"""Residuals before and after, by channel, on training and on held-out recordings, beside the noise floor.

Figures are in closed loop unless the control law is unknown or the loop is chaotic: with stick-slip or play two
recordings of the same axis diverge, and a twin at the noise floor in every block deviates from the recording. Then the
figures are block by block, with measured inputs. The same holds for the motor position if its encoder resolves the
motion caused by the torque noise, and if the twin does not hold its closed loop.
"""

import math
from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.channels import CHANNELS
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import ChannelFit, FitFigures, Mode
from hil.diagnosis.wording import channel_names
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.honest_refit import holds
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.noise_floor import floor, noise_response, rms, sensor_noise


def channel_residuals(hypothesis: Hypothesis, data: Dataset, mode: Mode) -> tuple[dict[str, FloatArray], ...]:
    """Residuals (n,) of each run by channel, in its unit.

    The table channel is the table position in closed loop, table less motor position block by block.
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

    given: Hypothesis
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
        white = float(np.sqrt(np.mean(np.square(lapped or [rms for rms, _ in own]))))
        closed = self.mode is Mode.CLOSED_LOOP
        by_bench_file = math.inf if closed and not holds(self.given, data) else self._rms(self.given, data)
        return FitFigures(
            before_rms=self._rms(self.nominal, data),
            after_rms=self._rms(self.final, data),
            noise_floor_rms=white,
            # the twin may diverge with the values of the bench file
            owner_rms=by_bench_file if math.isfinite(by_bench_file) else None,
        )

    def _of(self, hypothesis: Hypothesis, data: Dataset) -> list[FloatArray]:
        return [found[self.channel] for found in channel_residuals(hypothesis, data, self.mode)]

    def _rms(self, hypothesis: Hypothesis, data: Dataset) -> float:
        pairs = zip(self._of(hypothesis, data), data.runs, strict=True)
        return rms(np.concatenate([values[run.evaluated] for values, run in pairs]))

    def _floors(self, data: Dataset) -> list[tuple[float, bool]]:
        """Floor of each run, True if from repeated laps.

        It is the lower one of two hypotheses: a lap-to-lap difference of only one of them is its own error.
        """
        found = []
        runs = zip(data.runs, self._of(self.nominal, data), self._of(self.final, data), strict=True)
        for index, (run, *pair) in enumerate(runs):
            white = self._white(data, index)
            found.append((min(floor(values, white, run.laps) for values in pair), run.laps is not None))
        return found

    def _white(self, data: Dataset, index: int) -> float:
        """White noise of the channel in a run.

        Block by block it is the scale of the weighted residuals. In closed loop it is the noise of the sensor and the
        response of the axis to the noise of its encoders.
        """
        run = data.runs[index]
        if self.mode is Mode.BLOCKS:
            return rms(data.noise[index][self.channel][run.evaluated])
        return math.hypot(sensor_noise(run)[self.channel], self.noise[run][self.channel])


def closed_loop_held(nominal: Fit, final: Fit, held_out: Dataset) -> bool:
    """True if the control law is known, and refitted and final twin keep to all recordings in closed loop."""
    sets = [data for data in (final.data, held_out) if data.runs]
    return final.data.observability.closed_loop and all(
        holds(fit.hypothesis, data) for fit in (nominal, final) for data in sets
    )


def fit_table(given: Fit, nominal: Fit, final: Fit, held_out: Dataset) -> dict[str, ChannelFit]:
    """Compute the figures of each recorded channel."""
    train = final.data
    sets = [data for data in (train, held_out) if data.runs]
    laps = any(data.laps for data in sets)
    held = closed_loop_held(nominal, final, held_out)
    modes = (Mode.CLOSED_LOOP, Mode.BLOCKS) if held else (Mode.BLOCKS,)
    noise = {run: noise_response(final.hypothesis, run) if held else {} for data in sets for run in data.runs}
    result = {}
    for channel, recorded in channel_names(final.bench, train.runs[0]).items():
        shown = train.runs[0]
        if channel == "command" or channel in shown.observability.hidden:
            continue
        if channel == "torque" and not shown.observability.torque_and_command and not held:  # the twin was given it
            continue
        figures = {
            mode: [table.figures(data, held_out if data is train else train) for data in sets]
            for mode in modes
            for table in [_ChannelTable(given.hypothesis, nominal.hypothesis, final.hypothesis, noise, channel, mode)]
        }
        mode = modes[0]
        if held:
            closed, block = (max(one.after_rms / one.noise_floor_rms for one in figures[mode]) for mode in figures)
            chaotic = closed > CRITERIA.strays >= block and shown.observability.torque_and_command
            mode = Mode.BLOCKS if chaotic else Mode.CLOSED_LOOP
        result[recorded] = ChannelFit(
            unit="rad" if final.bench.axis.turns and channel == "table" else CHANNELS[recorded].unit,
            mode=mode,
            floor_from="repeated_laps" if laps else "white_noise",
            train=figures[mode][0],
            validate_=figures[mode][1] if held_out.runs else None,
        )
    return result
