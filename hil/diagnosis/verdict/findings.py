"""From fitted terms to findings: values with standard errors, equivalents, rivals, confidence, sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.estimation.fit import Fit
from hil.diagnosis.estimation.noise_ratios import noise_ratios
from hil.diagnosis.estimation.terms import FRICTION, LOAD, SAME, Key, Term, ambiguous
from hil.diagnosis.result import Correction, Finding, Value
from hil.diagnosis.result import Rival as RivalText
from hil.diagnosis.search.forward_selection import TIED, Explanation, Rival
from hil.diagnosis.search.validity import claimable
from hil.diagnosis.verdict.confidence import confidence
from hil.diagnosis.verdict.cross_validation import Ablation
from hil.diagnosis.wording import NOMINAL_UNITS, number, sentence, title
from hil.identification.dataset import Measured
from hil.twin.library import BY_ID
from hil.twin.mechanism import Dimension, Role

# On development cases (seeds 931 and 941 of the proof's generator, 67 parameters) nine in ten errors are below 3.5
# standard errors of the noise alone, 2.1 times 1.645: two honest simulations of one axis differ by that.
_WIDENED = 2.1
_LEAST = 0.01  # of the step of a difference
_BLOCK_ROWS = 200  # longer than residuals remember: 0.2 s at 1 kHz


def renamed(found: Fit) -> Fit:
    """The fit with a constant load called asymmetric friction, where it may be that and the bench knows of no load: the
    same torque, and the commoner cause."""
    bench, resolved = found.model.resolved(found.x)
    if any(one.effect == FRICTION for one in resolved) or any(entry.effect == LOAD for entry in bench.mechanisms):
        return found

    def called(term: Term, fitted: Term) -> Term:
        rather = term.effect == LOAD and claimable(replace(fitted, effect=FRICTION), bench)
        return replace(term, effect=FRICTION) if rather else term

    return replace(found, model=replace(found.model, terms=tuple(map(called, found.model.terms, resolved))))


def findings(
    explanation: Explanation,
    final: Fit,
    ablations: Sequence[Ablation],
    forms: Mapping[int, int],
    train: Sequence[Measured],
    held_out: Sequence[Measured],
) -> tuple[Finding, ...]:
    """A finding for each term that is not the form of another (`forms`), the one that matters most first."""
    deviations = standard_errors(final)
    left = math.sqrt(max(ratio for run in (*train, *held_out) for ratio in noise_ratios(final, run).values()))
    bench, terms = final.model.resolved(final.x)
    row = final.model.nominal_count
    result = []
    for index, (term, ablation) in enumerate(zip(terms, ablations, strict=True)):
        errors = deviations[row : row + len(term.values)]
        row += len(term.values)
        if index in forms:
            continue
        rivals = rivals_of(explanation, term)
        tied = [rival.fit.model.terms[-1].effect for rival in rivals if rival.tied]
        if ambiguous(term):
            tied += [name for name in SAME if name != term.effect and claimable(replace(term, effect=name), bench)]
        margin = min(
            (rival.evidence for rival in rivals if rival.fit.model.terms[-1].effect not in tied),
            default=explanation.needed.get(_key(explanation, term), math.inf),
        )
        result.append(
            (
                ablation.train,
                Finding(
                    effect=term.effect,
                    variant=BY_ID[term.effect].forms[term.variant],
                    confidence=confidence(left, _factor(ablation), margin),
                    equivalents=tuple(dict.fromkeys(tied)),
                    rivals=tuple(
                        RivalText(effect=rival.fit.model.terms[-1].effect, evidence=_text(rival, term, train))
                        for rival in rivals
                    ),
                    parameters=_values(term, errors, bench),
                    sentence=sentence(_normal(term), bench),
                    form=" ".join(
                        sentence(_normal(terms[other]), bench) for other, law in forms.items() if law == index
                    ),
                    needed=_needed(ablation),
                ),
            )
        )
    return tuple(finding for _, finding in sorted(result, key=lambda pair: -pair[0]))


def corrections(owner: Bench, found: Fit) -> dict[str, Correction]:
    """The nominal parameters of the owner and as fitted."""
    deviations = standard_errors(found)
    return {
        name: Correction(nominal=float(getattr(owner.axis, name)), value=value, std=std, unit=NOMINAL_UNITS[name])
        for name, value, std in zip(owner.axis.NOMINAL, found.model.values(found.x), deviations, strict=False)
    }


def standard_errors(found: Fit) -> list[float]:
    """Standard error of each physical parameter, robust against residuals that are no white noise:

        A^-1 (sum over blocks of g g^T) A^-1,   A = J^T J,   g = J^T r of a block      (Liang and Zeger 1986)

    and widened for what a model differs by from the axis beside noise. A controller that is replayed to the bit leaves
    no noise at all: nothing is known better than a hundredth of the differences that its derivative was taken with.
    """
    scale = np.linalg.norm(found.jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    slope = found.jacobian / scale
    inverse = np.linalg.pinv(slope.T @ slope, hermitian=True)
    starts = np.concatenate(
        [
            np.arange(begin, end, _BLOCK_ROWS)
            for begin, end in zip((0, *found.splits), (*found.splits, found.residuals.size), strict=True)
        ]
    )
    score = np.add.reduceat(slope * found.residuals[:, None], starts, axis=0)
    covariance = inverse @ (score.T @ score) @ inverse
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)) / scale
    return [
        float(
            max(_WIDENED * error, _LEAST * coordinate.step)
            * (abs(value) if coordinate.logarithmic else abs(coordinate.scale))
        )
        for error, value, coordinate in zip(errors, found.model.values(found.x), found.model.coordinates, strict=True)
    ]


def diagnosed_bench(owner: Bench, found: Fit) -> Bench:
    """The owner's bench with the parameters and the terms of a fit: what every other command accepts."""
    bench, terms = found.model.resolved(found.x)
    entries = tuple(
        MechanismEntry(
            effect=term.effect,
            variant=BY_ID[term.effect].forms[term.variant],
            parameters=dict(zip(BY_ID[term.effect].names, _normal(term).values, strict=True)),
        )
        for term in terms
    )
    return bench.model_copy(update={"name": f"{owner.name}_diagnosed", "mechanisms": found.model.kept + entries})


