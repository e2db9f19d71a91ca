"""Proof on held-out recordings: what each term is worth there, and which are dropped.

    gain = sum over channels and runs of  n log(E_without / E_with),      E: whitened energy, see `evidence`

Both hypotheses were fitted to the training recordings, so that on the held-out ones no parameter has to be paid for.
Where the motion repeats, it proves too: what a term says of one lap and not of the next must be seen to come and go.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.estimation.fit import Fit, evaluate, fit, in_parallel
from hil.diagnosis.estimation.model_comparison import against
from hil.diagnosis.estimation.noise_floor import REPEATS, all_laps, unrepeated
from hil.diagnosis.estimation.noise_ratios import noise_ratios
from hil.diagnosis.estimation.terms import Term
from hil.diagnosis.search.forward_selection import TIED, claimed
from hil.identification.dataset import Measured


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
class Proof:
    """What is left after useless terms were dropped."""

    final: Fit
    ablations: tuple[Ablation, ...]
    dropped: tuple[Ablation, ...]


def prove(nominal: Fit, final: Fit, train: Sequence[Measured], held_out: Sequence[Measured]) -> Proof:
    """Ablate every term; drop, the most harmful first, those that held-out recordings speak against."""
    dropped: list[Ablation] = []
    while True:
        ablations = _ablate(nominal, final, train, held_out)
        harmful = [ablation for ablation in ablations if ablation.harms]
        if not harmful:
            return Proof(final, tuple(ablations), tuple(dropped))
        worst = min(harmful, key=lambda ablation: ablation.gain or 0.0)
        dropped.append(worst)
        final = worst.without
        if final.model.terms:
            final = claimed(fit(final.model, train, final.x), train)


def energy(found: Fit, runs: Sequence[Measured]) -> float:
    """Energy of the residuals block by block, n m summed; what is below the noise floor counts as at the floor."""
    return _sum(found, runs, lambda ratio: max(ratio, 1.0))


def excess(found: Fit, runs: Sequence[Measured]) -> float:
    """Energy above the noise floor."""
    return _sum(found, runs, lambda ratio: max(ratio - 1.0, 0.0))


def explained_share(before: Fit, after: Fit, runs: Sequence[Measured]) -> float:
    """Share of the energy above the floor that `after` takes away from `before`, in [0, 1]."""
    left, was = excess(after, runs), excess(before, runs)
    return min(max(1.0 - left / was, 0.0), 1.0) if was > 0.0 else float(left == 0.0)


def _sum(found: Fit, runs: Sequence[Measured], of: Callable[[float], float]) -> float:
    return float(
        sum(run.motor[run.judged].size * of(ratio) for run in runs for ratio in noise_ratios(found, run).values())
    )


def _ablate(nominal: Fit, final: Fit, train: Sequence[Measured], held_out: Sequence[Measured]) -> list[Ablation]:
    terms = final.model.resolved(final.x)[1]

    def without(index: int) -> Fit:
        rest = replace(final.model, terms=terms[:index] + terms[index + 1 :])
        if not rest.terms:
            return nominal
        x = np.concatenate([final.x[: rest.nominal_count], rest.initial()[rest.nominal_count :]])
        return fit(rest, train, x, evaluations=12)

    fits = in_parallel([lambda index=index: without(index) for index in range(len(terms))])  # type: ignore[misc]
    own_train, own_held_out = energy(final, train), energy(final, held_out)
    here = evaluate(final.model, held_out, final.x) if held_out else None
    repeated = all_laps(train)
    differs = unrepeated(final, repeated)
    return [
        Ablation(
            term,
            other,
            energy(other, train) / own_train,
            energy(other, held_out) / own_held_out if held_out else None,
            _gain(here, evaluate(other.model, held_out, other.x)) if here is not None else None,
            unrepeated(other, repeated) / differs if differs > 0.0 else None,
        )
        for term, other in zip(terms, fits, strict=True)
    ]


def _gain(found: Fit, without: Fit) -> float:
    """Evidence for the term. What leaves less is the better hypothesis, by whose noise both are judged: the harm that a
    term does would not be seen behind the filter of what it leaves."""
    paid = (found.x.size - without.x.size) * float(np.log(found.residuals.size))
    return against(found, without) + paid if found.cost <= without.cost else paid - against(without, found)
