"""Viscous friction on the table: told from a late channel where the motion can, listed beside it where it cannot."""

from __future__ import annotations

import pytest
from concealed_run import Effects, concealed_run
from diagnosis_runs import bench

import hil
from hil.diagnosis.result import Result

pytestmark = pytest.mark.net

OWNER = bench()
SHARES = {"table_side_friction", "table_side_viscous_friction"}
SKEW = "channel_time_skew"


def diagnosed(effects: Effects) -> Result:
    """Diagnose a recording of the simulated axis with effects, at two feeds."""
    return hil.diagnose(concealed_run(OWNER, effects, far_m=0.3, feeds=(0.25, 0.08), times=1), OWNER).result


def test_shares_of_coulomb_and_viscous_friction_are_told() -> None:
    effects = {"table_side_friction": {"share": 0.3}, "table_side_viscous_friction": {"share": 0.6}}
    found = {finding.effect: finding for finding in diagnosed(effects).missing}
    assert set(found) <= SHARES | {SKEW}
    assert "table_side_friction" in found
    other = found.get(SKEW) or found["table_side_viscous_friction"]
    assert "table_side_viscous_friction" in (other.effect, *other.equivalents)


@pytest.mark.parametrize("delay_s", [3e-6, 300e-6])
def test_a_late_channel_keeps_its_name(delay_s: float) -> None:
    (found,) = diagnosed({SKEW: {"delay_s": delay_s}}).missing
    assert SKEW in (found.effect, *found.equivalents)
    if delay_s > 100e-6:
        assert found.effect == SKEW
        assert not SHARES & set(found.equivalents)
