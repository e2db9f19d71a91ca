"""Equations of the axis that are linear in unknown coefficients, and the mechanisms behind their terms.

    controller    command - law(recorded positions)  = sum of terms
    drive         torque - command                   = sum of terms
    motor         torque = J a + J_t a_t + J_s a_t'' + D v + Fc sign(v) + sum of terms    rows of sliding motion
    transmission  table - r motor = x_0 + c_0 a_t + c_1 a_t' + c_2 a_t'' + sum of terms

Every mechanism of the library has its terms. A term may belong to several mechanisms: the one that explains most of the
selected terms is named.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.identification.measured import Measured
from hil.validation.proof.peers.case import PeerCase
from hil.validation.proof.peers.terms import MAKERS, Effects

BLOCKS = tuple(MAKERS)
PLANT = ("motor", "transmission")  # blocks of usual identification methods
_DEPENDENT = 1e-6  # share of a term outside the span of the others below which it is redundant


@dataclass(frozen=True, eq=False)
class Equation:
    """An equation over rows (n,), the nominal axis projected out of it: target (n,) and terms (n, m).

    effects[j]: what a positive and what a negative coefficient of term j may come from. `noise`: of the target.
    """

    block: str
    target: FloatArray
    terms: FloatArray
    effects: list[tuple[Effects, Effects]]
    noise: float


def equations(
    case: PeerCase,
    runs: Sequence[Measured],
    blocks: Sequence[str] = BLOCKS,
    residuals: Callable[[Measured], Mapping[str, FloatArray]] | None = None,
) -> list[Equation]:
    """Return the equations of some blocks of a case over runs; without a linear encoder there is no transmission.

    `residuals` gives other targets (n,) of a run, by block, in units of noise, for some blocks.
    """
    found = []
    for block in blocks:
        if block == "transmission" and not runs[0].table_m.size:
            continue
        drafts = [MAKERS[block](run, case.nominal.bench, case.scene) for run in runs]
        if residuals is not None:
            drafts = [
                replace(draft, target=errors[block], noise=1.0) if block in errors else draft
                for draft, errors in zip(drafts, map(residuals, runs), strict=True)
            ]
        rows = np.concatenate([draft.table(run.period_s) for draft, run in zip(drafts, runs, strict=True)])
        count = 1 + len(drafts[0].nominal)
        basis, _ = np.linalg.qr(rows[:, 1:count])
        rows -= basis @ (basis.T @ rows)
        found.append(
            Equation(block, rows[:, 0], rows[:, count:], drafts[0].effects, max(draft.noise for draft in drafts))
        )
    return found


def forward(equation: Equation, among: Sequence[int]) -> Iterator[tuple[int, float]]:
    """Yield terms by orthogonal forward regression, each with its share of the energy that remained before it.

    The term that explains most of the remaining energy is next. Ends when the other terms are redundant.
    """
    left, w = equation.target.copy(), equation.terms[:, list(among)]
    size = np.sum(w**2, axis=0)
    for _ in among:
        energy = np.sum(w**2, axis=0)
        usable = energy > _DEPENDENT * np.maximum(size, 1e-300)
        gain = np.where(usable, (w.T @ left) ** 2 / np.where(usable, energy, 1.0), 0.0)
        best = int(np.argmax(gain))
        if not gain[best] > 0.0:
            return
        yield among[best], float(gain[best] / (left @ left))
        unit = w[:, best] / np.sqrt(energy[best])
        left -= unit * (unit @ left)
        w -= np.outer(unit, unit @ w)


def named(found: Sequence[tuple[Equation, Sequence[int]]]) -> list[str]:
    """Return the mechanisms behind the selected terms of equations.

    The one whose terms explain most energy, in units of noise, comes first; its terms are then removed.
    """
    terms = list[tuple[Effects, float]]()
    for equation, chosen in found:
        coefficients = np.linalg.lstsq(equation.terms[:, list(chosen)], equation.target, rcond=None)[0]
        signs = dict(zip(chosen, coefficients < 0.0, strict=True))
        left = float(np.mean(equation.target**2)) / equation.noise**2
        for j, share in forward(equation, chosen):
            terms.append((equation.effects[j][int(signs[j])], share * left))
            left -= share * left
    names = list[str]()
    while terms:
        energies = dict.fromkeys((effect for effects, _ in terms for effect in effects), 0.0)
        for effect in energies:
            energies[effect] = sum(energy for effects, energy in terms if effect in effects)
        best = max(energies, key=lambda effect: energies[effect])
        if energies[best] < CRITERIA.material:
            break
        names.append(best)
        terms = [(effects, energy) for effects, energy in terms if best not in effects]
    return names
