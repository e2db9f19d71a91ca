"""The intended motion holds what the set-points make, and not what pushes the axis or reads it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.prepare import prepare
from hil.identification.derivatives import motion
from hil.identification.intended_motion import intended
from hil.identification.measured import Measured

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})
ROWS, PERIOD_S, INERTIA, GAIN, DAMPING = 20_000, 1e-3, 0.01, 40.0, 1.0  # of a loop of 10 Hz


def prepared() -> Measured:
    return prepare([changed(recorded(KNOWN), torque_command_n_m=None)], [], OWNER).train.runs[0]


def loop(command: FloatArray, push: FloatArray) -> FloatArray:
    """Positions (n,) of an inertia that a loop holds on a command (n,), pushed by a torque (n,)."""
    place, speed, found = float(command[0]), 0.0, np.empty(ROWS)
    for row in range(ROWS):
        found[row] = place
        speed += PERIOD_S / INERTIA * (GAIN * (command[row] - place) - DAMPING * speed + push[row])
        place += PERIOD_S * speed
    return found


def axis(push: FloatArray, set_points: bool) -> tuple[Measured, FloatArray]:
    """A run of this axis whose motor is pushed, with its set-points or without, and the motion without the push."""
    time_s = np.arange(ROWS) * PERIOD_S
    command = 3.0 * np.sin(2.0 * np.pi * 0.25 * time_s) + np.sin(2.0 * np.pi * 0.6 * time_s)
    motor, calm = loop(command, push), loop(command, np.zeros(ROWS))
    known = command if set_points else motor
    run = replace(
        prepared(), period_s=PERIOD_S, motor=motor, position_command_m=known,
        velocity_command_m_s=np.gradient(known, PERIOD_S), torque=np.zeros(ROWS), torque_command=np.zeros(ROWS),
        lead_in=0,
    )  # fmt: skip
    return replace(run, noise=replace(run.noise, motor=1e-5)), calm


def fluctuating() -> FloatArray:
    white = np.random.default_rng(2).standard_normal(ROWS)
    return np.asarray(lfilter([0.004], [1.0, -0.97], white), dtype=np.float64)


@pytest.mark.parametrize(("set_points", "share"), [(True, 0.02), (False, 0.25)])
def test_what_pushes_the_axis_is_not_in_it(set_points: bool, share: float) -> None:
    run, calm = axis(fluctuating(), set_points)
    inner = slice(1000, -1000)
    true, measured, found = (
        motion(one, PERIOD_S).acceleration[inner] for one in (calm, run.motor, intended(run).motor)
    )
    pushed = float(np.var(measured - true))
    assert pushed > 0.001 * np.var(true)
    assert np.var(found - true) < share * pushed


def test_a_motion_without_set_points_keeps_its_acceleration() -> None:
    run, calm = axis(np.zeros(ROWS), set_points=False)
    inner = slice(1000, -1000)
    true, found = (motion(one, PERIOD_S).acceleration[inner] for one in (calm, intended(run).motor))
    assert np.var(found - true) < 0.01 * np.var(true)


def test_set_points_coarser_than_the_encoder_make_no_motion() -> None:
    run, _ = axis(fluctuating(), set_points=True)
    coarse = replace(run, position_command_m=np.round(run.position_command_m, 2))
    alone = replace(run, position_command_m=run.motor)
    np.testing.assert_array_equal(intended(coarse).motor, intended(alone).motor)
