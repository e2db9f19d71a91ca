"""Channel time skew: one recorded channel is late against the others."""

import math
from collections.abc import Sequence

import numpy as np

from hil.arrays import FloatArray
from hil.twin.mechanism import Block, Mechanism, Stage, Variant
from hil.twin.parameter import Dimension, Parameter, Role

Channels = tuple[FloatArray, ...]  # motor position, table position, torque command, torque


def _late_motor(channels: Channels, parameters: Sequence[float], period_s: float) -> Channels:
    motor, table, command, torque = channels
    return delayed(motor, parameters[0] / period_s), table, command, torque


def _late_table(channels: Channels, parameters: Sequence[float], period_s: float) -> Channels:
    motor, table, command, torque = channels
    return motor, delayed(table, parameters[0] / period_s), command, torque


def _late_torque(channels: Channels, parameters: Sequence[float], period_s: float) -> Channels:
    motor, table, command, torque = channels
    return motor, table, command, delayed_mean(torque, parameters[0] / period_s)


def delayed_mean(means: FloatArray, periods: float) -> FloatArray:
    """Delay means over each period (n,) of a held quantity by a number of periods; the ends are held."""
    whole = math.floor(periods)
    f, last = periods - whole, means.size - 1
    nearest = np.arange(means.size) - whole
    return np.asarray(
        (1.0 - f) * means[np.clip(nearest, 0, last)] + f * means[np.clip(nearest - 1, 0, last)], dtype=np.float64
    )


def delayed(samples: FloatArray, periods: float) -> FloatArray:
    """Delay samples (n,) by a number of periods: cubic convolution, continuous in delay and slope."""
    whole = math.floor(periods)
    f = periods - whole
    # weights of the samples 1 after to 2 before the whole delay (Keys, a = -1/2)
    weights = (
        0.5 * f * (-1.0 + f * (2.0 - f)),
        1.0 + 0.5 * f * f * (3.0 * f - 5.0),
        0.5 * f * (1.0 + f * (4.0 - 3.0 * f)),
        0.5 * f * f * (f - 1.0),
    )
    last = samples.size - 1
    nearest = np.arange(samples.size) - whole
    late = np.zeros(samples.size)
    for before, weight in zip((-1, 0, 1, 2), weights, strict=True):
        late += weight * samples[np.clip(nearest - before, 0, last)]
    return late


MECHANISM = Mechanism(
    id="channel_time_skew",
    block=Block.SENSOR,
    element="time stamps of a channel",
    sentence="The channel is recorded {delay_s} late against the others.",
    equation="y_recorded(t) = y(t - delay)",
    source="Keys, IEEE Trans. Acoustics, Speech, and Signal Processing 29 (1981) 1153, cubic convolution",
    parameters=(Parameter("delay_s", Dimension.TIME, -0.01, 0.01, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.CHANNEL, _late_table, "table_position", needs_table=True),
        Variant(Stage.CHANNEL, _late_torque, "torque"),
        Variant(Stage.CHANNEL, _late_motor, "motor_position", sign=-1.0),
    ),
    first_unless_clear=True,  # motor position and torque are the clock unless their relation says otherwise
    starts=lambda s: [(2e-4,)],
    typical=lambda a: (2e-4,),
)
