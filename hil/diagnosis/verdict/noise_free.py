"""Gain of a term on motion that is free of sensor noise.

Residuals also decrease where a term lets the twin pass less of the noise of its measured inputs: at constant feed the
counts of an encoder are a regular pattern, which a flexible mode can filter. Such a term has hardly any effect on
motion without noise. That motion is the closed-loop response y of the twin:

    gain = |r_without(y) - r_with(y)|^2 / (cost_without - cost_with)

It is 1 for an effect of the axis, since the residuals that a fit leaves are orthogonal to the effect.
"""

from dataclasses import replace

import numpy as np

from hil.identification.estimator import Fit

LEAST = 0.5  # half of the gain; measured: 0.8 to 1.0 for effects that are there, 0.02 to 0.24 for filters of counts


def gain_without_noise(found: Fit, without: Fit) -> float | None:
    """The gain of the equation; None if nothing is gained, or if the response in closed loop is not known or stable."""
    gained = without.cost - found.cost
    if gained <= 0.0 or not found.bench.law_known or any(run.sampled for run in found.data.runs):
        return None
    changed = 0.0
    for run, scales in zip(found.data.runs, found.data.scales(), strict=True):
        response = found.hypothesis.respond(run)
        table_m = response.table_position_m if run.table_m.size else run.table_m
        if not all(np.isfinite(part).all() for part in response):
            return None
        smooth = replace(
            run,
            motor=response.motor_position,
            table_m=table_m,
            torque_command=response.torque_command,
            torque=response.torque,
        )
        own, other = (fit.hypothesis.blocks(smooth, found.data.observer_s) for fit in (found, without))
        for name, values in own.items():
            change = ((other[name] - values) / scales[name])[run.judged]
            changed += float(change @ change)
    return changed / gained if np.isfinite(changed) else None
