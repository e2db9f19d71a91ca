"""Rates with intervals, and how far a confidence is from what it promises."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

NORMAL_95 = 1.959964  # 97.5 % quantile of the normal distribution
BINS = 10  # of confidence


@dataclass(frozen=True)
class Rate:
    """So many of so many, with its 95 % interval."""

    hits: int
    of: int

    @property
    def value(self) -> float | None:
        """The rate; None of none."""
        return self.hits / self.of if self.of else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval (1927): rates that would make this count no surprise at 5 %. [0, 1] of none."""
        if not self.of:
            return 0.0, 1.0
        share, weight = self.hits / self.of, NORMAL_95**2 / self.of
        middle = (share + 0.5 * weight) / (1.0 + weight)
        half = sqrt(weight * (share * (1.0 - share) + 0.25 * weight)) / (1.0 + weight)
        # rounding must not shut out a rate of 0 or 1
        return max(min(middle - half, share), 0.0), min(max(middle + half, share), 1.0)


@dataclass(frozen=True)
class ConfidenceBin:
    """Names of about the same confidence: how many, their mean confidence, and how many are right."""

    confidence: float
    right: Rate


def rate(outcomes: Iterable[bool]) -> Rate:
    """How many are true."""
    found = list(outcomes)
    return Rate(sum(found), len(found))


def quantile(values: Sequence[float], part: float) -> float | None:
    """A quantile by nearest rank, which may be infinite; None of none."""
    return float(np.quantile(values, part, method="inverted_cdf")) if values else None


def confidence_bins(confidences: Sequence[float], right: Sequence[bool]) -> list[ConfidenceBin]:
    """Names by confidence in ten bins of equal width; empty bins are left out."""
    at = np.minimum((np.asarray(confidences) * BINS).astype(int), BINS - 1)
    return [
        ConfidenceBin(float(np.mean(np.asarray(confidences)[at == index])), rate(np.asarray(right)[at == index]))
        for index in range(BINS)
        if np.any(at == index)
    ]


def expected_calibration_error(bins: Sequence[ConfidenceBin]) -> float | None:
    """Mean distance of confidence and accuracy, bins weighted by their counts (Naeini et al. 2015); None of none."""
    total = sum(found.right.of for found in bins)
    if not total:
        return None
    return sum(abs(found.confidence * found.right.of - found.right.hits) for found in bins) / total
