"""Test whether the shape that a term adds to the torque, or to the difference of the encoders, is in what a fit leaves.

    r = c s + inertia, friction and offset,      s = r of the fit without the term - r of the fit with it

Least squares on the rows that slide: `c / error` is Student's t with one degree of freedom less than the blocks of the
jackknife (`hil.identification.least_squares`). Thousands of rows together tell what hides in the noise of each one.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.structure_left import TORQUE, Dependence, channels, left_in_channel, share_left
from hil.identification.estimator import Fit
from hil.identification.least_squares import BLOCKS, least_squares
from hil.identification.plain_model import plain_columns
from hil.identification.torque_left import fit_plain, measured_motion
from hil.twin.library import BY_ID, LIBRARY


def below_noise(fit: Fit, without: Fit, structure: Sequence[Dependence], index: int = -1) -> tuple[float, float]:
    """Share of a structure that a fit with a term leaves; where there is none, the chance of the term's shape.

    The other of the two is 0. A delay or a resonance is no dependence on a quantity, and passes less of the noise
    itself: (1, 1).
    """
    if BY_ID[fit.terms[index].effect].shifts_phase:
        return 1.0, 1.0
    return (share_left(structure, fit), 0.0) if structure else (0.0, chance_of_shape(fit, without))


def chance_of_shape(fit: Fit, without: Fit, fitted: bool = True) -> float:
    """Probability that chance makes the shape of one of all mechanisms in what the fit without it leaves.

    1 where nothing tells, and for a `fitted` shape of the opposite sign.
    """
    plain, best = fit_plain(fit.data), 1.0
    if plain is None:
        return best
    motions = [measured_motion(run).moved for run in fit.data.runs]
    for channel in channels(fit.data):
        before, after = (left_in_channel(one.hypothesis, fit.data, channel, plain) for one in (without, fit))
        rows = [one.rows for one in before]
        left, other = (
            np.concatenate([one.left[at] for one, at in zip(each, rows, strict=True)]) for each in (before, after)
        )
        if left.size < 10 * BLOCKS or not (np.isfinite(left).all() and np.isfinite(other).all()):
            continue
        columns = {"shape": left - other, "offset": np.ones_like(left)}
        if channel == TORQUE:
            plains = [plain_columns(moved) for moved in motions]
            columns |= {
                name: np.concatenate([one[name][at] for one, at in zip(plains, rows, strict=True)])
                for name in plains[0]
            }
        found = least_squares(columns, left)["shape"]
        if np.isfinite(found.std_error) and found.std_error > 0.0:
            ratio = found.value / found.std_error
            chance = student.sf(ratio, BLOCKS - 1) if fitted else 2.0 * student.sf(abs(ratio), BLOCKS - 1)
            best = min(best, len(LIBRARY) * float(chance))
    return best


def shown(base: Fit, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Candidates whose shape, at the values where their search begins, is in what a base leaves, the clearest first."""
    found = []
    for one in candidates:
        term = one.term
        if not BY_ID[term.effect].shifts_phase:
            begun = base.estimator.evaluate(base.hypothesis.with_term(term))
            found.append((chance_of_shape(begun, base, fitted=False), one))
    level = [(chance, one) for chance, one in found if chance < CRITERIA.significance]
    return [one for _, one in sorted(level, key=lambda pair: pair[0])]
