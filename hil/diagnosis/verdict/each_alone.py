"""Recordings, or parts of one, that the twin explains one by one, with other parameters for each: the axis changed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import AxisChange, ChangedParameter
from hil.diagnosis.value import Value
from hil.diagnosis.wording import whole_name
from hil.identification.coordinates import DELAY
from hil.identification.dataset import Dataset, in_turn
from hil.identification.estimator import Fit
from hil.identification.inference import standard_errors
from hil.identification.measured import SETTLE_IN_MOTION_S, Measured
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.torque_left import fit_plain
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


def changed(nominal: Fit, held_out: Dataset, moves: bool) -> Change | None:
    """Find parameters of the axis that change between the recordings, or during one; None if none does.

    `nominal` is the fit of one set of parameters to the recordings of training. `moves`: the torque tells a moment of
    change, by which a change below the noise of a row is one.
    """
    runs = (*nominal.data.runs, *held_out.runs)
    whole = fit_nominal_parameters(nominal.data.over(ordered)) if (ordered := in_turn(runs)) else None
    if whole and (moves or whole.excess > 0.0) and (found := _changed_within(whole)):
        return found
    alone = _each(nominal.data, runs)
    if len(runs) > 1 and all(fit.at_floor for fit in alone):
        names = tuple(run.name for run in runs)
        told = AxisChange(recording=None, moment_s=None, parts=names, parameters=_differing(alone))
        if told.parameters:
            return Change(told, runs, tuple(alone), 0.0)
    return next((found for fit in alone if not fit.at_floor and (found := _changed_within(fit))), None)


def _changed_within(whole: Fit) -> Change | None:
    """A change at a moment of a recording, or of its parts, that explains nearly all of a fit's mismatch; else None."""
    runs, first = whole.data.runs, _moment(whole)
    fits = _before_and_after(whole, first)
    if not fits:
        return None
    # the first moment takes the change of the parameters as small
    at = _moment_between(whole, fits)
    fits = fits if at == first else _before_and_after(whole, at)
    if not fits:
        return None
    cut, row = runs[at[0]], at[1]
    left = sum(fit.excess for fit in fits) / whole.excess if whole.excess > 0.0 else 0.0
    found = _differing(fits)
    if left > 1.0 - CRITERIA.change or not found:
        return None
    moment_s = float(cut.time_s[row])
    told = AxisChange(recording=whole_name(cut.name), moment_s=moment_s, parts=("before", "after"), parameters=found)
    return Change(told, runs, tuple(fits), left)


def _before_and_after(whole: Fit, at: tuple[int, int] | None) -> list[Fit]:
    """Fits of the nominal parameters to the rows before and after a row of a run; none without one of both."""
    if at is None:
        return []
    (number, row), runs = at, whole.data.runs
    cut = runs[number]
    settling = round(SETTLE_IN_MOTION_S / cut.period_s)
    before, after = [*runs[:number]], [*runs[number + 1 :]]
    if row > cut.evaluated.indices(cut.motor.size)[0] + settling:
        before.append(cut.until(row))
    if row + 2 * settling < cut.motor.size:
        after.insert(0, replace(cut, lead_in=row + settling))
    return [fit_nominal_parameters(whole.data.over(part)) for part in (before, after)] if before and after else []


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
        if coordinate.name == DELAY and not _late_otherwise(fits[least], fits[most]):
            continue
        if coordinate.name not in stuck and values[most, index] - values[least, index] > sure:
            unit = unit_of(coordinate.name)
            pairs = zip(values[:, index], errors[:, index], strict=True)
            each = tuple(Value(value=float(value), std=float(std), unit=unit) for value, std in pairs)
            told.append(ChangedParameter(name=coordinate.name, values=each))
    return tuple(told)


def _late_otherwise(one: Fit, other: Fit) -> bool:
    """True unless plain least squares tell the same lateness of the torque in both.

    The current of a loop answers the noise of its encoder, which biases the delay that a twin fits, and not the motion
    in windows of some rows.
    """
    plain = [fit_plain(fit.data) for fit in (one, other)]
    late = [(model.early_rows, model.early_error_rows) for model in plain if model]
    if len(late) < len(plain):
        return True
    (first, error), (second, another) = late
    return abs(first - second) > CRITERIA.sigmas * float(np.hypot(error, another))


def _moment(whole: Fit) -> tuple[int, int] | None:
    """Run and row at which the parameters of a fit change most likely; None in recordings that are too short.

    Two changes of the parameters, one for the rows before it and one for those after it, leave the smallest residuals
    there. Residuals are taken as linear in these changes.
    """
    products, rows = _by_blocks(whole, np.column_stack([whole.jacobian, whole.residuals.vector]))
    cuts = _cuts(rows)
    if not cuts or not whole.jacobian.shape[1]:
        return None
    normal = np.cumsum(products, axis=0)
    return rows[min(cuts, key=lambda cut: _left(normal[cut]) + _left(normal[-1] - normal[cut]))]


def _moment_between(whole: Fit, fits: Sequence[Fit]) -> tuple[int, int]:
    """Run and row before which the first of two fits, and from which the second, leaves least of all runs."""
    parts = [replace(fit.estimator, data=whole.data).evaluate(fit.hypothesis).residuals.vector for fit in fits]
    products, rows = _by_blocks(whole, np.column_stack(parts))
    before, after = (np.cumsum([one[at, at] for one in products]) for at in (0, 1))
    return rows[min(_cuts(rows), key=lambda cut: before[cut] - after[cut])]


def _by_blocks(fit: Fit, columns: FloatArray) -> tuple[list[FloatArray], list[tuple[int, int]]]:
    """Products (k, k) of columns (m, k) beside the residuals of a fit, by blocks of time; run and last row of each."""
    split, products, rows = fit.residuals.split(columns), list[FloatArray](), list[tuple[int, int]]()
    for number, run in enumerate(fit.data.runs):
        own = [part for (of, _), part in zip(fit.residuals.parts, split, strict=True) if of == number]
        block = max(round(_BLOCK_S / run.period_s), 1)
        count = own[0].shape[0] // block
        table = np.concatenate([part[: count * block].reshape(count, block, -1) for part in own], axis=1)
        products += list(np.einsum("bij,bik->bjk", table, table))
        first = run.evaluated.indices(run.motor.size)[0]
        rows += [(number, min(first + (one + 1) * block, run.motor.size - 1)) for one in range(count)]
    return products, rows


def _cuts(rows: Sequence[tuple[int, int]]) -> range:
    margin = max(round(_SHORTEST * len(rows)), 1)
    return range(margin, len(rows) - margin)


def _left(normal: FloatArray) -> float:
    """Energy of the last column that the others leave, from the products (k, k) of all."""
    solved = np.linalg.pinv(normal[:-1, :-1], hermitian=True) @ normal[:-1, -1]
    return float(normal[-1, -1] - normal[:-1, -1] @ solved)
