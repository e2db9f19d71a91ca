"""Sparse regression by STLSQ (Brunton, Proctor and Kutz 2016) of PySINDy (Kaptanoglu et al. 2022); see `make peers`.

It is given the equations of `hil.proof.peers.regressors` with the nominal terms already taken out; terms of variance
one and the target in units of noise, so that one threshold says the same of them all; and the threshold from the
held-out recording: the largest that predicts it as well as the best one, up to a standard error.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from hil.errors import HilError
from hil.proof.peers.case import Answer, Case
from hil.proof.peers.regressors import PLANT, Equation, equations, named

_THRESHOLDS = np.geomspace(0.02, 5.0, 16)  # contribution of a term, in units of noise
_RIDGE = 1e-3  # of the energy of a term
_BLOCK = 200  # rows that count as one observation: errors in a row resemble each other


def pysindy(case: Case, blocks: Sequence[str] = PLANT) -> Answer:
    """The answer of PySINDy about a case. Raises HilError where PySINDy is not installed."""
    try:
        from pysindy import STLSQ
    except ModuleNotFoundError as error:
        raise HilError(
            f"--method pysindy: {error.name} is not installed, allowed are methods without it; install what "
            "the proof measures against with: make peers"
        ) from None
    train, held_out = equations(case, case.train, blocks), equations(case, case.held_out, blocks)
    return case.answer(named([(one, select(one, other, STLSQ)) for one, other in zip(train, held_out, strict=True)]))


def select(train: Equation, held_out: Equation, optimizer: Any) -> list[int]:
    """Terms that survive the threshold which the held-out recording asks for."""
    size = np.sqrt(np.mean(train.terms**2, axis=0))
    used = np.flatnonzero(size > 0.0)
    # the triangle of a QR decomposition has the same normal equations as all the rows
    columns = np.column_stack([train.terms[:, used] / size[used], train.target / train.noise])
    rows = np.asarray(np.linalg.qr(columns, mode="r"))
    found = list[tuple[float, float, list[int]]]()  # held-out error, its standard error, terms
    for threshold in _THRESHOLDS:
        fitted = optimizer(threshold=threshold, alpha=_RIDGE * train.target.size)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a threshold that nothing survives
            fitted.fit(rows[:, :-1], rows[:, -1])
        coefficients = fitted.coef_.ravel() / size[used]
        left = held_out.target / train.noise - held_out.terms[:, used] @ coefficients
        squares = [float(np.mean(part**2)) for part in np.array_split(left, max(left.size // _BLOCK, 2))]
        found.append(
            (
                float(np.mean(squares)),
                float(np.std(squares)) / len(squares) ** 0.5,
                used[np.flatnonzero(coefficients)].tolist(),
            )
        )
    mean, error, _ = min(found)
    return next(terms for other, _, terms in reversed(found) if other <= mean + error)
