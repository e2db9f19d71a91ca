"""Change points of a quantity over months: steps and slopes, by optimal partitioning with a bounded rate of false ones.

    min over partitions   sum of segments  [ chi^2 of a level, or of a level and a slope + threshold ]  + thresholds

Each segment has a level of its own, and a slope if that pays one more threshold (Jackson et al. 2005). chi^2 has the
variance s_i^2 + b^2 of a recording, s_i its standard error and b the scatter between recordings, times what scatter
that is correlated from one recording to the next adds in a mean, (1 + r) / (1 - r). All is estimated from differences
of recordings one and two apart, which steps and slopes hardly change.

The threshold. A recording a day is a look a day at n places, each for a step and a slope, of Q quantities. With

    p = 1 / (365 * 2 n Q)       of each look, place and quantity

the sum over all of them is one false change a year at most (Bonferroni): the threshold is the square of the quantile of
Student's t at p, with half as many degrees of freedom as recordings for the estimated variance.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import stdtrit

from hil.arrays import FloatArray

LOOKS = 365.0  # recordings in which one false change of an axis is expected at most
FEWEST = 12  # recordings, below which the scatter between them is not known
SHORTEST = 4  # recordings of a segment: fewer may be outliers
PLACE = 7.35  # chi^2 within which a place is in the 95 % interval: -2 log(1 - sqrt 0.95), Siegmund 1988
_CLIPPED = 3.0  # standard deviations from the median of its neighbours, beyond which a value counts as so far
_NEIGHBOURS = 7
_MAD = 1.4826  # standard deviation over median absolute deviation of normal values
_WINSORIZED, _KEPT = 2.5, 0.964  # standard deviations, and the variance of normal values that are clipped there
_MOST_CORRELATED = 0.9


@dataclass(frozen=True)
class Segment:
    """A stretch of recordings `first` to `last` (exclusive): level at its begin and end, slope a day, their errors."""

    first: int
    last: int
    begin: float
    end: float
    level_error: float
    slope: float = 0.0
    slope_error: float = 0.0


@dataclass(frozen=True)
class ChangePoint:
    """A change between two recordings: day, its 95 % interval, the step and the change of the slope with errors."""

    day: float
    earliest: float
    latest: float
    step: float
    step_error: float
    slope: float
    slope_error: float

    @property
    def kind(self) -> str:
        """`step` where the level differs by three standard errors, else `slope`."""
        return "step" if abs(self.step) > 3.0 * self.step_error else "slope"


@dataclass(frozen=True)
class History:
    """Segments of a quantity, the changes between them, and the scatter of a recording about them."""

    segments: tuple[AgeSegment, ...]
    changes: tuple[ChangePoint, ...]
    scatter: float
