"""Cross-validation on held-out recordings: the evidence for each term there, and which terms are dropped.

    gain = sum over channels and runs of  n log(E_without / E_with),      E: whitened energy, see `inference`

Both hypotheses were fitted to the training recordings, so that on the held-out ones no parameter costs evidence.
Repeated motion is a test too: a term whose effect differs from lap to lap must reduce the measured differences.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.diagnosis.search.forward_selection import TIED, claimed
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit, in_parallel
from hil.identification.inference import against
from hil.identification.noise_floor import REPEATS, unrepeated
from hil.identification.terms import Term


@dataclass(frozen=True, eq=False)
class Ablation:
    """A term, the fit without it, and by which factor the energy above the floor grows without it.

    `gain` is the evidence for the term on the held-out recordings, None without any. `laps` is the factor by which
    the part that does not repeat from lap to lap grows without it, None without laps.
    """

    term: Term
    without: Fit
    train: float
    held_out: float | None
    gain: float | None
    laps: float | None

    @property
    def harms(self) -> bool:
        """Whether held-out recordings or laps speak against the term. A motion that does not show it says nothing."""
        return (self.gain is not None and self.gain < -TIED) or (self.laps is not None and self.laps < REPEATS)

    @property
    def shown(self) -> bool:
        """Whether held-out recordings speak for the term."""
        return self.gain is not None and self.gain > TIED


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """The final fit after harmful terms were dropped, and the ablations of its terms and of the dropped ones."""

    final: Fit
    ablations: tuple[Ablation, ...]
    dropped: tuple[Ablation, ...]


def cross_validate(nominal: Fit, final: Fit, held_out: Dataset) -> CrossValidation:
    """Ablate every term; drop, the most harmful first, those that held-out recordings speak against."""
    dropped: list[Ablation] = []
    while True:
        ablations = _ablate(nominal, final, held_out)
        harmful = [ablation for ablation in ablations if ablation.harms]
        if not harmful:
            return CrossValidation(final, tuple(ablations), tuple(dropped))
        worst = min(harmful, key=lambda ablation: ablation.gain or 0.0)
        dropped.append(worst)
        final = worst.without
        if final.terms:
            final = claimed(final.refit(30))


def energy(found: Fit) -> float:
    """Energy of the residuals block by block, n m summed; not below that of the noise."""
    return found.energy(lambda ratio: max(ratio, 1.0))


def explained_share(before: Fit, after: Fit) -> float:
    """Share of the energy above the floor of `before` that `after` removes, in [0, 1]."""
    left, was = after.excess, before.excess
    return min(max(1.0 - left / was, 0.0), 1.0) if was > 0.0 else float(left == 0.0)


def _ablate(nominal: Fit, final: Fit, held_out: Dataset) -> list[Ablation]:
    rebased = final.hypothesis.rebased

    def without(index: int) -> Fit:
        rest = rebased.without(index)
        return final.estimator.fit(rest, evaluations=12) if rest.terms else nominal

    fits = in_parallel([partial(without, index) for index in range(len(final.terms))])
    own, own_held_out = energy(final), final.on(held_out) if held_out.runs else None
    differs = unrepeated(final.hypothesis, final.data)

    def ablation(term: Term, other: Fit) -> Ablation:
        there = other.on(held_out) if held_out.runs else None
        return Ablation(
            term,
            other,
            energy(other) / own,
            energy(there) / energy(own_held_out) if there and own_held_out else None,
            _gain(own_held_out, there) if there and own_held_out else None,
            unrepeated(other.hypothesis, other.data) / differs if differs > 0.0 else None,
        )

    return [ablation(term, other) for term, other in zip(final.terms, fits, strict=True)]


def _gain(found: Fit, without: Fit) -> float:
    """Evidence for the term on held-out recordings, negative where it harms.

    Both are judged by the noise of the one with less cost: the whitening filter of the other would hide the harm.
    """
    paid = (found.hypothesis.x.size - without.hypothesis.x.size) * float(np.log(found.rows))
    return against(found, without) + paid if found.cost <= without.cost else paid - against(without, found)