def _normal(term: Term) -> Term:
    """Phases within one turn."""
    values = tuple(
        math.remainder(value, 2.0 * math.pi) if parameter.role is Role.PHASE else value
        for value, parameter in zip(term.values, BY_ID[term.effect].parameters, strict=True)
    )
    return replace(term, values=values)


def _values(term: Term, errors: Sequence[float], bench: Bench) -> dict[str, Value]:
    return {
        parameter.name: Value(value=value, std=error, unit=parameter.dimension.unit(bench.axis.linear))
        for parameter, value, error in zip(BY_ID[term.effect].parameters, _normal(term).values, errors, strict=True)
    }


def _factor(ablation: Ablation) -> float:
    """By which factor more energy is left without a term; on held-out recordings too, where these show it at all."""
    if ablation.held_out is None or not ablation.shown:
        return ablation.train
    return min(ablation.train, ablation.held_out)


def _key(explanation: Explanation, term: Term) -> Key:
    """The key under which the search knows a term that was renamed."""
    known = set(explanation.rivals) | set(explanation.needed)
    return term.key if term.key in known or term.effect not in SAME else replace(term, effect=LOAD).key


def rivals_of(explanation: Explanation, term: Term) -> list[Rival]:
    """Other mechanisms than the term's own, each in its best variant, the strongest first."""
    best: dict[str, Rival] = {}
    for rival in sorted(explanation.rivals.get(_key(explanation, term), []), key=lambda found: found.evidence):
        other = rival.fit.model.terms[-1]
        if other.effect != term.effect and not (ambiguous(other) and ambiguous(term)):
            best.setdefault(other.effect, rival)
    return list(best.values())


def _text(rival: Rival, term: Term, train: Sequence[Measured]) -> str:
    if rival.tied:
        return (
            f"cannot be told apart from {title(term.effect)} by this motion: evidence against it is "
            f"{number(rival.evidence)}, and next to the noise it leaves as much"
        )
    size = math.sqrt(rival.fit.reduced)
    parameters = BY_ID[rival.fit.model.terms[-1].effect].parameters
    at = rival.fit.model.resolved(rival.fit.x)[1][-1].values
    stuck = [
        parameter.name
        for parameter, value in zip(parameters, at, strict=True)
        if parameter.dimension is not Dimension.ANGLE and value in (parameter.low, parameter.high)
    ]
    bound = f", with {', '.join(stuck)} at the end of what is possible" if stuck else ""
    return (
        f"leaves {number(size)} × the noise in rms{bound}; evidence against it "
        f"{number(rival.evidence)}, where {TIED:g} is very strong"
    )


def _needed(ablation: Ablation) -> str:
    text = f"without it the residual energy is {number(ablation.train)} × as large on the training recordings"
    if ablation.held_out is None:
        return text + "; there are no held-out recordings"
    return f"{text}, {number(ablation.held_out)} × on the held-out ones"
