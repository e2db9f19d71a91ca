"""Forward orthogonal regression with plain BIC: FROLS of the NARMAX methodology (Billings 2013), as in SysIdentPy.

    err_j = (w_j . y)^2 / ((w_j . w_j) (y . y)),  w_j: term j made orthogonal to those already in
    BIC = n log(residual energy / n) + k log(n)

The term with the largest error reduction ratio goes in until BIC rises. It is given every equation and term of
`hil.proof.peers.regressors` with the nominal terms already in, exact periods, orders and windows from the diagnosis's
own preparation, and its materiality limit. (SysIdentPy itself does not install beside numpy 2.4.)
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log

from hil.proof.peers.case import Answer, Case
from hil.proof.peers.regressors import PLANT, Equation, equations, forward, named

_MOST = 20  # terms


def forward_selection(case: Case, blocks: Sequence[str] = PLANT) -> Answer:
    """The answer of FROLS about a case."""
    return case.answer(named([(equation, select(equation)) for equation in equations(case, case.train, blocks)]))


def select(equation: Equation) -> list[int]:
    """Terms that BIC lets in, the first one first."""
    rows = equation.target.size
    chosen = list[int]()
    for term, share in forward(equation, range(equation.terms.shape[1])):
        if -rows * log(max(1.0 - share, 1e-300)) <= log(rows) or len(chosen) == _MOST:
            break
        chosen.append(term)
    return chosen
