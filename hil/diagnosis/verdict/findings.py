"""Convert fitted terms to findings: values with standard errors, equivalents, rivals, confidence, sentence.

One curve is one finding: a quadratic drag that only corrects the Stribeck fit (< 2 % of its energy) is reported as part
of that finding. Real contacts follow no law of the library exactly, and drag fits the remainder. The reverse does not
hold: a Stribeck curve beside a large drag has little energy because it acts at low speed alone.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from scipy.special import ndtri_exp

from hil.bench.bench_file import Bench
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import Finding, Rival
from hil.diagnosis.search.initial_values import claimable
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.sentence import TermErrors, rate_in_words, sentence
from hil.diagnosis.stages import Searched
from hil.diagnosis.structure_left import like_noise, structure_left
from hil.diagnosis.value import Value
from hil.diagnosis.verdict.confidence import confidence
from hil.diagnosis.verdict.cross_validation import Ablation
from hil.diagnosis.verdict.event_windows import describe_event
from hil.diagnosis.verdict.strength import strength_errors, strength_over_error
from hil.diagnosis.wording import title, unit_in
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import standard_errors
from hil.identification.terms import Key, Term, ambiguous, same_torque, within_a_turn
from hil.identification.torque_left import missed_beyond_noise
from hil.quantities import digits
from hil.twin.library import BY_ID
from hil.twin.mechanism import Block
from hil.twin.parameter import Dimension


def renamed(fit: Fit) -> Fit:
    """The fit with a rare cause renamed to the frequent one of the same torque, where that is valid.

    A name that the fit or the bench has already stays.
    """
    hypothesis = fit.hypothesis
    named, known = {term.effect for term in fit.terms}, {entry.effect for entry in hypothesis.bench.mechanisms}

    def called(term: Term, fitted: Term) -> Term:
        frequent, rare = same_torque(term) or ("", "")
        if term.effect != rare or frequent in named or rare in known:
            return term
        rather = claimable(replace(fitted, effect=frequent), fit.bench, fit.data.runs)
        return replace(term, effect=frequent) if rather else term

    return replace(fit, hypothesis=replace(hypothesis, terms=tuple(map(called, hypothesis.terms, fit.terms))))


def findings(
    searched: Searched,
    final: Fit,
    ablations: Sequence[Ablation],
    forms: Mapping[int, int],
    held_out: Dataset,
) -> tuple[Finding, ...]:
    """Make a finding of each term that is not part of another (`forms`), the one with most energy first."""
    deviations, sure = standard_errors(final), confidences(searched, final, ablations, held_out)
    bench, terms = final.bench, final.terms
    result = []
    for index, (term, ablation) in enumerate(zip(terms, ablations, strict=True)):
        if index in forms:
            continue
        errors = deviations[final.hypothesis.columns(index)]
        rivals, tied, _ = _against(searched, final, term)
        event = describe_event(final, index, held_out) if term.windows else None
        result.append(
            (
                ablation.train,
                Finding(
                    effect=term.effect,
                    variant=BY_ID[term.effect].forms[term.variant],
                    confidence=sure[index],
                    equivalents=tied,
                    rivals=tuple(
                        Rival(effect=rival.terms[-1].effect, evidence=rival_in_words(rival, term)) for rival in rivals
                    ),
                    parameters=event.parameters if event else _values(term, errors, bench),
                    windows=event.windows if event else (),
                    train=event.train if event else None,
                    sentence=event.sentence
                    if event
                    else sentence(within_a_turn(term), bench, _errors(final, index, deviations)),
                    form=" ".join(
                        sentence(within_a_turn(terms[other]), bench, _errors(final, other, deviations))
                        for other, law in forms.items()
                        if law == index
                    ),
                    rate=rate_in_words(within_a_turn(term), bench, _errors(final, index, deviations)),
                    needed=_needed(ablation),
                ),
            )
        )
    return tuple(finding for _, finding in sorted(result, key=lambda pair: -pair[0]))


def confidences(searched: Searched, final: Fit, ablations: Sequence[Ablation], held_out: Dataset) -> tuple[float, ...]:
    """Confidence of each term of a fit, in [0, 1]. What is left counts, but for noise up to `coloured`."""
    fits = [final.on(data) for data in (final.data, held_out) if data.runs]
    noise = like_noise(final, structure_left(final, held_out))
    missed = missed_beyond_noise(final, held_out)
    margins = [_against(searched, final, term)[2] for term in final.terms]

    def left(channel: str) -> float:
        rms = _left(fits, channel)
        return 1.0 if channel in noise and rms**2 <= CRITERIA.coloured else rms

    return tuple(
        _sure(final, index, ablation.log_chance)
        * confidence(left(ablation.channel), _factor(ablation), margin, 0.0 if _told_by_encoders(ablation) else missed)
        for index, (ablation, margin) in enumerate(zip(ablations, margins, strict=True))
    )


def _told_by_encoders(ablation: Ablation) -> bool:
    """True for an error of a sensor that two encoders tell: they need no torque."""
    return BY_ID[ablation.term.effect].block is Block.SENSOR and ablation.channel == "table"


def _against(searched: Searched, final: Fit, term: Term) -> tuple[list[RivalFit], tuple[str, ...], float]:
    """Rivals of a term, the ids that are not distinguishable from it, and the evidence against the best other one."""
    beside = {one.effect for one in final.terms if one is not term and BY_ID[one.effect].most == 1}
    rivals = [one for one in rivals_of(searched, term) if one.terms[-1].effect not in beside]  # those are no equals
    tied = [rival.terms[-1].effect for rival in rivals if rival.tied]
    others = [name for name in same_torque(term) if name != term.effect]
    tied += [name for name in others if claimable(replace(term, effect=name), final.bench, final.data.runs)]
    margin = min(
        (rival.evidence for rival in rivals if rival.terms[-1].effect not in tied),
        default=searched.needed.get(key_in_search(searched, term), math.inf),
    )
    return rivals, tuple(dict.fromkeys(tied)), margin


def _values(term: Term, errors: Sequence[float], bench: Bench) -> dict[str, Value]:
    return {
        parameter.name: Value(value=value, std=error, unit=unit_in(bench, parameter))
        for parameter, value, error in zip(
            BY_ID[term.effect].parameters, within_a_turn(term).values, errors, strict=True
        )
    }


def _errors(fit: Fit, index: int, deviations: Sequence[float]) -> TermErrors:
    """Errors of a term, of those of all values of a fit."""
    strength = BY_ID[fit.terms[index].effect].strength
    return TermErrors(deviations[fit.hypothesis.columns(index)], strength_errors(fit, index)[strength])


def _sure(fit: Fit, index: int, log_chance: float | None) -> float:
    """Least probability that a strength differs from no effect, whatever the distribution of its error (Chebyshev).

    Below the noise by the normal deviate of the chance of its shape, if that tells more.
    """
    ratio = max(strength_over_error(fit, index), 0.0 if log_chance is None else -float(ndtri_exp(log_chance)))
    return 1.0 - 1.0 / ratio**2 if ratio > 1.0 else 0.0


def _left(fits: Sequence[Fit], channel: str) -> float:
    """Largest rms of a channel over its noise."""
    return math.sqrt(max(ratios[channel] for fit in fits for ratios in fit.noise_ratios))


def _factor(ablation: Ablation) -> float:
    """Energy without a term over that with it: the lower of training and, if it acts there, held-out recordings.

    Of the residual, or of the torque missed, if that tells more.
    """
    if ablation.held_out is None or not (ablation.acts or ablation.shown):
        return max(ablation.train, ablation.by_torque)
    return max(min(ablation.train, ablation.held_out), ablation.by_torque)


def key_in_search(searched: Searched, term: Term) -> Key:
    """Key of a term in the search, before it was renamed."""
    known = set(searched.rivals) | set(searched.needed)
    return term.key if term.key in known or not ambiguous(term) else replace(term, effect=same_torque(term)[-1]).key


def rivals_of(searched: Searched, term: Term) -> list[RivalFit]:
    """Other mechanisms than the term's own, each in its best variant, the strongest first."""
    best: dict[str, RivalFit] = {}
    known = searched.rivals.get(key_in_search(searched, term), [])
    for rival in sorted(known, key=lambda found: (bool(found.objection), found.evidence)):
        other = rival.terms[-1]
        if other.effect != term.effect and not ambiguous(other, term):
            best.setdefault(other.effect, rival)
    return list(best.values())


