"""Delays of the loop and of the set-points never become physics."""

from __future__ import annotations

from functools import cache

import pytest
from diagnosis_runs import bench
from servo_loop import one_encoder, servo_run

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnose import diagnose
from hil.recording.recording import Recording

pytestmark = pytest.mark.net

OWNER = one_encoder(bench())
LAW = OWNER.known_control
POSITION_GAIN, FEEDFORWARD, VELOCITY_GAIN, INTEGRAL_TIME = LAW.gain_names
WRONG = {POSITION_GAIN: 0.4, FEEDFORWARD: 1.7, VELOCITY_GAIN: 2.5, INTEGRAL_TIME: 0.5}


@cache
def run(old_rows: float = 0.0, late_rows: int = 0, scale: float = 1.0, times: int = 1) -> Recording:
    return servo_run(OWNER, old_rows, late_rows, scale, times)


def believed(**factors: float) -> Bench:
    values = {name: factor * getattr(LAW, name) for name, factor in factors.items()}
    return OWNER.model_copy(update={"control": LAW.model_copy(update=values)})


@pytest.mark.parametrize("owner", [OWNER, believed(**WRONG)], ids=["right gains", "wrong gains"])
@pytest.mark.parametrize("delays", [(1.0, 0), (0.0, 7)], ids=["loop", "set-points"])
def test_delays_of_the_loop_never_become_physics(delays: tuple[float, int], owner: Bench) -> None:
    result = diagnose([run(*delays, times=4)], [], owner).result
    assert not result.missing
    assert result.verdict == "parameter_error"
    assert result.statement.startswith("Check the controller's settings")
