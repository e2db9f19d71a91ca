"""Sparse regression on the equations of `hil.validation.proof.peers.regressors`, with the nominal terms taken out.

forward_selection: forward orthogonal regression with BIC, FROLS of the NARMAX methodology (Billings 2013), as in
SysIdentPy, which does not install beside numpy 2.4:

    err_j = (w_j . y)^2 / ((w_j . w_j) (y . y)),  w_j: term j made orthogonal to the selected ones
    BIC = n log(residual energy / n) + k log(n)

The term with the largest error reduction ratio is added until BIC rises.

pysindy: STLSQ (Brunton, Proctor and Kutz 2016) of PySINDy (Kaptanoglu et al. 2022). Terms have variance one and the
target is in units of noise, so that one threshold suits all; it is chosen on the held-out recording: the largest whose
prediction error is within a standard error of the best.

Both use periods, orders and windows of the diagnosis's own preparation, and its materiality limit.
"""

import warnings
from collections.abc import Sequence
from math import log
from typing import Any

import numpy as np

from hil.errors import HilError
from hil.validation.proof.peers.case import PeerCase
from hil.validation.proof.peers.regressors import PLANT, Equation, equations, forward, named

_MOST = 20  # terms: more than any case has effects
_THRESHOLDS = np.geomspace(0.02, 5.0, 16)  # contribution of a term, in units of noise
_RIDGE = 1e-3  # of the energy of a term
_BLOCK = 200  # rows of one independent observation: neighbouring errors are correlated


def forward_selection(case: PeerCase, blocks: Sequence[str] = PLANT) -> dict[str, Any]:
    """Return the answer of FROLS to a case."""
    found = equations(case, case.train, blocks)
    return case.answer(named([(equation, select_forward(equation)) for equation in found]))


def select_forward(equation: Equation) -> list[int]:
    """Return the terms that BIC accepts, in the order of selection."""
    rows = equation.target.size
    chosen = list[int]()
    for term, share in forward(equation, range(equation.terms.shape[1])):
        if -rows * log(max(1.0 - share, 1e-300)) <= log(rows) or len(chosen) == _MOST:
            break
        chosen.append(term)
    return chosen


def pysindy(case: PeerCase, blocks: Sequence[str] = PLANT) -> dict[str, Any]:
    """Return the answer of PySINDy to a case. Raises HilError if PySINDy is not installed."""
    try:
        from pysindy import STLSQ
    except ModuleNotFoundError as error:
        raise HilError(
            f"--method pysindy: {error.name} is not installed, allowed are methods without it; install what "
            "the proof measures against with: make peers"
        ) from None
    train, held_out = equations(case, case.train, blocks), equations(case, case.held_out, blocks)
    pairs = zip(train, held_out, strict=True)
    return case.answer(named([(one, select_thresholded(one, other, STLSQ)) for one, other in pairs]))


def select_thresholded(train: Equation, held_out: Equation, optimizer: Any) -> list[int]:
    """Return the terms above the threshold that the held-out recording selects."""
    size = np.sqrt(np.mean(train.terms**2, axis=0))
    used = np.flatnonzero(size > 0.0)
    # the triangle of a QR decomposition has the same normal equations as all the rows
    columns = np.column_stack([train.terms[:, used] / size[used], train.target / train.noise])
    rows = np.asarray(np.linalg.qr(columns, mode="r"))
    found = list[tuple[float, float, list[int]]]()  # held-out error, its standard error, terms
    for threshold in _THRESHOLDS:
        fitted = optimizer(threshold=threshold, alpha=_RIDGE * train.target.size)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # STLSQ warns if no term is above the threshold
            fitted.fit(rows[:, :-1], rows[:, -1])
        coefficients = fitted.coef_.ravel() / size[used]
        left = held_out.target / train.noise - held_out.terms[:, used] @ coefficients
        squares = [float(np.mean(part**2)) for part in np.array_split(left, max(left.size // _BLOCK, 2))]
        terms = used[np.flatnonzero(coefficients)].tolist()
        found.append((float(np.mean(squares)), float(np.std(squares)) / len(squares) ** 0.5, terms))
    mean, error, _ = min(found)
    return next(terms for other, _, terms in reversed(found) if other <= mean + error)
