"""An elastic stop at an end of the travel: found on simulated axes, with two encoders and one, at either end."""

from __future__ import annotations

import pytest
from concealed_run import concealed_run
from diagnosis_runs import bench, moves, recorded

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.identification.terms import Term
from hil.twin.library import BY_ID

pytestmark = pytest.mark.net

MECHANISM = BY_ID["end_stop"]
UPPER, LOWER = 0, 1
CONTROL = {
    "position_gain_1_s": 20.0,
    "velocity_gain_n_m_s_rad": 0.3,
    "velocity_integral_time_s": 0.02,
    "velocity_feedforward": 1.0,
}


def single(owner: Bench) -> Bench:
    """A bench with the encoder of the motor alone."""
    return owner.model_copy(update={"encoders": owner.encoders.model_copy(update={"table": None})})


@pytest.mark.parametrize(
    ("owner", "variant", "stiffness_n_m", "edge_m"),
    [
        pytest.param(bench(), UPPER, 2e4, 0.37, id="two encoders, upper"),
        pytest.param(bench(coulomb_torque_n_m=0.8), LOWER, 3e5, 0.004, id="wrong friction, lower"),
        pytest.param(single(bench()), LOWER, 5e3, 0.08, id="one encoder, lower"),
        pytest.param(single(bench()), UPPER, 1e6, 0.399, id="one encoder, stiff"),
    ],
)
def test_a_stop_is_the_only_finding(owner: Bench, variant: int, stiffness_n_m: float, edge_m: float) -> None:
    side = MECHANISM.forms[variant]
    true = owner.model_copy(update={"axis": bench().axis})
    recording = concealed_run(true, {MECHANISM.id: {"stiffness_n_m": stiffness_n_m, "edge_m": edge_m}}, form=side)
    result = hil.diagnose(recording, owner).result
    (finding,) = result.missing
    assert (finding.effect, finding.variant) == (MECHANISM.id, side)
    assert finding.parameters["stiffness_n_m"].value == pytest.approx(stiffness_n_m, rel=0.01)
    assert finding.parameters["edge_m"].value == pytest.approx(edge_m, abs=1e-4)
    assert side in result.statement


def test_a_stop_of_a_load_that_turns_is_told_in_radians() -> None:
    owner = Bench.model_validate(load_bench("rotary").model_dump(mode="json") | {"control": CONTROL})
    recording = concealed_run(
        owner, {MECHANISM.id: {"stiffness_n_m": 0.4, "edge_m": 5.5}}, far_m=6.0, feeds=(2.0, 1.0), form="upper end"
    )
    result = hil.diagnose(recording, owner).result
    (finding,) = result.missing
    assert finding.effect == MECHANISM.id
    assert finding.parameters["stiffness_n_m"].value == pytest.approx(0.4, rel=0.01)
    assert finding.parameters["stiffness_n_m"].unit == "N m/rad"
    assert finding.parameters["edge_m"].value == pytest.approx(5.5, abs=0.01)
    assert "pushes the load back" in result.statement


def test_stops_at_both_ends_are_both_found() -> None:
    leg = {"kind": "sine_squared", "feed_m_s": 0.15}
    profile = moves([{"kind": "dwell", "duration_s": 0.2}, leg | {"to_m": 0.4}, leg | {"to_m": 0.0}], 2)
    stops = Term(MECHANISM.id, UPPER, (5e4, 0.385)), Term(MECHANISM.id, LOWER, (8e3, 0.05), 1)
    owner = single(bench())
    result = hil.diagnose(recorded(owner, *stops, profile=profile), owner).result
    found = {finding.variant: finding.parameters for finding in result.missing}
    assert [finding.effect for finding in result.missing] == [MECHANISM.id] * 2
    for stop in stops:
        for name, true in zip(MECHANISM.names, stop.values, strict=True):
            assert found[MECHANISM.forms[stop.variant]][name].value == pytest.approx(true, rel=0.02)