def rival_in_words(rival: RivalFit, term: Term) -> str:
    """How a rival compares with the named term: what each leaves, the evidence, and what decides beside it."""
    left = f"leaves residuals of {digits(math.sqrt(rival.reduced))} × the noise (rms)"
    if math.isfinite(rival.named):
        left += f", {title(term.effect)} in its place {digits(math.sqrt(rival.named))} ×"
    if rival.tied:
        return f"not distinguishable from {title(term.effect)} by this motion: {left}; {_tie(rival)}"
    return f"{left}{_stuck(rival)}; {_evidence(rival)}{f', but {rival.objection}' if rival.objection else ''}"


def _evidence(rival: RivalFit) -> str:
    """The evidence between a rival and the named term, on the side that it supports."""
    side = "against it" if rival.evidence >= 0.0 else "for it"
    return f"evidence {side} {digits(abs(rival.evidence))}, where {CRITERIA.tied:g} is very strong"


def _tie(rival: RivalFit) -> str:
    """Reason why a rival counts as equivalent and, if the evidence favours it, why the other term is named."""
    if rival.evidence >= CRITERIA.tied:
        return f"{_evidence(rival)}, but the difference is below the model accuracy"
    return f"{_evidence(rival)}{f', but {rival.behind}' if rival.behind else ''}"


def _stuck(rival: RivalFit) -> str:
    """Names the parameters of a rival that ended at a bound."""
    parameters = BY_ID[rival.terms[-1].effect].parameters
    at = rival.terms[-1].values
    stuck = [
        parameter.spoken
        for parameter, value in zip(parameters, at, strict=True)
        if parameter.dimension is not Dimension.ANGLE and value in (parameter.low, parameter.high)
    ]
    return f", with {', '.join(stuck)} at the bound of the allowed range" if stuck else ""


def _needed(ablation: Ablation) -> str:
    if ablation.term.windows:
        return (
            f"without it the residual energy of all recordings is {digits(ablation.train)} × as large; "
            "an event is found in each recording, held-out ones too, so that their figures do not test it"
        )
    text = f"without it the residual energy is {digits(ablation.train)} × as large on the training recordings"
    if ablation.held_out is None:
        return text + "; there are no held-out recordings"
    return f"{text}, {digits(ablation.held_out)} × on the held-out ones"


def form_of(searched: Searched, ablations: Sequence[Ablation]) -> dict[int, int]:
    """Return the index of a term that corrects the form of a friction law, such as drag -> index of that law's term.

    A term that is tied with another mechanism, which may be the true cause, is no part of a law.
    """
    found = {}
    of_effect = {ablation.term.effect: index for index, ablation in enumerate(ablations)}
    for index, ablation in enumerate(ablations):
        law = of_effect.get(BY_ID[ablation.term.effect].corrects(ablation.term.variant))
        if law is None or any(rival.tied for rival in rivals_of(searched, ablation.term)):
            continue
        # in units of the energy with both
        if ablation.train - 1.0 < CRITERIA.worth * (ablations[law].train - 1.0):
            found[index] = law
    return found
