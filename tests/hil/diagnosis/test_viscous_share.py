"""Viscous friction on the table: told from a late channel where the motion can, listed beside it where it cannot."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench

import hil
from hil.bench.bench_file import Bench
from hil.diagnosis.result import Result
from hil.motion.profile import Profile
from hil.motion.trajectory import plan

OWNER = bench()
SHARES = {"table_side_friction", "table_side_viscous_friction"}
SKEW = "channel_time_skew"


def diagnosed(*effects: tuple[str, dict[str, float]]) -> Result:
    """Diagnose a recording of the simulated axis with effects, at two feeds."""
    simulation = {"effects": [{"effect": effect, "parameters": parameters} for effect, parameters in effects]}
    data = OWNER.model_dump(mode="json") | {"simulation": simulation, "drive": {"following_error_m": 0.05}}
    truth = Bench.model_validate(data)
    legs = [
        {"kind": "dwell", "duration_s": 0.2},
        *({"kind": "sine_squared", "to_m": to_m, "feed_m_s": feed} for to_m, feed in ((0.3, 0.25), (0.0, 0.08))),
    ]
    profile = Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": 0.3, "acceleration_m_s2": 3.0, "jerk_m_s3": 100.0},
            "segments": legs,
        }
    )
    return hil.diagnose(hil.simulate(truth, plan(profile, truth.period_s), seed=3), OWNER).result


def test_shares_of_coulomb_and_viscous_friction_are_told() -> None:
    coulomb, viscous = ("table_side_friction", {"share": 0.3}), ("table_side_viscous_friction", {"share": 0.6})
    found = {finding.effect: finding for finding in diagnosed(coulomb, viscous).missing}
    assert set(found) <= SHARES | {SKEW}
    assert "table_side_friction" in found
    other = found.get(SKEW) or found["table_side_viscous_friction"]
    assert "table_side_viscous_friction" in (other.effect, *other.equivalents)


@pytest.mark.parametrize("delay_s", [3e-6, pytest.param(300e-6, marks=pytest.mark.long)])
def test_a_late_channel_keeps_its_name(delay_s: float) -> None:
    (found,) = diagnosed((SKEW, {"delay_s": delay_s})).missing
    assert SKEW in (found.effect, *found.equivalents)
    if delay_s > 100e-6:
        assert found.effect == SKEW
        assert not SHARES & set(found.equivalents)
