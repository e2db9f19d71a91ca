"""How a motion follows its set-points: its lateness, by least squares of the recorded channels alone.

    s = r x + t v + d sign(v) + c        s set-point, v its speed, x measured position, t lateness, d lost motion

A position loop without feed-forward is late by 1 / gain, one with it by the share that the feed-forward lacks, over the
gain; set-points and readings that are late count alike.
"""

from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.identification.least_squares import Estimate, least_squares
from hil.quantities import quantity

_MOST = 0.5  # of the rms that is left without the lateness: with more the error is another one


class Following(NamedTuple):
    """Lateness [s]; rms and largest following error, and its rms without the lateness, in units of the set-point."""

    late_s: Estimate
    rms: float
    largest: float
    left: float

    def in_words(self, unit: str) -> str:
        """The lateness as a sentence."""
        way, why = "late", "too little velocity feed-forward, or late set-points"
        if self.late_s.value < 0.0:
            way, why = "early", "too much velocity feed-forward, or late readings"
        return (
            f"The motion follows its set-points {quantity(abs(self.late_s.value), 's')} {way} ({why}): the following "
            f"error is {quantity(self.rms, unit)} rms and {quantity(self.largest, unit)} at most, "
            f"{quantity(self.left, unit)} rms without the lateness."
        )


def following(command: FloatArray, position: FloatArray, period_s: float) -> Following | None:
    """Lateness of positions (n,) behind set-points (n,), at any ratio; None where it is not most of the error."""
    speed = np.gradient(command, period_s)
    top = float(np.max(np.abs(speed), initial=0.0))
    if not top > 0.0 or not np.ptp(position) > 0.0:
        return None
    sense = np.where(np.abs(speed) > 1e-3 * top, np.sign(speed), 0.0)
    centred = position - float(np.mean(position))
    columns = {"position": centred, "speed": speed, "sense": sense, "zero": np.ones(position.size)}
    fit = least_squares(columns, command)
    late_s, ratio = fit["speed"], fit["position"].value
    error = command - ratio * position
    error = error - float(np.median(error))
    rms, left = (float(np.sqrt(np.mean(one**2))) for one in (error, fit.residual))
    if not late_s.significant or left > _MOST * rms:
        return None
    return Following(late_s, rms, float(np.max(np.abs(error))), left)
