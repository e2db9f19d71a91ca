"""Gains of the control law, learnt from set-points and commands, as a whole and loop by loop."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, recorded
from servo_loop import one_encoder, servo_run

from hil.bench.bench_file import Bench
from hil.identification.law.fit import fit_law
from hil.identification.measured import take

OWNER = one_encoder(bench())
LAW = OWNER.known_control
POSITION_GAIN, FEEDFORWARD, VELOCITY_GAIN, INTEGRAL_TIME = LAW.gain_names
WRONG = {POSITION_GAIN: 0.4, FEEDFORWARD: 1.7, VELOCITY_GAIN: 2.5, INTEGRAL_TIME: 0.5}


def believed(**factors: float) -> Bench:
    values = {name: factor * getattr(LAW, name) for name, factor in factors.items()}
    return OWNER.model_copy(update={"control": LAW.model_copy(update=values)})


@pytest.mark.parametrize("scale", [1.0, 57.3, 0.1])
def test_each_loop_is_learnt_from_a_speed_set_point_of_unknown_scale(scale: float) -> None:
    owner = believed(**WRONG)
    found = fit_law([take(servo_run(OWNER, scale=scale), owner)], owner, by_loop=True)
    assert found.settings.scale == pytest.approx(scale, rel=1e-4)
    learnt = owner.known_control.with_gains(found.gains)
    for name in LAW.gain_names:
        assert getattr(learnt, name) == pytest.approx(getattr(LAW, name), rel=1e-4)


def test_gains_are_learnt_from_any_start() -> None:
    """The recording is one of the twin, whose law is `hil.control.cascade`; commands have the noise of rounding."""
    truth = bench()
    owner = believed(**WRONG)
    owner = truth.model_copy(update={"control": owner.control})
    found = fit_law([take(recorded(truth, times=4), owner)], owner)
    assert found.ratio < 1.0
    learnt = owner.known_control.with_gains(found.gains)
    for name in LAW.gain_names:
        assert getattr(learnt, name) == pytest.approx(getattr(LAW, name), rel=2e-3)
