"""A measured figure beside its target."""

import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Figure:
    """One figure with its target: an upper bound if `at_most`, else a lower one, None for a mere comparison."""

    name: str
    value: float
    unit: str
    target: float | None = None
    at_most: bool = False
    detail: str = ""

    @property
    def met(self) -> bool | None:
        """True if the target is met; None without one."""
        if self.target is None:
            return None
        return self.value <= self.target if self.at_most else self.value >= self.target


def percentile(values: Sequence[float], part: float) -> float:
    """Quantile `part` by nearest rank."""
    return float(np.quantile(values, part, method="inverted_cdf"))


def best_of(action: Callable[[], object], repeats: int) -> float:
    """Shortest duration [s] of several calls, least disturbed by other processes."""
    return min(timeit.repeat(action, number=1, repeat=repeats))
