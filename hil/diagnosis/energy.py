"""Residual energy row by row: what a hypothesis leaves of a recording, block by block, in units of noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.fit import Fit
from hil.diagnosis.model import scales
from hil.measured import Measured

FloatArray = NDArray[np.float64]


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
        rows = np.sum([values**2 for values in parts.values()], axis=0)
        if reference is None:
            rows = rows - len(parts)
        rows[: run.judged.start] = 0.0
        result.append(Energy(run, rows, parts))
    return result
