"""Score tests: evidence that each mechanism of the library promises, by the energy that it would explain.

    minimise over a, c:  | W (r + J a + D c) |^2

r: residuals of the hypothesis, J: their derivatives by its parameters, D: change of the residuals when a
mechanism is switched on at a start, W: robust weights. The free a removes everything that the parameters of the
hypothesis can explain (Rao's score test with nuisance parameters). If a scalable mechanism replaces one of the bench, r
and D are those without the latter.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.linalg import qr

from hil.arrays import FloatArray
from hil.diagnosis.search.event_detection import detect
from hil.diagnosis.search.events import EVENTS, event_term, information_criterion
from hil.diagnosis.search.force_windows import torque_windows
from hil.diagnosis.search.harmonics import combined, is_scaled, pairs, spanning
from hil.diagnosis.search.initial_values import claimable, scene, starts
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import correlation_time, whitened, whitening
from hil.identification.parallel import POOL
from hil.identification.terms import Term, compatible, free_slot, repeats
from hil.identification.torque_left import lacking_torque
from hil.twin.library import BY_ID
from hil.twin.parameter import Role

_SOFT = 3.0  # residual in robust standard deviations above which the weight falls: 0.3 % of Gaussian rows are above
_WEAKER = (0.3, 0.1)  # of the strength from the linear score test: half an order of magnitude apart
# Factors by which a start with a frequency is moved: half of the grid of starts, and a decade for other parameters;
# halved in each round.
_FREQUENCY_STEP, _STEP, _ROUNDS = 1.2, 3.0, 4
_OTHERS = 6  # starts of one mechanism that are kept: limits the evaluations of a race


@dataclass(frozen=True)
class Candidate:
    """A mechanism to be fitted: its scaled start, and the evidence that a linear step promises.

    `others` are starts of the same mechanism at less strength or other values, since large changes act nonlinearly.
    `own` is the evidence at the values of the term, `score` that at the best strength, for n independent rows
    -n log(1 - share of the energy); `by_channel` is the share of each channel alone.
    """

    term: Term
    score: float
    others: tuple[Term, ...] = ()
    own: float = 0.0
    by_channel: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _View:
    """Weighted and filtered residuals, orthogonal to the derivatives by the parameters of the base."""

    weights: FloatArray
    nuisance: FloatArray
    residual: FloatArray
    channels: tuple[str, ...]  # of each part
    splits: tuple[int, ...]
    filters: list[FloatArray] | None
    independent: float  # rows

    def evidence(self, left: FloatArray) -> float:
        """Evidence for what leaves this residual (m,), negative where there is more than before."""
        return self.independent * float(np.log(float(self.residual @ self.residual) / max(float(left @ left), 1e-300)))

    def of(self, change: FloatArray) -> FloatArray:
        """Filter, weight and project a change (m,) of the residuals in the same way."""
        seen = change if self.filters is None else whitened(change, self.splits, self.filters)
        seen = self.weights * seen
        return np.asarray(seen - self.nuisance @ (self.nuisance.T @ seen), dtype=np.float64)

    def explained(self, left: FloatArray) -> dict[str, float]:
        """Share of the energy of each channel that is gone where `left` (m,) is left; negative where there is more."""
        before, after = dict.fromkeys(self.channels, 0.0), dict.fromkeys(self.channels, 0.0)
        parts = (np.split(values, self.splits) for values in (self.residual, left))
        for channel, a, b in zip(self.channels, *parts, strict=True):
            before[channel] += float(a @ a)
            after[channel] += float(b @ b)
        return {name: 1.0 - after[name] / energy if energy > 0.0 else 0.0 for name, energy in before.items()}


def _view(base: Fit, white: bool) -> _View:
    residuals, slopes, filters = base.residuals, base.jacobian, whitening(base) if white else None
    seen = residuals.vector if filters is None else whitened(residuals.vector, residuals.splits, filters)
    if filters is not None and slopes.size:
        slopes = whitened(slopes, residuals.splits, filters)
    weights = np.concatenate([_weights(part) for part in residuals.split(seen)])
    nuisance, _ = qr(weights[:, None] * slopes, mode="economic", overwrite_a=True, check_finite=False)
    residual = weights * seen
    left, channels = residual - nuisance @ (nuisance.T @ residual), tuple(channel for _, channel in residuals.parts)
    energies = [float(part @ part) for part in residuals.split(left)]
    rows = [part.size / (1.0 if white else correlation_time(part)) for part in residuals.split(residual)]
    independent = float(np.dot(energies, rows)) / max(sum(energies), 1e-300)  # mean of the channels, by their energy
    return _View(weights, nuisance, left, channels, residuals.splits, filters, independent)


def _weights(part: FloatArray) -> FloatArray:
    """Robust weights (n,) of the residuals of one channel of one run."""
    typical = max(float(np.median(np.abs(part))) / 0.6745, 0.1)
    return np.asarray(1.0 / np.sqrt(np.sqrt(1.0 + (part / (_SOFT * typical)) ** 2)), dtype=np.float64)


def screen_library(base: Fit) -> list[Candidate]:
    """Make one candidate of each mechanism that is compatible with the terms of the base, best first.

    Starts whose values, scaled to the residual, are not valid for their mechanism are left out.
    """
    hypothesis, terms = base.hypothesis, base.terms
    lacking = lacking_torque(hypothesis, base.data) if base.within_noise else ()
    blocks = hypothesis.residuals(base.data).channels
    known = scene(base.data.runs, base.bench, blocks, base.data.observer_s, lacking)
    every = (*starts(known, hypothesis.bench, base.data.runs), *_events(base))
    points = [start for start in every if offered(start, hypothesis, terms)]
    best: dict[str, list[Candidate]] = {}
    views = [_view(base, False), _view(base, True)]
    for candidate in screen(base, points, views):
        best.setdefault(candidate.term.effect, []).append(candidate)
    best = {effect: _nearest_first(same) if BY_ID[effect].search.shifts_time else same for effect, same in best.items()}
    # a tuned start replaces the grid of its mechanism
    tuned = {effect: _tuned(base, same[0], views) for effect, same in best.items()}
    best = {effect: same if tuned[effect] is same[0] else [tuned[effect]] for effect, same in best.items()}
    named = partial(claimable, bench=base.bench, runs=base.data.runs)

    def gathered(effect: str, same: Sequence[Candidate]) -> Candidate | None:
        slot, scaled = free_slot(effect, terms), BY_ID[effect].search.proportional
        same = [one for one in same if named(one.term) or not scaled]  # an invalid start hides no other
        every = [term for one in same[:1] for term in (one.term, *one.others)] + [one.term for one in same[1:_OTHERS]]
        begun = [replace(term, slot=slot) for term in every if scaled or named(term)]
        if not begun:
            return None
        return Candidate(begun[0], same[0].score, tuple(begun[1:]), by_channel=_most(one.by_channel for one in same))

    candidates = [gathered(effect, same) for effect, same in best.items()]
    return sorted((one for one in candidates if one is not None), key=lambda one: -one.score)


def _events(base: Fit) -> list[Term]:
    """The starts of all events that the disturbance torque shows, and of those that least squares tell, as terms."""
    if any(term.windows for term in base.terms):
        return []
    # events may have led the fitted parameters astray, those of the bench file may be wrong
    points, ratio = (base, base.estimator.evaluate(base.hypothesis.given)), base.bench.axis.ratio_m_rad
    shown = [(one, events) for one in points if (events := detect(one))]
    pairs = [(one, event_term(effect, events, ratio)) for one, events in shown for effect in EVENTS]
    terms = [term for _, term in sorted(pairs, key=lambda pair: information_criterion(*pair))[:1]]
    told = torque_windows(base, base.data)
    terms += [event_term(effect, told, ratio) for effect in EVENTS if told]
    return [term for term in terms if offered(term, base.hypothesis, base.terms)]


def offered(new: Term, hypothesis: Hypothesis, terms: Sequence[Term]) -> bool:
    """True if a mechanism is compatible with the terms, and is none of the bench's, whose values are fitted already.

    It may replace another variant of a mechanism of the bench.
    """
    known = [entry.active() for entry in hypothesis.kept]
    fitted = not BY_ID[new.effect].transient
    if fitted and any(repeats(new, other) and new.variant == other.variant for other in known):
        return False
    return compatible((*terms, new, *(other for other in known if not repeats(new, other))))


def _nearest_first(same: Sequence[Candidate]) -> list[Candidate]:
    """Order the starts of one mechanism by what they explain at their own values, each with the largest score.

    What a start far from the truth explains at another strength it does not reach: a local minimum lies between.
    """
    score = max(one.score for one in same)
    return sorted((replace(one, score=score) for one in same), key=lambda one: -one.own)


def _tuned(base: Fit, best: Candidate, views: Sequence[_View]) -> Candidate:
    """Move a start with a frequency to a higher score: a resonance is narrower than the grid of starts."""
    mechanism, variant = BY_ID[best.term.effect], best.term.variant
    if mechanism.search.proportional or not mechanism.indices(Role.FREQUENCY):
        return best
    for number in range(_ROUNDS):
        points = []
        for index, parameter in enumerate(mechanism.parameters):
            step = (_FREQUENCY_STEP if parameter.role is Role.FREQUENCY else _STEP) ** (0.5**number)
            for factor in (step, 1.0 / step):
                values = list(best.term.values)
                values[index] = min(max(factor * values[index], parameter.low), parameter.high)
                points.append(Term(mechanism.id, variant, tuple(values)))
        best = max(best, screen(base, points, views)[0], key=lambda one: one.score)
    return best


def screen(base: Fit, points: Sequence[Term], views: Sequence[_View] = ()) -> list[Candidate]:
    """Score each start, best first; `views` of the base are made if not given.

    The score is the larger of two, as in `inference.bic_gain`: on plain residuals with their independent rows,
    sensitive to the largest cause, and on whitened residuals, sensitive to a small cause beside a large one.
    """
    views, search = views or [_view(base, False), _view(base, True)], replace(base.estimator, fast=True)
    unchanged = search.residuals(base.hypothesis).vector

    def direction(term: Term) -> FloatArray:
        return search.residuals(base.hypothesis.with_term(term)).vector - unchanged

    def candidate(start: Term) -> Candidate:
        directions = [direction(term) for term in spanning(start)]
        instead = is_scaled(start) and any(repeats(start, entry.active()) for entry in base.hypothesis.kept)
        gone = np.zeros(base.rows)
        if instead:
            gone = direction(_within(combined(start, np.zeros(len(directions))), start))
        found = [scored(start, directions, gone, view) for view in views]
        best = max(found, key=lambda one: max(one.by_channel.values()))  # of what it explains most it tells its size
        score, own = (max(values) for values in zip(*((one.score, one.own) for one in found), strict=True))
        return replace(best, score=score, own=own, by_channel=_most(one.by_channel for one in found))

    def scored(start: Term, directions: list[FloatArray], gone: FloatArray, view: _View) -> Candidate:
        without = view.residual + view.of(gone) if gone.any() else view.residual
        span = np.stack([view.of(change - gone) for change in directions], axis=1)
        products, target = span.T @ span, -(span.T @ without)
        coefficients = np.asarray(np.linalg.pinv(products, hermitian=True) @ target, dtype=np.float64)
        left = without + span @ coefficients
        score, by_channel = view.evidence(left), view.explained(left)
        if not is_scaled(start):  # also scored at its own strength
            there = without + span[:, 0]
            own, at_own = view.evidence(there), view.explained(there)
            if coefficients[0] <= 0.0:
                score, by_channel = 0.0, at_own
            return Candidate(start, max(score, own), own=own, by_channel=_most([by_channel, at_own]))
        scaled, *weaker = (_within(combined(start, factor * coefficients), start) for factor in (1.0, *_WEAKER))
        return Candidate(scaled, score, tuple(weaker), score, by_channel)

    return sorted(POOL.map(candidate, points), key=lambda one: -one.score)


def _most(shares: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """The largest share of each channel."""
    found = dict[str, float]()
    for one in shares:
        for name, share in one.items():
            found[name] = max(found.get(name, 0.0), share)
    return found


def _within(term: Term, start: Term) -> Term:
    """The term with strengths within bounds, and not below a thousandth of that of its start."""
    values, smallest = list(term.values), 1e-3 * abs(start.values[pairs(start)[0][0]])
    for strength, *_ in pairs(term):
        parameter, wanted = BY_ID[term.effect].parameters[strength], values[strength]
        if parameter.low >= 0.0:
            wanted = max(wanted, smallest)
        elif abs(wanted) < smallest:
            wanted = smallest
        values[strength] = min(max(wanted, parameter.low), parameter.high)
    return replace(term, values=tuple(values))
