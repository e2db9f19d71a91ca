"""Effects that repeat with the screw, on a motion in one direction, are reported as a set."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, one_way

from hil.diagnosis.diagnose import diagnose
from hil.identification.terms import Term

pytestmark = pytest.mark.net

OWNER = bench()
LEAD_M = OWNER.axis.lead_m


def test_friction_along_the_screw_is_not_named_alone_where_it_goes_one_way() -> None:
    truth = Term("position_dependent_friction", 0, (0.15, LEAD_M / 4.0, 0.7))
    *train, held_out = (one_way(OWNER, truth, feed, seed) for seed, feed in enumerate((0.02, 0.025, 0.03), 1))
    found = diagnose(train, [held_out], OWNER)
    (named,) = found.result.missing
    assert {named.effect, *named.equivalents} >= {"cogging_torque", "position_dependent_friction"}
