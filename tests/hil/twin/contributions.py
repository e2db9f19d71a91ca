"""Calls a mechanism's contribution as the stepping kernel does; moments to call it at."""

import numpy as np
from hypothesis import strategies as st

from hil.twin.library import BY_ID
from hil.twin.mechanism import PARAMETERS, WIDTH, Moment

PERIOD_S = 1e-3
RATIO_M = 0.010 / (2.0 * np.pi)
AT_REST = Moment(0.0, 0.0, PERIOD_S, PERIOD_S / 10, 0.0, 0.0, 0.0, RATIO_M, viscous_speed=160.0)

phases = st.floats(-2.0 * np.pi, 2.0 * np.pi)
REVOLUTION = np.arange(144) * 2.0 * np.pi / 144  # even steps over one revolution
moments = st.builds(
    Moment,
    time_s=st.floats(0.0, 1e4),
    within_s=st.sampled_from([0.0, 0.1 * PERIOD_S, 0.5 * PERIOD_S]),
    period_s=st.just(PERIOD_S),
    step_s=st.sampled_from([PERIOD_S, 0.1 * PERIOD_S, 0.02 * PERIOD_S]),
    angle_rad=st.floats(-1e4, 1e4),
    velocity=st.floats(-500.0, 500.0),
    table_position_m=st.floats(-2.0, 2.0),
    ratio_m=st.sampled_from([RATIO_M, 1.0]),
    viscous_speed=st.sampled_from([0.0, 0.05, 160.0]),
    torque=st.floats(-20.0, 20.0),
)


def row(parameters):
    """The row of parameters that the kernel hands to a contribution: its own, then zeros."""
    values = np.zeros(PARAMETERS)
    values[: len(parameters)] = parameters
    return values


def call(effect, value, at=AT_REST, *, variant=0, **parameters):
    """One call without a past."""
    mechanism = BY_ID[effect]
    assert set(parameters) == set(mechanism.names)
    values = row([float(parameters[name]) for name in mechanism.names])
    return mechanism.variants[variant].contribution(float(value), at, values, np.zeros(WIDTH))


def per_tick(effect, commands, steps, parameters, variant=0):
    """Mean answer in each control period to commands held over it, by a number of internal steps."""
    values, memory = row(parameters), np.zeros(WIDTH)
    step_s = PERIOD_S / steps
    means = np.zeros(len(commands))
    for tick, command in enumerate(commands):
        for j in range(steps):
            at = AT_REST._replace(time_s=tick * PERIOD_S + j * step_s, within_s=j * step_s, step_s=step_s)
            means[tick] += BY_ID[effect].variants[variant].contribution(float(command), at, values, memory) / steps
    return means


def along(effect, value, *, variant=0, angles=REVOLUTION, **parameters):
    """Return the contribution at each angle, shape of `angles`."""
    return np.array(
        [call(effect, value, AT_REST._replace(angle_rad=angle), variant=variant, **parameters) for angle in angles]
    )
