"""Residuals, measured less simulated, by named channel and run.

Each encoder has its own datum; only that of the position loop is the datum of the set-points. Channels that are not
recorded are absent.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.identification.dataset import Dataset
from hil.identification.residual_scales import TORQUE_ACCURACY
from hil.twin.axis import Response

_LOST = 1e6  # bound of weighted residuals: beyond, an unstable hypothesis is not resolved further


class ChannelEnergy(NamedTuple):
    """Energy of the weighted residuals of a channel, its rows, and the energy of the noise that is there, in noise^2.

    The noise is that of `noise_there`, and per row at least the mean of all channels: a share of a residual far below
    its noise is no evidence.
    """

    energy: float
    rows: int
    noise: float


def noise_there(part: FloatArray) -> float:
    """Energy of the noise in a weighted residual (n,): all of it, up to one for each row.

    The noise of a channel is an upper bound where its inputs are open.
    """
    return min(float(part @ part), float(part.size))


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one hypothesis on a data set.

    `channels` holds, for each run, measured less simulated (n,) per channel: motor [rad or m], table less motor [m],
    torque and, block by block, command [N m or N]. `torque_accuracy` sets the weight of the motor channel.
    """

    data: Dataset
    channels: tuple[dict[str, FloatArray], ...]
    torque_accuracy: float = TORQUE_ACCURACY

    def weighted_by(self, torque_accuracy: float) -> "Residuals":
        """The same residuals with another weight of the motor channel."""
        if torque_accuracy == self.torque_accuracy:
            return self
        return Residuals(self.data, self.channels, torque_accuracy)

    def over_noise(self, run: int) -> dict[str, FloatArray]:
        """Residuals (n,) of all rows of a run in units of noise."""
        scale = self.data.noise[run]
        return {name: _bounded(values, scale[name]) for name, values in self.channels[run].items()}

    @cached_property
    def vector(self) -> FloatArray:
        """Weighted residuals (m,) of the evaluated rows, run after run and channel after channel."""
        return np.concatenate([part for _, part in self._weighted()])

    @cached_property
    def parts(self) -> dict[tuple[int, str], FloatArray]:
        """Weighted residuals of the evaluated rows by (index of the run, channel); size <= 1 at the noise floor."""
        return dict(zip(self._keys(), np.split(self.vector, self.splits), strict=True))

    @cached_property
    def by_channel(self) -> dict[str, ChannelEnergy]:
        """Energy of each channel over all runs; a hidden one has none."""
        found = dict[str, ChannelEnergy]()
        parts = ((name, part) for (_, name), part in self.parts.items() if name not in self.data.observability.hidden)
        for channel, part in parts:
            energy, rows, noise = found.get(channel, ChannelEnergy(0.0, 0, 0.0))
            own = float(part @ part)
            found[channel] = ChannelEnergy(energy + own, rows + part.size, noise + noise_there(part))
        mean = sum(one.noise for one in found.values()) / max(sum(one.rows for one in found.values()), 1)
        return {name: one._replace(noise=max(one.noise, mean * one.rows)) for name, one in found.items()}

    @cached_property
    def likelihood_loss(self) -> tuple[float, FloatArray]:
        """Loss of a fit, and the weights (m,) with which its least squares go down.

        Minus twice the logarithm of the likelihood where the noise of a channel is not known but at least its floor:
        sum over channels of n m for a mean square m up to 1, else n (1 + log m), in units of the floor (Seber and Wild,
        Nonlinear Regression, 1989, 11.2). A channel with a mismatch does not bend what another one tells: the weight is
        that of the slope, 1 / sqrt(m).
        """
        mean = {name: one.energy / max(one.rows, 1) for name, one in self.by_channel.items()}
        loss = sum(
            self.by_channel[name].rows * (value if value <= 1.0 else 1.0 + float(np.log(value)))
            for name, value in mean.items()
        )
        weights = np.concatenate(
            [np.full(part.size, max(mean.get(name, 0.0), 1.0) ** -0.5) for (_, name), part in self.parts.items()]
        )
        return loss, weights

    @cached_property
    def splits(self) -> tuple[int, ...]:
        """Rows of `vector` at which the parts after the first begin."""
        lengths = [self.data.runs[run].motor[self.data.runs[run].evaluated].size for run, _ in self._keys()]
        return tuple(int(row) for row in np.cumsum(lengths)[:-1])

    def split(self, values: FloatArray) -> list[FloatArray]:
        """Values (m,) or (m, k) by part, in the order of `parts`."""
        return np.split(values, self.splits)

    def _keys(self) -> list[tuple[int, str]]:
        return [(run, name) for run, channels in enumerate(self.channels) for name in channels]

    def _weighted(self) -> Iterator[tuple[str, FloatArray]]:
        scales = self.data.scales(self.torque_accuracy)
        for run, scale, channels in zip(self.data.runs, scales, self.channels, strict=True):
            rows = run.evaluated
            for name, values in channels.items():
                yield name, _bounded(values[rows], scale[name][rows])


def _bounded(values: FloatArray, scale: FloatArray) -> FloatArray:
    """Values (n,) over their scale, finite also for an unstable hypothesis."""
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = values / scale
        if np.isnan(ratio @ ratio):
            ratio[np.isnan(ratio)] = _LOST
        return np.clip(ratio, -_LOST, _LOST, out=ratio)


def datum_m(measured: Response, simulated: Response, ratio_m: float, evaluated: slice) -> float:
    """Datum of the linear encoder less that of a simulation [m]; 0 without a linear encoder.

    It is the mean difference of table less motor position over the evaluated rows.
    """
    if not measured.table_position_m.size:
        return 0.0
    return float(np.mean(_stretch(measured, simulated, ratio_m)[evaluated]))


def differences(measured: Response, simulated: Response, bench: Bench, evaluated: slice) -> dict[str, FloatArray]:
    """Measured less simulated (n,): motor [rad or m], table less motor [m], torque [N m or N], free of the datums.

    Values are not finite where the simulation is not. Without a linear encoder there is no "table".
    """
    ratio_m = bench.axis.ratio_m_rad
    with np.errstate(invalid="ignore", over="ignore"):  # a hypothesis may be unstable
        motor = measured.motor_position - simulated.motor_position
        residuals = {"motor": motor - np.mean(motor[evaluated]) if bench.gains.position_from_table else motor}
        if measured.table_position_m.size:
            residuals["table"] = _stretch(measured, simulated, ratio_m) - datum_m(
                measured, simulated, ratio_m, evaluated
            )
        residuals["torque"] = measured.torque - simulated.torque
    return residuals


def _stretch(measured: Response, simulated: Response, ratio_m: float) -> FloatArray:
    motor_m = ratio_m * (measured.motor_position - simulated.motor_position)
    return measured.table_position_m - simulated.table_position_m - motor_m
