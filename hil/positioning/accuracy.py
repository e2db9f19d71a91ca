"""Accuracy and repeatability of positioning by ISO 230-2:2014: `positioning_accuracy`.

Targets i = 1..m, cycles j = 1..n; P_ij is the place where the axis stands, P_i the target; up: approached forward.

    deviation                          x_ij   = P_ij - P_i
    mean of one direction              x_i^   = 1/n sum_j x_ij^                           and x_iv
    mean of both                       x_i    = (x_i^ + x_iv) / 2
    reversal                           B_i    = x_i^ - x_iv,   B = max |B_i|,   mean B = 1/m sum_i B_i
    estimator of the standard uncertainty   s_i^ = sqrt(1/(n-1) sum_j (x_ij^ - x_i^)^2)   and s_iv
    repeatability                      R_i^   = 4 s_i^,        R^ = max R_i^              and R_iv, Rv
                                       R_i    = max(2 s_i^ + 2 s_iv + |B_i|, R_i^, R_iv),   R = max R_i
    systematic deviation               E^     = max x_i^ - min x_i^,   E = max(x_i^, x_iv) - min(x_i^, x_iv)
    mean bidirectional deviation       M      = max x_i - min x_i
    accuracy                           A^     = max(x_i^ + 2 s_i^) - min(x_i^ - 2 s_i^), A over both directions
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import FloatArray
from hil.positioning.approaches import Approaches, from_readings, from_recording
from hil.quantities import quantity
from hil.recording.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# name of a figure -> symbol of the standard and meaning, in the order of its tables
FIGURES: Mapping[str, tuple[str, str]] = {
    "accuracy_m": ("A", "accuracy, bidirectional"),
    "accuracy_forward_m": ("A↑", "accuracy, forward"),
    "accuracy_backward_m": ("A↓", "accuracy, backward"),
    "systematic_m": ("E", "systematic deviation, bidirectional"),
    "systematic_forward_m": ("E↑", "systematic deviation, forward"),
    "systematic_backward_m": ("E↓", "systematic deviation, backward"),
    "mean_range_m": ("M", "mean bidirectional deviation, range"),
    "repeatability_m": ("R", "repeatability, bidirectional"),
    "repeatability_forward_m": ("R↑", "repeatability, forward"),
    "repeatability_backward_m": ("R↓", "repeatability, backward"),
    "reversal_m": ("B", "reversal, largest"),
    "mean_reversal_m": ("B̄", "reversal, mean"),
}


@dataclass(frozen=True, eq=False)
class PositioningAccuracy:
    """Figures of ISO 230-2 of an axis [m; rad where the load turns].

    `deviations`: targets (m,) and deviations forward and backward (m, n). `mean_m`, `estimator_m` (2, m): forward,
    backward; `reversal_at_m`, `repeatability_at_m` (m,). `figures` maps accuracy_m (A), systematic_m (E), mean_range_m
    (M), repeatability_m (R), those with _forward_m and _backward_m, reversal_m (B) and mean_reversal_m to their values.
    Measurement uncertainty (ISO/TR 230-9) is not in them. Printing it gives the figures; `plot` draws the means with
    their bands of 2 s.
    """

    deviations: Approaches

    @property
    def name(self) -> str:
        """Name of the run."""
        return self.deviations.name

    @property
    def unit(self) -> str:
        """SI unit of all values: m, or rad."""
        return self.deviations.unit

    @property
    def target_m(self) -> FloatArray:
        """Targets (m,)."""
        return self.deviations.target_m

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not as the standard asks."""
        return self.deviations.notes

    @cached_property
    def _both(self) -> FloatArray:
        return np.stack([self.deviations.forward_m, self.deviations.backward_m])

    @cached_property
    def mean_m(self) -> FloatArray:
        """Mean deviations (2, m): forward, backward."""
        return np.asarray(self._both.mean(axis=2))

    @cached_property
    def estimator_m(self) -> FloatArray:
        """Estimators s (2, m) of the standard uncertainty: forward, backward."""
        return np.asarray(self._both.std(axis=2, ddof=1))

    @cached_property
    def reversal_at_m(self) -> FloatArray:
        """Reversal B_i (m,) at each target."""
        return np.asarray(self.mean_m[0] - self.mean_m[1])

    @cached_property
    def repeatability_at_m(self) -> FloatArray:
        """Bidirectional repeatability R_i (m,) at each target."""
        both = 2.0 * self.estimator_m.sum(axis=0) + np.abs(self.reversal_at_m)
        return np.asarray(np.maximum(both, 4.0 * self.estimator_m.max(axis=0)))

    @cached_property
    def figures(self) -> Mapping[str, float]:
        """The figures of the axis by their names, in the order of `FIGURES`."""
        mean, band = self.mean_m, 2.0 * self.estimator_m
        upper, lower, repeat = mean + band, mean - band, 4.0 * self.estimator_m.max(axis=1)
        values = (
            upper.max() - lower.min(),
            *(upper.max(axis=1) - lower.min(axis=1)),
            np.ptp(mean),
            *np.ptp(mean, axis=1),
            np.ptp(mean.mean(axis=0)),
            self.repeatability_at_m.max(),
            *repeat,
            np.abs(self.reversal_at_m).max(),
            self.reversal_at_m.mean(),
        )
        return {name: float(value) for name, value in zip(FIGURES, values, strict=True)}

    @property
    def verdict(self) -> str:
        """Accuracy, repeatability and reversal in a sentence."""
        told = {name: quantity(value, self.unit) for name, value in self.figures.items()}
        return (
            f"Accuracy A {told['accuracy_m']}, repeatability R {told['repeatability_m']}, reversal B "
            f"{told['reversal_m']}, systematic deviation E {told['systematic_m']} over {self.target_m.size} targets "
            f"and {self.deviations.forward_m.shape[1]} cycles."
        )

    def __str__(self) -> str:
        lines = [
            f"  {FIGURES[name][0]:3} {FIGURES[name][1]:38} {quantity(value, self.unit):>12}"
            for name, value in self.figures.items()
        ]
        return "\n".join([f"Positioning of {self.name} (ISO 230-2): {self.verdict}", *lines])

    __repr__ = __str__

    def plot(self) -> "Figure":
        """Draw mean deviations with bands of 2 s over the position, forward and backward."""
        from hil.positioning.accuracy_picture import deviations_over_position

        return deviations_over_position([self])


def positioning_accuracy(run: Recording | str | Path) -> PositioningAccuracy:
    """Compute the figures of ISO 230-2 from a recording with standstill at targets, or from a CSV of laser readings.

    run: a recording of a motion such as profiles/positioning_iso_230_2.yaml, judged by its linear encoder; or the path
    of a CSV with the columns target_mm and reading_mm (or deviation_um; any unit), a row per standstill in their order.

    Returns the figures in m (rad). Raises InputError without linear encoder, set-points or targets approached from both
    sides at least twice; for a CSV without these columns. Source: ISO 230-2:2014.
    """
    if isinstance(run, Recording):
        return PositioningAccuracy(from_recording(run))
    return PositioningAccuracy(from_readings(Path(run)))
