"""Recordings, or parts of one, that the twin explains one by one, with other parameters for each: the axis changed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import standard_errors
from hil.identification.measured import SETTLE_IN_MOTION_S, Measured
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.quantities import percent, quantity, unit_of

_SURE = 3.0  # standard errors from which two values differ
_BLOCK_S = 0.02  # resolution of the moment: several time constants of the observer
_MOST = 0.9  # of the energy above the noise that a change explains; less has another cause
_SHORTEST = 0.1  # of the judged rows: a shorter part tells no parameters


def changed_between(nominal: Fit, held_out: Dataset) -> str:
    """Parameters that differ between recordings which the twin reproduces alone; empty if it does not, or if none does.

    `nominal` is the fit of one set of parameters to those of training.
    """
    runs = (*nominal.data.runs, *held_out.runs)
    if len(runs) < 2:
        return ""
    fits = _each(nominal.data, runs)
    told = _differing(fits, [f"in {run.name}" for run in runs]) if all(fit.at_floor for fit in fits) else ""
    return (
        "Each recording alone is explained without missing physics, with parameters of its own: the axis changed "
        f"between them. {told}."
        if told
        else ""
    )


def changed_within(nominal: Fit, held_out: Dataset) -> str:
    """Parameters that change at a moment of a recording and explain nearly all of its mismatch; empty if there is none.

    The moment is that at which two sets of parameters, one before and one after it, leave least of the residuals, each
    linear in their change. `nominal` is the fit of one set to the recordings; `held_out` may hold the moment.
    """
    for run in (*nominal.data.runs, *held_out.runs):
        alone = fit_nominal_parameters(nominal.data.over([run]))
        if alone.at_floor or not alone.jacobian.shape[1]:
            continue
        row = _moment(alone)
        settled = row + round(SETTLE_IN_MOTION_S / run.period_s)
        if settled >= run.motor.size:
            continue
        fits = _each(nominal.data, [run.until(row), replace(run, lead_in=settled)])
        explained = 1.0 - sum(fit.excess for fit in fits) / alone.excess
        if explained < _MOST or not (told := _differing(fits, ["before", "after"])):
            continue
        how = "without missing physics" if all(fit.at_floor for fit in fits) else f"for {percent(explained)}"
        return (
            f"The mismatch of {run.name} is explained {how} by parameters that change at {run.time_s[row]:.2f} s: "
            f"the axis changed there. {told}."
        )
    return ""


def _each(data: Dataset, runs: Sequence[Measured]) -> list[Fit]:
    """Fit of the nominal parameters to each run alone."""
    return [fit_nominal_parameters(data.over([run])) for run in runs]


def _differing(fits: Sequence[Fit], where: Sequence[str]) -> str:
    """Parameters that differ between fits, each with its value and where it is; empty if none does."""
    values = np.array([fit.hypothesis.values for fit in fits])
    errors = np.array([standard_errors(fit)[: values.shape[1]] for fit in fits])
    told, stuck = [], {name for fit in fits for name in fit.at_bound}  # a value at its bound is not identifiable
    for index, coordinate in enumerate(fits[0].hypothesis.coordinates):
        least, most = int(np.argmin(values[:, index])), int(np.argmax(values[:, index]))
        sure = _SURE * float(np.hypot(*errors[[least, most], index]))
        if coordinate.name not in stuck and values[most, index] - values[least, index] > sure:
            unit = unit_of(coordinate.name)
            each = (f"{quantity(value, unit)} {one}" for value, one in zip(values[:, index], where, strict=True))
            told.append(f"{coordinate.name} {', '.join(each)}")
    return "; ".join(told)


def _moment(alone: Fit) -> int:
    """Row of the only run of a fit at which a change of its parameters leaves least of its residuals."""
    (run,) = alone.data.runs
    parts = alone.residuals.split(np.column_stack([alone.jacobian, alone.residuals.vector]))
    block = max(round(_BLOCK_S / run.period_s), 1)
    rows = parts[0].shape[0] // block * block
    table = np.concatenate([part[:rows].reshape(rows // block, block, -1) for part in parts], axis=1)
    normal = np.einsum("bij,bik->bjk", table, table).cumsum(axis=0)
    margin = max(round(_SHORTEST * len(normal)), 1)
    cuts = range(margin, len(normal) - margin)
    best = min(cuts, key=lambda cut: _left(normal[cut]) + _left(normal[-1] - normal[cut]))
    return run.judged.indices(run.motor.size)[0] + (best + 1) * block


def _left(normal: FloatArray) -> float:
    """Energy of the last column that the others leave, from the products (k, k) of all."""
    solved = np.linalg.pinv(normal[:-1, :-1], hermitian=True) @ normal[:-1, -1]
    return float(normal[-1, -1] - normal[:-1, -1] @ solved)
