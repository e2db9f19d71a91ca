"""A measured figure beside its target."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter


@dataclass(frozen=True)
class Figure:
    """One figure. `at_most`: the target is an upper bound (times), else a lower one (speed-ups). `detail`: how it was
    measured. Without a target it is there for comparison."""

    name: str
    value: float
    unit: str
    target: float | None = None
    at_most: bool = False
    detail: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without one."""
        if self.target is None:
            return None
        return self.value <= self.target if self.at_most else self.value >= self.target


def percentile(values: Sequence[float], part: float) -> float:
    """Nearest rank."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(part * len(ordered)) - 1)]


def best_of(action: Callable[[], object], repeats: int) -> float:
    """Shortest duration [s] of several calls: what the machine can do undisturbed."""
    durations = []
    for _ in range(repeats):
        start = perf_counter()
        action()
        durations.append(perf_counter() - start)
    return min(durations)
