"""A measured figure beside its target."""

import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np


class ReferenceKind(StrEnum):
    """PEER: the same task done by another tool. LIMIT: a necessary part of the task alone, a lower bound."""

    PEER = "peer"
    LIMIT = "limit"


class Reference(NamedTuple):
    """Reference value of a figure, measured in the same run and unit."""

    name: str
    kind: ReferenceKind
    value: float


@dataclass(frozen=True)
class Figure:
    """A figure with its target, an upper bound if `at_most`, else a lower one; None for a mere comparison.

    `at_most` also says that a smaller value is better. label: short name in tables. detail: how it was measured.
    """

    name: str
    label: str
    value: float
    unit: str
    target: float | None = None
    at_most: bool = False
    detail: str = ""
    beside: tuple[Reference, ...] = ()

    @property
    def met(self) -> bool | None:
        """True if the target is met; None without one."""
        if self.target is None:
            return None
        return self.value <= self.target if self.at_most else self.value >= self.target

    def times_as_fast(self, other: float) -> float:
        """Return the speed relative to `other`, a value of the same unit: 2 is twice as fast."""
        return other / self.value if self.at_most else self.value / other


def percentile(values: Sequence[float], part: float) -> float:
    """Quantile `part` by nearest rank."""
    return float(np.quantile(values, part, method="inverted_cdf"))


def best_of(action: Callable[[], object], repeats: int) -> float:
    """Shortest duration [s] of several calls, least disturbed by other processes."""
    return min(timeit.repeat(action, number=1, repeat=repeats))
