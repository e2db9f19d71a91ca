"""Cross-validation: evidence for each term on held-out recordings; terms that they refute are dropped.

    gain = sum over channels and runs of  n log(E_without / E_with),      E: whitened energy, see `inference`

Both hypotheses are fitted to the training recordings, so that the gain has no penalty for parameters. Repeated motion
is a second test: a term whose effect differs from lap to lap must reduce the measured differences between laps. A term
also falls if its strength is within its standard error, if it worsens a channel of a training recording (`harm`), or
if it changes only what the noise of the sensors does, see `noise_free`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hil.diagnosis.acceptance import HELD_OUT, NEEDED
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Ledger, accepted, examine, refusal
from hil.diagnosis.search.addition import Addition, Harm, harm, torque_of
from hil.diagnosis.search.force_windows import strength_told
from hil.diagnosis.search.forward_selection import claimed
from hil.diagnosis.search.initial_values import other_variants
from hil.diagnosis.search.rivals import ENDED, RivalFit, more_torque
from hil.diagnosis.search.shape import log_chance_below_noise
from hil.diagnosis.verdict.noise_free import energy_without_noise
from hil.diagnosis.verdict.strength import strength_over_error
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import bic_margin
from hil.identification.noise_floor import unrepeated
from hil.identification.parallel import in_parallel
from hil.identification.terms import Key, Term, compatible, free_slot

Rivals = Mapping[Key, Sequence[RivalFit]]

_PREDICTS_LESS = "with it the torque of held-out motion is predicted worse"
_LEAST = 1e-12  # of the energy of the noise: a channel that the twin was given is left without a residual


@dataclass(frozen=True, eq=False)
class Ablation:
    """A term and the fit without it.

    `channel` is the one in which it explains most: a large mismatch of another says nothing of it. `train` and
    `held_out` are its residual energy without the term over that with it, `laps` the same ratio of the part
    that does not repeat from lap to lap. `gain` is the evidence for the term on the held-out recordings. They are None
    without held-out recordings or laps, and for an event, whose `train` is the ratio over all recordings. `acts`: the
    term changes the held-out residuals as it does those in training. `clear`: its strength is above its standard error.
    `log_chance`: logarithm of the chance of its shape below the noise; None above it.
    `quiet`: it hardly acts on motion without noise. `torque`: that which held-out motion needs beyond that
    of the twin, over its deviation (rms), with the term and without; None where it says nothing. `by_torque`: energy
    of the torque missed without the term over that with it, below the noise; 1 where it is not told. `harm`: each
    channel with it and without it.
    """

    term: Term
    without: Fit
    channel: str
    train: float
    held_out: float | None
    gain: float | None
    laps: float | None
    acts: bool = False
    clear: bool = True
    log_chance: float | None = None
    quiet: bool = False
    torque: tuple[float, float] | None = None
    by_torque: float = 1.0
    harm: Mapping[str, Harm] = field(default_factory=dict)

    @property
    def ledger(self) -> Ledger:
        """Answers of the rules on held-out recordings."""
        return examine(HELD_OUT, self, CRITERIA)

    @property
    def refuted(self) -> str:
        """Why the term is not named; empty if it stands."""
        return refusal(self.ledger)

    @property
    def against_torque(self) -> bool:
        """True if the torque refutes the term: another variant may leave it as it is."""
        return any(answer.rule == "torque" and not answer.accepted for answer in self.ledger)

    @property
    def shown(self) -> bool:
        """True if held-out recordings support the term."""
        return self.gain is not None and self.gain > CRITERIA.tied


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """The final fit after harmful terms were dropped, and the ablations of its terms and of the dropped ones.

    `rivals` are those of each term, of one that took the place of a dropped one too.
    """

    final: Fit
    ablations: tuple[Ablation, ...]
    dropped: tuple[Ablation, ...]
    rivals: Rivals = field(default_factory=dict)


def cross_validate(nominal: Fit, final: Fit, held_out: Dataset, rivals: Rivals | None = None) -> CrossValidation:
    """Ablate every term; drop those that held-out recordings or laps refute, the most harmful first.

    The strongest rival that the training recordings do not tell from a dropped term takes its place; without one, and
    where the torque refutes the term, another variant of its mechanism. It is tested in turn. So is a rival that
    predicts the torque of held-out motion better.
    """
    dropped: list[Ablation] = []
    known = dict(rivals or {})
    given = nominal.estimator.evaluate(nominal.hypothesis.given)
    while True:
        ablations = _ablate(given, nominal, final, held_out)
        harmful = [ablation for ablation in ablations if ablation.refuted]
        if not harmful:
            better = _better_equal(final, ablations, known, held_out)
            if better is None:
                return CrossValidation(final, tuple(ablations), tuple(dropped), known)
            final, known = better
            continue
        worst = min(harmful, key=lambda ablation: ablation.gain or 0.0)
        dropped.append(worst)
        fit, rest = final, worst.without
        final = claimed(rest.refit(30)) if rest.terms else rest
        others = known.pop(worst.term.key, ())
        for index, rival in enumerate(others):
            if rival.tied and (other := _instead(fit, worst.term, rival.terms[-1], final)):
                final = other
                known[final.terms[-1].key] = [one.beside(rival) for one in others[index + 1 :]]
                break
        else:
            tried = [(one.term.effect, one.term.variant) for one in dropped]
            forms = other_variants(worst.term, fit.bench) if worst.against_torque else []
            starts = [one for one in forms if (one.effect, one.variant) not in tried]
            final = next((other for one in starts if (other := _instead(fit, worst.term, one, final))), final)


def _better_equal(
    final: Fit, ablations: Sequence[Ablation], rivals: Rivals, held_out: Dataset
) -> tuple[Fit, dict[Key, Sequence[RivalFit]]] | None:
    """The fit with a rival in the place of a term that training does not tell from it and held-out torque does.

    The term is a rival of it then, with that objection. None where no rival predicts more.
    """
    for ablation in ablations:
        term, own = ablation.term, rivals.get(ablation.term.key, ())
        for rival in own if ablation.torque else ():
            other = _instead(final, term, rival.terms[-1], ablation.without) if rival.tied else None
            if other is None:
                continue
            torque = torque_of(other, ablation.without, other.terms[-1], held_out)
            told = torque and more_torque(ablation.torque, torque) >= CRITERIA.discrepancy
            if told and bic_margin(other.on(held_out), final.on(held_out)) >= CRITERIA.tied:
                behind = RivalFit((term,), final.reduced, 0.0, 0.0, other.reduced, objection=_PREDICTS_LESS)
                rest = [one.beside(rival) for one in own if one is not rival]
                known = {key: value for key, value in rivals.items() if key != term.key}
                return other, {**known, other.terms[-1].key: [behind, *rest]}
    return None


def _instead(fit: Fit, dropped: Term, rival: Term, without: Fit) -> Fit | None:
    """Fit a rival in the place of a dropped term; None if it is not needed beside the others, or not valid.

    An event is found in each recording, so that none takes a place here.
    """
    others = [term for term in fit.terms if term.key != dropped.key]
    term = replace(rival, slot=free_slot(rival.effect, others))
    if term.windows or not compatible([*others, term, *(entry.active() for entry in fit.hypothesis.kept)]):
        return None
    index = next(index for index, one in enumerate(fit.terms) if one.key == dropped.key)
    start = fit.hypothesis.without(index).with_term(term)
    found = claimed(fit.estimator.fit(start, evaluations=ENDED))
    if term.key not in {one.key for one in found.terms}:
        return None
    addition = Addition(found, without, without, without)
    return found if addition.claimable and accepted(examine(NEEDED, addition, CRITERIA)) else None


def by_channel(fit: Fit, least: float = 1.0) -> dict[str, float]:
    """Energy of the residuals of each channel in units of noise^2, by default at least that of the noise."""
    return fit.energy(lambda ratio: max(ratio, least))


def _ablate(given: Fit, nominal: Fit, final: Fit, held_out: Dataset) -> list[Ablation]:
    rebased = final.hypothesis.rebased

    def without(index: int) -> Fit:
        rest = rebased.without(index)
        return final.estimator.fit(rest, evaluations=12) if rest.terms else nominal

    fits = in_parallel([partial(without, index) for index in range(len(final.terms))])
    own_held_out = final.on(held_out) if held_out.runs else None
    differs = unrepeated(final.hypothesis, final.data)

    every = final.data.over((*final.data.runs, *held_out.runs))

    def clear(index: int, term: Term, other: Fit, log_chance: float | None) -> bool:
        if term.windows and not strength_told(other, term, every):
            return False
        if log_chance is not None and log_chance < math.log(CRITERIA.significance):
            return True
        return not final.jacobian.size or strength_over_error(final, index) > 1.0  # without a Jacobian it is not told

    def ablation(index: int, term: Term, other: Fit) -> Ablation:
        there = other.on(held_out) if held_out.runs else None
        least = _LEAST if other.within_noise else 1.0  # there the shape has shown that it is no noise
        own = by_channel(final, least)
        factors = {channel: value / own[channel] for channel, value in by_channel(other, least).items()}
        channel = max(factors, key=lambda name: factors[name])
        log_chance = None if term.windows else log_chance_below_noise(final, other)
        train, more, gain = factors[channel], None, None
        if there and own_held_out:
            beyond, inside = by_channel(there, least)[channel], by_channel(own_held_out, least)[channel]
            if term.windows:  # an event is found in each recording: none is a test of another
                train = (train * own[channel] + beyond) / (own[channel] + inside)
            else:
                more, gain = beyond / inside, _gain(own_held_out, there)
        acts = bool(there and own_held_out and _change(own_held_out, there) > CRITERIA.acts * _change(final, other))
        return Ablation(
            term,
            other,
            channel,
            train,
            more,
            gain,
            unrepeated(other.hypothesis, other.data) / differs if differs > 0.0 else None,
            acts,
            clear(index, term, other, log_chance),
            log_chance,
            _quiet(final, other),
            torque_of(final, other, term, held_out, given),
            _by_torque(final, other, term, [final.data, *([held_out] if acts else [])]),
            harm(final, other, given),
        )

    return [ablation(index, term, other) for index, (term, other) in enumerate(zip(final.terms, fits, strict=True))]


def _by_torque(fit: Fit, without: Fit, term: Term, every: Sequence[Dataset]) -> float:
    """Energy of the torque missed without a term over that with it, the least of the data sets on which it acts.

    Below the noise of a row, where the energy of the position is that of the noise with a term and without; else 1.
    """
    if term.windows or not without.within_noise:
        return 1.0
    told = [torque_of(fit, without, term, data) for data in every]
    return min((one[1] / one[0]) ** 2 if one and one[0] > 0.0 else 1.0 for one in told)


def _change(fit: Fit, without: Fit) -> float:
    """Mean squared change of the residuals by a term, in units of noise^2."""
    change = without.residuals.vector - fit.residuals.vector
    return float(change @ change) / change.size


def _quiet(fit: Fit, without: Fit) -> bool:
    """True if a term removes too little on motion without noise: less than a term must, and not most of its gain."""
    removed = energy_without_noise(fit, without)
    return removed is not None and removed < min(
        CRITERIA.material * fit.noise_energy, CRITERIA.on_motion * (without.cost - fit.cost)
    )


def _gain(fit: Fit, without: Fit) -> float:
    """Evidence for the term on held-out recordings, negative where it harms."""
    return bic_margin(fit, without) + (fit.hypothesis.free - without.hypothesis.free) * float(np.log(fit.rows))
