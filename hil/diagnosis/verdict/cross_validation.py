"""Cross-validation: evidence for each term on held-out recordings; terms that they refute are dropped.

    gain = sum over channels and runs of  n log(E_without / E_with),      E: whitened energy, see `inference`

Both hypotheses are fitted to the training recordings, so that the gain has no penalty for parameters. Repeated motion
is a second test: a term whose effect differs from lap to lap must reduce the measured differences between laps.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.diagnosis.search.forward_selection import TIED, claimed
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import against
from hil.identification.noise_floor import REPEATS, unrepeated
from hil.identification.parallel import in_parallel
from hil.identification.terms import Term


@dataclass(frozen=True, eq=False)
class Ablation:
    """A term and the fit without it.

    `train` and `held_out` are the residual energy without the term over that with it, `laps` the same ratio of the part
    that does not repeat from lap to lap. `gain` is the evidence for the term on the held-out recordings. They are None
    without held-out recordings or laps, and for an event, whose `train` is the ratio over all recordings.
    """

    term: Term
    without: Fit
    train: float
    held_out: float | None
    gain: float | None
    laps: float | None

    @property
    def harms(self) -> bool:
        """True if held-out recordings or laps refute the term; a motion without its effect does not."""
        return (self.gain is not None and self.gain < -TIED) or (self.laps is not None and self.laps < REPEATS)

    @property
    def shown(self) -> bool:
        """True if held-out recordings support the term."""
        return self.gain is not None and self.gain > TIED


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """The final fit after harmful terms were dropped, and the ablations of its terms and of the dropped ones."""

    final: Fit
    ablations: tuple[Ablation, ...]
    dropped: tuple[Ablation, ...]


def cross_validate(nominal: Fit, final: Fit, held_out: Dataset) -> CrossValidation:
    """Ablate every term; drop those that held-out recordings or laps refute, the most harmful first."""
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
    """Energy of the residuals block by block in units of noise^2, at least that of the noise."""
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
        train, more, gain = energy(other) / own, None, None
        if there and own_held_out and term.windows:  # an event is found in each recording: none is a test of another
            train = (energy(other) + energy(there)) / (own + energy(own_held_out))
        elif there and own_held_out:
            more, gain = energy(there) / energy(own_held_out), _gain(own_held_out, there)
        return Ablation(
            term,
            other,
            train,
            more,
            gain,
            unrepeated(other.hypothesis, other.data) / differs if differs > 0.0 else None,
        )

    return [ablation(term, other) for term, other in zip(final.terms, fits, strict=True)]


def _gain(found: Fit, without: Fit) -> float:
    """Evidence for the term on held-out recordings, negative where it harms.

    Both residuals are whitened by the filter of the fit with less cost: that of the other would hide the harm.
    """
    paid = (found.hypothesis.free - without.hypothesis.free) * float(np.log(found.rows))
    return against(found, without) + paid if found.cost <= without.cost else paid - against(without, found)
