"""Recordings, or parts of one, that the twin explains one by one, with other parameters for each: the axis changed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import AxisChange, ChangedParameter
from hil.diagnosis.value import Value
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import standard_errors
from hil.identification.measured import SETTLE_IN_MOTION_S, Measured
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.quantities import unit_of

_BLOCK_S = 0.02  # resolution of the moment: several time constants of the observer
_SHORTEST = 0.1  # of the judged rows: a shorter part tells no parameters


@dataclass(frozen=True, eq=False)
class Change:
    """A change of the axis: `summary`, and the evidence for it.

    `runs` are the recordings, `parts` the fits of the nominal parameters to each of them, or before and after the
    moment; `left` is the share of the energy above the noise that these leave.
    """

    summary: AxisChange
    runs: tuple[Measured, ...]
    parts: tuple[Fit, ...]
    left: float

    @property
    def explains_all(self) -> bool:
        """True if nothing above the noise is left."""
        return all(fit.at_floor for fit in self.parts)


def changed(nominal: Fit, held_out: Dataset) -> Change | None:
    """Find parameters of the axis that change between the recordings, or during one; None if none does.

    `nominal` is the fit of one set of parameters to the recordings of training.
    """
    runs = (*nominal.data.runs, *held_out.runs)
    alone = _each(nominal.data, runs)
    if len(runs) > 1 and all(fit.at_floor for fit in alone):
        names = tuple(run.name for run in runs)
        told = AxisChange(recording=None, moment_s=None, parts=names, parameters=_differing(alone))
        if told.parameters:
            return Change(told, runs, tuple(alone), 0.0)
    return next((found for fit in alone if not fit.at_floor and (found := _changed_within(fit))), None)


def _changed_within(alone: Fit) -> Change | None:
    """A change during the only recording of a fit that explains nearly all of its mismatch; else None."""
    (run,) = alone.data.runs
    row, settling = _moment(alone), round(SETTLE_IN_MOTION_S / run.period_s)
    if row is None or row + settling >= run.motor.size:
        return None
    fits = _each(alone.data, [run.until(row), replace(run, lead_in=row + settling)])
    left = sum(fit.excess for fit in fits) / alone.excess
    found = _differing(fits)
    if left > 1.0 - CRITERIA.change or not found:
        return None
    told = AxisChange(recording=run.name, moment_s=float(run.time_s[row]), parts=("before", "after"), parameters=found)
    return Change(told, (run,), tuple(fits), left)


def _each(data: Dataset, runs: Sequence[Measured]) -> list[Fit]:
    """Fit of the nominal parameters to each run alone."""
    return [fit_nominal_parameters(data.over([run])) for run in runs]


def _differing(fits: Sequence[Fit]) -> tuple[ChangedParameter, ...]:
    """Parameters that differ between fits by more than their errors."""
    values = np.array([fit.hypothesis.values for fit in fits])
    errors = np.array([standard_errors(fit)[: values.shape[1]] for fit in fits])
    told, stuck = [], {name for fit in fits for name in fit.at_bound}  # a value at its bound is not identifiable
    for index, coordinate in enumerate(fits[0].hypothesis.coordinates):
        least, most = int(np.argmin(values[:, index])), int(np.argmax(values[:, index]))
        sure = CRITERIA.sigmas * float(np.hypot(*errors[[least, most], index]))
        if coordinate.name not in stuck and values[most, index] - values[least, index] > sure:
            unit = unit_of(coordinate.name)
            pairs = zip(values[:, index], errors[:, index], strict=True)
            each = tuple(Value(value=float(value), std=float(std), unit=unit) for value, std in pairs)
            told.append(ChangedParameter(name=coordinate.name, values=each))
    return tuple(told)


def _moment(alone: Fit) -> int | None:
    """Row of the only run of a fit at which its parameters change most likely; None in a run that is too short.

    Two changes of the parameters, one for the rows before it and one for those after it, leave the smallest residuals
    there. Residuals are taken as linear in these changes.
    """
    (run,) = alone.data.runs
    parts = alone.residuals.split(np.column_stack([alone.jacobian, alone.residuals.vector]))
    block = max(round(_BLOCK_S / run.period_s), 1)
    rows = parts[0].shape[0] // block * block
    table = np.concatenate([part[:rows].reshape(rows // block, block, -1) for part in parts], axis=1)
    normal = np.einsum("bij,bik->bjk", table, table).cumsum(axis=0)
    margin = max(round(_SHORTEST * len(normal)), 1)
    cuts = range(margin, len(normal) - margin)
    if not cuts or not alone.jacobian.shape[1]:
        return None
    best = min(cuts, key=lambda cut: _left(normal[cut]) + _left(normal[-1] - normal[cut]))
    return run.evaluated.indices(run.motor.size)[0] + (best + 1) * block


def _left(normal: FloatArray) -> float:
    """Energy of the last column that the others leave, from the products (k, k) of all."""
    solved = np.linalg.pinv(normal[:-1, :-1], hermitian=True) @ normal[:-1, -1]
    return float(normal[-1, -1] - normal[:-1, -1] @ solved)
