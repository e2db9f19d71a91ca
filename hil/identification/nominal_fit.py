"""Fit of the nominal parameters of an axis: closed-loop output error (Ljung, System Identification, 1999, ch. 7).

    min over p of  sum |measured - twin(p)|^2 / noise^2     over torque, motor position, table against motor

The twin runs in closed loop from the set-points alone, so that friction and stick are where they are in the
measured run. Parameters are logarithms of their ratio to the nominal value: they stay positive.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.errors import HilError
from hil.identification.dataset import Measured
from hil.identification.residuals import differences

# What the twin is trusted to at best [m]: its own step, and counts that beat with the motion.
MOTOR_ACCURACY_M = 0.1e-6
TABLE_ACCURACY_M = 0.15e-6
FACTOR_LIMIT = 20.0  # parameters are sought within this factor of the nominal value
MOST_STEPS = 50
_NOT_FINITE = 1e6  # stands for a response that is none
_DIFFERENCE = 1e-4  # of the logarithms: above the twin's own rounding, below any curvature


@dataclass(frozen=True)
class FittedParameter:
    """A parameter of the axis, SI unit in its name; `standard_error` holds if what is left is white."""

    name: str
    nominal: float
    value: float
    standard_error: float


@dataclass(frozen=True)
class FitResult:
    """The bench with fitted parameters, and how many times the twin was run for it.

    converged: False where the search was ended while the parameters still crept: these are the best so far.
    """

    bench: Bench
    parameters: tuple[FittedParameter, ...]
    simulations: int
    converged: bool = True


def fit_nominal(
    bench: Bench, recordings: Sequence[Measured], progress: Callable[[float], None] = lambda _: None
) -> FitResult:
    """Fit `bench.axis.NOMINAL` to recordings; a parameter that is nominally 0 stays 0.

    `progress` is told the rms of the weighted residuals after each simulation.
    A twin that leaves something out may creep along a valley for long; then the result says `converged` False.
    Raises HilError where no parameters give a finite response.
    """
    names = tuple(name for name in bench.axis.NOMINAL if getattr(bench.axis, name) > 0.0)
    nominal = np.array([getattr(bench.axis, name) for name in names])

    def bench_of(x: FloatArray) -> Bench:
        values = dict(zip(names, (nominal * np.exp(x)).tolist(), strict=True))
        return bench.model_copy(update={"axis": bench.axis.model_copy(update=values)})

    def residuals(x: FloatArray) -> FloatArray:
        candidate = bench_of(x)
        found = np.concatenate([weighted_residuals(candidate, measured) for measured in recordings])
        progress(float(np.sqrt(np.mean(found**2))))
        return np.asarray(np.nan_to_num(found, nan=_NOT_FINITE, posinf=_NOT_FINITE, neginf=-_NOT_FINITE))

    def jacobian(x: FloatArray) -> FloatArray:
        base = residuals(x)
        steps = _DIFFERENCE * np.eye(x.size)
        with ThreadPoolExecutor(os.cpu_count()) as pool:  # the twin's kernel releases the interpreter
            columns = list(pool.map(lambda step: (residuals(x + step) - base) / _DIFFERENCE, steps))
        return np.stack(columns, axis=1)

    limit = np.full(nominal.size, np.log(FACTOR_LIMIT))
    upper = np.where([name == "damping_ratio" for name in names], np.minimum(limit, np.log(0.99 / nominal)), limit)
    upper -= 2.0 * _DIFFERENCE  # room for the difference
    found = least_squares(
        residuals,
        np.zeros(nominal.size),
        jacobian,
        bounds=(-limit, upper),
        x_scale="jac",
        ftol=1e-6,
        xtol=1e-6,
        max_nfev=MOST_STEPS,
    )
    if np.abs(found.fun).max() >= _NOT_FINITE:
        raise HilError(
            f"the fit of {', '.join(names)} has no finite result; check units and signs of the "
            "recording, or give one with more motion"
        )
    variance = float(found.fun @ found.fun) / max(found.fun.size - nominal.size, 1)
    errors = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)) * variance) * nominal * np.exp(found.x)
    parameters = tuple(
        FittedParameter(name, float(start), float(value), float(error))
        for name, start, value, error in zip(names, nominal, nominal * np.exp(found.x), errors, strict=True)
    )
    return FitResult(
        bench_of(found.x), parameters, int(found.nfev + found.njev * (nominal.size + 1)), bool(found.success)
    )


def weighted_residuals(bench: Bench, measured: Measured) -> FloatArray:
    """Measured less twin of all channels over their noise, one after the other."""
    ratio, rows, noise = bench.axis.ratio_m_rad, measured.judged, measured.noise
    response = bench.twin().simulate(
        measured.position_command_m, measured.velocity_command_m_s, measured.start, measured.table_m
    )
    found = differences(measured.response, response, bench, rows)
    noise_of = {
        "torque": noise.torque,
        "motor": max(noise.motor, MOTOR_ACCURACY_M / ratio),
        "table": max(noise.table_m, TABLE_ACCURACY_M),
    }
    return np.concatenate([values[rows] / noise_of[name] for name, values in found.items()])
