"""Residual energy of a hypothesis row by row, block by block, in units of noise."""

from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.terms import Term

# Time over which a change of the table's error is assigned to a row: several time constants of the observer.
_MEMORY_S = 0.03


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy above the floor of each row (n,) of one run, and its residual per channel in units of noise."""

    run: Measured
    rows: FloatArray
    parts: dict[str, FloatArray]


def energies(
    hypothesis: Hypothesis, data: Dataset, reference: Hypothesis | None = None, of_place: bool = False
) -> list[Energy]:
    """Energy of the rows of each run under a hypothesis; with `reference`, that of the difference of both.

    `of_place`: an error of the table is that of its place, as of an encoder; else what remains of an earlier cause.
    """
    result = []
    for index, run in enumerate(data.runs):
        parts = hypothesis.residuals(data).over_noise(index)
        if reference is not None:
            other = reference.residuals(data).over_noise(index)
            parts = {name: values - other[name] for name, values in parts.items()}
        arising = [values if of_place else _arising(name, values, run) for name, values in parts.items()]
        rows = np.sum([values**2 for values in arising], axis=0)
        if reference is None:
            rows = rows - len(parts)
        rows[: run.evaluated.start] = 0.0
        result.append(Energy(run, rows, parts))
    return result


def without_terms(hypothesis: Hypothesis, off: Term | None = None) -> Hypothesis:
    """Remove all terms of a hypothesis, or one of them, without refitting."""
    keys = [term.key for term in hypothesis.terms]
    return hypothesis.without(*(index for index, key in enumerate(keys) if off is None or key == off.key))


def _arising(channel: str, values: FloatArray, run: Measured) -> FloatArray:
    """Part of a residual (n,) that arises at each row.

    An error of the table persists, at standstill too, so that its change is taken.
    """
    if channel != "table":
        return values
    lag = max(round(_MEMORY_S / run.period_s), 1)
    before = np.concatenate([np.full(lag, values[0]), values[:-lag]])
    return np.asarray((values - before) / np.sqrt(2.0))
