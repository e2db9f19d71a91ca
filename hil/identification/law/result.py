"""Result of a fit of the control law to recordings, and the rules by which it is accepted."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hil.arrays import FloatArray
from hil.control.cascade import Gains
from hil.identification.inference import ALIKE, TIED, correlation_time
from hil.identification.law.replay import Parts, Settings
from hil.identification.terms import Term

# Share that a law may leave of the command (rms) and still be that of the recording: gains and structure leave tens of
# per cent if they are wrong, mechanisms on the controller's inputs a few.
REPLAYED = 0.05
SURE = 3.0  # standard errors from which a value differs from another: one in 400 normal errors is larger
_LEAST_ROWS = 0.05  # least delay in rows that is significant: positions between two rows are interpolated


@dataclass(frozen=True)
class LawErrors:
    """Standard errors, of gains relative but for the feed-forward, of delays in rows; 0 for values that were kept."""

    position_gain: float = 0.0
    feedforward: float = 0.0
    velocity_gain: float = 0.0
    integral_gain: float = 0.0
    setpoint_rows: float = 0.0
    feedback_rows: float = 0.0


@dataclass(frozen=True, eq=False)
class LawFit:
    """A control law on recordings; `runs` is what is recorded less what the law gives, over the evaluated rows."""

    settings: Settings
    terms: tuple[Term, ...]
    runs: tuple[Parts, ...]
    errors: LawErrors
    free: int  # number of parameters fitted
    left_of_command: float  # rms of the rest over that of the command that is to be explained
    left_of_speed: float  # the same of what a rest of the speed set-point makes of the command; 0 if it is not recorded

    @property
    def gains(self) -> Gains:
        """Gains of the settings."""
        return self.settings.gains

    @property
    def left(self) -> float:
        """The larger of what both loops leave."""
        return max(self.left_of_command, self.left_of_speed)

    @cached_property
    def parts(self) -> tuple[FloatArray, ...]:
        """Residuals of all runs and loops."""
        return tuple(part for run in self.runs for part in run if part.size)

    @cached_property
    def ratio(self) -> float:
        """Largest mean square over noise of all runs and loops."""
        return max(float(part @ part) / part.size for part in self.parts)

    @cached_property
    def cost(self) -> float:
        """Sum of squares over noise of all runs."""
        return sum(float(part @ part) for part in self.parts)

    @cached_property
    def independent_rows(self) -> float:
        """Number of rows over the correlation time of the residual."""
        return sum(part.size / correlation_time(part) for part in self.parts)

    def bic(self, rows: float) -> float:
        """Bayesian information criterion with so many independent `rows`, the noise estimated (Schwarz 1978)."""
        return float(rows * np.log(max(self.cost, 1e-12)) + self.free * np.log(rows))


def sure(delay_rows: float, error_rows: float) -> bool:
    """True if a delay is significant: above its error, and above that of interpolation."""
    return abs(delay_rows) > max(SURE * error_rows, _LEAST_ROWS)


def preferred(fits: Sequence[LawFit]) -> LawFit:
    """The fit of the best Bayesian information criterion."""
    rows = min(one.independent_rows for one in fits)
    return min(fits, key=lambda one: one.bic(rows))


def told_apart(better: LawFit, worse: LawFit) -> bool:
    """True if the criterion refutes `worse` beside `better`, and it leaves more than that, taken as the noise."""
    rows = min(better.independent_rows, worse.independent_rows)
    return worse.bic(rows) - better.bic(rows) >= TIED and worse.cost >= (1.0 + ALIKE) * better.cost
