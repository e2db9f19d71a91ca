"""Numbers drawn at random."""

from __future__ import annotations

from math import exp, log, pi

import numpy as np

Rng = np.random.Generator


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """A number whose logarithm is uniform between two limits."""
    return exp(rng.uniform(log(low), log(high)))


def any_phase(rng: Rng) -> float:
    """An angle [rad]."""
    return float(rng.uniform(-pi, pi))


def any_sign(rng: Rng) -> float:
    """1 or -1."""
    return float(rng.choice((-1.0, 1.0)))
