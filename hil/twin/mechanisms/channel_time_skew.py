"""Channel time skew: one recorded channel is late against the others."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from hil.arrays import FloatArray
from hil.twin.mechanism import Block, Mechanism, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import Scene

_MOST_S = 0.05  # a row of a logger at 20 Hz
_ENDS = 64  # rows by which samples are continued: the response to a corner has fallen below 1 %
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


def _torque_starts(scene: Scene) -> list[tuple[float, ...]]:
    return [(delay_s,) for delay_s in (2e-4, -2e-4, *scene.delays_s(-_MOST_S, _MOST_S))]


@lru_cache(maxsize=64)
def _odd_length(least: int) -> int:
    """Smallest odd length from `least` on that has no prime factor above 7: its spectrum is quick to compute."""
    length = least | 1
    while True:
        rest = length
        for prime in (3, 5, 7):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return length
        length += 2


def delayed(samples: FloatArray, periods: float) -> FloatArray:
    """Delay samples (n,) by a number of periods, by the phase of their spectrum.

    Interpolation between neighbours would average their noise, which a fit would take for evidence. The ends are
    continued by point reflection, the line between them is delayed by itself.
    """
    if periods == 0.0 or not samples.size:
        return samples
    ends = min(_ENDS + math.ceil(abs(periods)), samples.size - 1)
    more = _odd_length(samples.size + 2 * ends) - samples.size - ends
    longer = np.pad(samples, (ends, more), mode="reflect", reflect_type="odd")
    slope = (longer[-1] - longer[0]) / (longer.size - 1)
    line = slope * np.arange(longer.size)
    turn = np.exp(-2j * np.pi * periods * np.fft.rfftfreq(longer.size))
    late = np.fft.irfft(np.fft.rfft(longer - line) * turn, longer.size) + line - slope * periods
    return np.asarray(late[ends : ends + samples.size], dtype=np.float64)


_MOTOR = 2  # its variant: a motor position that is late is nearly like another channel that is early


def _as_variant(values: Sequence[float], variant: int, other: int) -> Sequence[float]:
    return [-values[0]] if (variant == _MOTOR) != (other == _MOTOR) else values


MECHANISM = Mechanism(
    id="channel_time_skew",
    block=Block.SENSOR,
    element="time stamps of a channel",
    equation="y_recorded(t) = y(t - delay)",
    source="Laakso et al., IEEE Signal Processing Magazine 13 (1996) 30, fractional delay",
    parameters=(Parameter("delay_s", Dimension.TIME, -_MOST_S, _MOST_S, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.CHANNEL, _late_table, "table_position", observable=lambda table_encoder: table_encoder),
        Variant(Stage.ANSWER, _late_torque, "torque", starts=_torque_starts, proportional=False, moves_torque=True),
        Variant(Stage.CHANNEL, _late_motor, "motor_position", moves_torque=True),
    ),
    text=Text(
        "The channel {variant} is recorded {delay_s} late against the others.",
        Picture.DELAY,
        reversed="The channel {variant} is recorded {delay_s} early against the others.",
    ),
    # motor position and torque are the clock unless their relation says otherwise: the first variant is named
    search=SearchHints(
        lambda s: [(2e-4,)], lambda a: (2e-4,), shifts_time=True, as_variant=_as_variant, rank=lambda variant: variant
    ),
)
