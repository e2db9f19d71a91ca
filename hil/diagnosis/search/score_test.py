"""Score tests: how much of what a hypothesis leaves over would each mechanism of the library explain?

    minimise over a, c:  | W (r + J a + D c) |^2

r: residuals of the hypothesis, J: their derivatives by its parameters, D: change of the residuals when a
mechanism is switched on at a start, W: weights against wild instants. Because a is free, only what
no parameter can explain counts (Rao's score test with nuisance parameters). Where another law acts instead of one that
the bench knows, and can be scaled, r and D are those without that one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.estimation.fit import POOL, Fit
from hil.diagnosis.estimation.model_comparison import whitened, whitening
from hil.diagnosis.estimation.terms import Term
from hil.diagnosis.search.initial_values import Start
from hil.identification.dataset import Measured
from hil.twin.library import BY_ID

_SOFT = 3.0  # residuals beyond so many typical ones lose weight
_WEAKER = (0.3, 0.1)  # of the strength that a straight line promises: half an order of magnitude apart


@dataclass(frozen=True)
class Lead:
    """A mechanism worth fitting: its start, scaled, and the share of the residual it would explain.

    `others` are the same at less strength or from elsewhere: what a small change promises, a large one need not keep.
    """

    term: Term
    share: float
    others: tuple[Term, ...] = ()


@dataclass(frozen=True, eq=False)
class _View:
    """Residuals behind weights and filters, with what the parameters can explain taken out: those that the base has
    derivatives by."""

    weights: FloatArray
    nuisance: FloatArray
    residual: FloatArray
    splits: tuple[int, ...]
    filters: list[FloatArray] | None

    def of(self, change: FloatArray) -> FloatArray:
        """A change of the residuals, seen the same way."""
        seen = change if self.filters is None else whitened(change, self.splits, self.filters)
        seen = self.weights * seen
        return np.asarray(seen - self.nuisance @ (self.nuisance.T @ seen), dtype=np.float64)


def _view(base: Fit, white: bool) -> _View:
    filters = whitening(base) if white else None
    seen = base.residuals if filters is None else whitened(base.residuals, base.splits, filters)
    slopes = base.jacobian
    if filters is not None and slopes.size:
        slopes = whitened(slopes, base.splits, filters)
    weights = np.concatenate([_weights(part) for part in np.split(seen, base.splits)])
    nuisance, _ = np.linalg.qr(weights[:, None] * slopes)
    residual = weights * seen
    return _View(weights, nuisance, residual - nuisance @ (nuisance.T @ residual), base.splits, filters)


def _weights(part: FloatArray) -> FloatArray:
    """Weights of the residuals of one channel of one run: less for those far beyond its typical one."""
    typical = max(float(np.median(np.abs(part))) / 0.6745, 0.1)
    return np.asarray(1.0 / np.sqrt(np.sqrt(1.0 + (part / (_SOFT * typical)) ** 2)), dtype=np.float64)


def screen(base: Fit, runs: Sequence[Measured], starts: Sequence[Start]) -> list[Lead]:
    """A lead for each start, best first.

    Each is scored twice: on the residuals as they are, where the largest cause shows, and whitened, where a
    faint one shows beside a large one. The better share counts.
    """
    views = [_view(base, False), _view(base, True)]

    def direction(start: Start, values: tuple[float, ...]) -> FloatArray:
        term = Term(start.effect, start.variant, values)
        model = replace(base.model, terms=(*base.model.terms, term))
        x = np.concatenate([base.x, model.initial()[base.x.size :]])
        return model.residuals(x, runs) - base.residuals

    def lead(start: Start) -> Lead:
        directions = [direction(start, values) for values in _directions(start)]
        gone = (
            direction(start, _scaled(start, np.zeros(2 * start.harmonics)))
            if start.instead
            else np.zeros(base.residuals.size)
        )
        return max((scored(start, directions, gone, view) for view in views), key=lambda found: found.share)

    def scored(start: Start, directions: list[FloatArray], gone: FloatArray, view: _View) -> Lead:
        energy = float(view.residual @ view.residual)
        without = view.residual + view.of(gone) if start.instead else view.residual
        span = np.stack([view.of(change - gone) for change in directions], axis=1)
        products, target = span.T @ span, -(span.T @ without)
        coefficients = np.asarray(np.linalg.pinv(products, hermitian=True) @ target, dtype=np.float64)
        left = without + span @ coefficients
        share = 1.0 - float(left @ left) / energy
        if start.strength < 0:
            # a start that cannot be scaled also counts as it stands
            whole = float(2.0 * target[0] - products[0, 0]) / energy
            return Lead(
                Term(start.effect, start.variant, start.values), max(share if coefficients[0] > 0.0 else 0.0, whole)
            )
        return Lead(
            Term(start.effect, start.variant, _scaled(start, coefficients)),
            share,
            tuple(Term(start.effect, start.variant, _scaled(start, factor * coefficients)) for factor in _WEAKER),
        )

    leads = list(POOL.map(lead, starts))
    return sorted(leads, key=lambda found: -found.share)


def _pairs(start: Start) -> list[tuple[int, int]]:
    """Places of strength and phase of each harmonic."""
    return [(start.strength + 2 * n, start.phase + 2 * n) for n in range(start.harmonics)]


def _directions(start: Start) -> list[tuple[float, ...]]:
    """Values that span what the start may become: its strength, or sine and cosine of each harmonic."""
    if start.phase < 0:
        values = list(start.values)
        values[start.strength] += start.known
        return [tuple(values)]
    found = []
    for strength, phase in _pairs(start):
        for angle in (0.0, np.pi / 2.0):
            values = list(start.values)
            for other, _ in _pairs(start):
                values[other] = 0.0
            values[strength], values[phase] = start.values[start.strength], angle
            found.append(tuple(values))
    return found


def _scaled(start: Start, coefficients: FloatArray) -> tuple[float, ...]:
    """The start at the strengths (and phases) that the score test asks for, within bounds."""
    values = list(start.values)
    unit = start.values[start.strength]
    for n, (strength, phase) in enumerate(_pairs(start)):
        parameter = BY_ID[start.effect].parameters[strength]
        factor = float(coefficients[0])
        if start.phase >= 0:
            sine, cosine = coefficients[2 * n : 2 * n + 2]
            factor, values[phase] = float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine))
        wanted, smallest = unit * factor, abs(unit) * 1e-3
        if parameter.low >= 0.0:
            wanted = max(wanted, smallest)
        elif abs(wanted) < smallest:
            wanted = smallest
        values[strength] = min(max(start.known + wanted, parameter.low), parameter.high)
    return tuple(values)
