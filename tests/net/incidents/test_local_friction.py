"""Friction that is higher or lower in a zone of the travel: found on a simulated axis with two encoders and one."""

from __future__ import annotations

import pytest
from concealed_run import concealed_run
from diagnosis_runs import bench

import hil
from hil.bench.bench_file import Bench
from hil.recording.recording import Recording
from hil.twin.library import BY_ID

pytestmark = pytest.mark.net

MECHANISM = BY_ID["local_friction"]
ZONE = {"begin_m": 0.22, "end_m": 0.30, "flank_m": 0.004}


def recorded(owner: Bench, fraction: float) -> Recording:
    """A recording of the simulated axis with a zone of other friction, at two feeds."""
    return concealed_run(owner, {MECHANISM.id: {"fraction": fraction, **ZONE}})


def single() -> Bench:
    """The bench with the encoder of the motor alone."""
    owner = bench()
    return owner.model_copy(update={"encoders": owner.encoders.model_copy(update={"table": None})})


FALSE_PLAY = pytest.mark.xfail(
    strict=True, reason="some 0.2 um of lost motion that is not there is named beside the zone"
)


@pytest.mark.parametrize(
    ("owner", "fraction"),
    [
        pytest.param(bench(), 0.5, id="two encoders", marks=FALSE_PLAY),
        pytest.param(single(), -0.4, id="one encoder"),
    ],
)
def test_a_zone_of_other_friction_is_the_only_finding(owner: Bench, fraction: float) -> None:
    result = hil.diagnose(recorded(owner, fraction), owner).result
    (finding,) = result.missing
    assert finding.effect == MECHANISM.id
    assert finding.parameters["fraction"].value == pytest.approx(fraction, rel=0.1)
    for name in ("begin_m", "end_m"):
        assert finding.parameters[name].value == pytest.approx(ZONE[name], abs=3e-3)
    assert ("lower" if fraction < 0.0 else "higher") in result.statement
