"""Energy that a term removes on motion that is free of sensor noise.

Residuals also decrease where a term lets the twin pass less of the noise of its measured inputs: at constant feed the
counts of an encoder are a regular pattern, which a flexible mode can filter. Such a term has hardly any effect on
motion without noise. That motion is the closed-loop response y of the twin, and the energy is

    |r_without(y) - r_with(y)|^2

For an effect of the axis it is near that in the recordings, since the residuals that a fit leaves are orthogonal to the
effect. The input of controller and drive is the recorded command, which is exact: what they do with it counts as
recorded.
"""

from dataclasses import replace

import numpy as np

from hil.identification.estimator import Fit


def energy_without_noise(found: Fit, without: Fit) -> float | None:
    """The energy of the equation in units of noise^2; None if the response in closed loop is not known or stable."""
    if not found.data.observability.closed_loop:
        return None
    removed = 0.0
    for index, (run, scales) in enumerate(zip(found.data.runs, found.data.scales(), strict=True)):
        response = found.hypothesis.respond(run)
        if not all(np.isfinite(part).all() for part in response):
            return None
        smooth = replace(
            run,
            motor=response.motor_position,
            table_m=response.table_position_m if run.table_m.size else run.table_m,
            torque_command=response.torque_command,
            torque=response.torque,
        )
        own, other = (
            fit.hypothesis.blocks(smooth, found.data.observer_s, found.data.steps)
            | {name: fit.residuals.channels[index][name] for name in ("torque", "command")}
            for fit in (found, without)
        )
        for name, values in own.items():
            with np.errstate(over="ignore", invalid="ignore"):  # without the term a twin may be unstable
                change = ((other[name] - values) / scales[name])[run.evaluated]
                removed += float(change @ change)
    return removed if np.isfinite(removed) else None
