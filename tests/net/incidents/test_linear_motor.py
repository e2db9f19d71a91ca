"""A linear motor that cogs, without a known lead or control law, moved slowly first."""

from __future__ import annotations

import pytest
from linear_stage import BENCH, COGGING_N, PITCH_M, moved

from hil.diagnosis.diagnose import diagnose
from hil.recording.recording import Recording

pytestmark = pytest.mark.net


@pytest.fixture(scope="module")
def slow_first() -> Recording:
    return moved([(0.15, 0.06), (0.15, 0.3), (0.15, 0.6)])


def test_cogging_is_told_along_the_travel(slow_first: Recording) -> None:
    found = diagnose([slow_first], [], BENCH).result
    cogging = next(finding for finding in found.findings if finding.effect == "cogging_torque")
    assert cogging.parameters["cycles_per_rev"].unit == "1/m"
    assert 1.0 / cogging.parameters["cycles_per_rev"].value == pytest.approx(PITCH_M, rel=2e-3)
    assert cogging.parameters["amplitude_n_m"].value == pytest.approx(COGGING_N, rel=0.05)
    assert "every 24.0 mm of travel" in cogging.sentence
    assert found.torque_left is not None
    assert found.torque_left.final < 0.3 * found.torque_left.plain
