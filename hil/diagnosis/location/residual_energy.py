"""Residual energy row by row: what a hypothesis leaves of a recording, block by block, in units of noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.estimation.fit import Fit
from hil.diagnosis.estimation.hypothesis import scales
from hil.diagnosis.estimation.terms import Term
from hil.identification.dataset import Measured

_MEMORY_S = 0.03  # an error of the table counts as new for so long


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy above the floor of each row (n,) of one run, and its residual per channel in units of noise."""

    run: Measured
    rows: FloatArray
    parts: dict[str, FloatArray]


def energies(found: Fit, runs: Sequence[Measured], reference: Fit | None = None) -> list[Energy]:
    """Energy of the rows of each run that a hypothesis leaves; with `reference`, that of the difference of both."""
    result = []
    for run in runs:
        scale = scales(run, found.model.bench, found.model.observer_s)
        parts = {name: values / scale[name] for name, values in found.model.blocks(found.x, run).items()}
        if reference is not None:
            other = reference.model.blocks(reference.x, run)
            parts = {name: values - other[name] / scale[name] for name, values in parts.items()}
        rows = np.sum([_arising(name, values, run) ** 2 for name, values in parts.items()], axis=0)
        if reference is None:
            rows = rows - len(parts)
        rows[: run.judged.start] = 0.0
        result.append(Energy(run, rows, parts))
    return result


def without_terms(found: Fit, off: Term | None = None) -> Fit:
    """The hypothesis with its terms, or one of them, switched off and all else as it is."""
    kept = tuple(term for term in found.model.resolved(found.x)[1] if off is not None and term.key != off.key)
    model = replace(found.model, terms=kept)
    x = np.concatenate([found.x[: model.nominal_count], model.initial()[model.nominal_count :]])
    return replace(found, model=model, x=x)


def _arising(channel: str, values: FloatArray, run: Measured) -> FloatArray:
    """The part of a residual (n,) that arises at each row.

    The table keeps an error once it has it, at standstill too: what counts is by how much it changes.
    """
    if channel != "table":
        return values
    lag = max(round(_MEMORY_S / run.period_s), 1)
    before = np.concatenate([np.full(lag, values[0]), values[:-lag]])
    return np.asarray((values - before) / np.sqrt(2.0))
