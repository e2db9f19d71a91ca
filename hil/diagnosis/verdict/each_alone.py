"""Recordings that the twin explains one by one, with other parameters for each: the axis changed between them."""

import numpy as np

from hil.identification.estimator import Fit
from hil.identification.inference import standard_errors
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.quantities import quantity, unit_of

_SURE = 3.0  # standard errors from which two values differ


def changed_between(nominal: Fit) -> str:
    """Parameters that differ between recordings which the twin reproduces alone; empty if it does not, or if none does.

    `nominal` is the fit of one set of parameters to all of them.
    """
    runs = nominal.data.runs
    if len(runs) < 2:
        return ""
    fits = []
    for run in runs:
        fits.append(fit_nominal_parameters(nominal.data.over([run])))
        if not fits[-1].at_floor:
            return ""
    values = np.array([fit.hypothesis.values for fit in fits])
    errors = np.array([standard_errors(fit)[: values.shape[1]] for fit in fits])
    told = []
    for index, coordinate in enumerate(nominal.hypothesis.coordinates):
        least, most = int(np.argmin(values[:, index])), int(np.argmax(values[:, index]))
        if values[most, index] - values[least, index] > _SURE * float(np.hypot(*errors[[least, most], index])):
            unit = unit_of(coordinate.name)
            each = (f"{quantity(value, unit)} in {run.name}" for value, run in zip(values[:, index], runs, strict=True))
            told.append(f"{coordinate.name} {', '.join(each)}")
    if not told:
        return ""
    return (
        "Each recording alone is explained without missing physics, with parameters of its own: the axis changed "
        f"between them. {'; '.join(told)}."
    )
