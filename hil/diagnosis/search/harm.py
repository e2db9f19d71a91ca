"""Channels that a fit reproduces worse than without its last term."""

from hil.identification.estimator import Fit
from hil.identification.noise_floor import FLOOR

# Growth of the mean square of a channel, 10 % in rms, from which a term harms it: less is a trade between channels
# within the model discrepancy.
WORSE = 1.1**2
# Share of the energy that a term explains up to which it may worsen a channel and still stand: a real effect leaves the
# others a little wrong as long as something else is missing, one that only trades between channels loses as it gains.
PAID = 0.1


def harmed(found: Fit, without: Fit, owner: Fit) -> set[str]:
    """Channels above their noise in a training recording that are worse with a term than without it or by the bench
    file: there the fit pays with this channel for another.
    """
    return {
        channel
        for ratios, *others in zip(found.noise_ratios, without.noise_ratios, owner.noise_ratios, strict=True)
        for channel, ratio in ratios.items()
        if ratio > max(FLOOR, WORSE * min(other[channel] for other in others))
    }


def refuting(found: Fit, without: Fit, owner: Fit) -> set[str]:
    """Channels by which a term is refuted: harmed, and worse than by the bench file, or by more than `PAID`."""
    gains = dict[str, float]()
    for run, ratios, before in zip(found.data.runs, found.noise_ratios, without.noise_ratios, strict=True):
        for channel, ratio in ratios.items():
            gains[channel] = gains.get(channel, 0.0) + run.motor[run.evaluated].size * (before[channel] - ratio)
    most = PAID * sum(max(gain, 0.0) for gain in gains.values())
    return {
        channel
        for channel in harmed(found, without, owner)
        if -gains[channel] > most or channel in _below(found, owner)
    }


def _below(found: Fit, owner: Fit) -> set[str]:
    """Channels that are reproduced worse than by the bench file."""
    return harmed(found, owner, owner)
