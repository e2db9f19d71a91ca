"""Channels that follow from others: rest and motion told from measured positions."""

from __future__ import annotations

import numpy as np
from diagnosis_runs import SEGMENTS, bench, changed, recorded

from hil.bench.control_section import UnknownControl
from hil.identification.derived_channels import completed

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})
SET_POINTS = {"position_command_m": None, "velocity_command_m_s": None}


def test_the_measured_motion_tells_rest_from_motion() -> None:
    recording = recorded(KNOWN, times=4)
    found = completed(changed(recording, **SET_POINTS), OWNER)
    still = recording["velocity_command_m_s"] == 0.0
    assert np.mean(found["velocity_command_m_s"][still] == 0.0) > 0.8
    assert np.mean(found["velocity_command_m_s"][~still] != 0.0) > 0.95
    assert completed(recording, KNOWN) is recording
    assert SEGMENTS[0]["kind"] == "dwell"
    assert np.all(found["velocity_command_m_s"][:100] == 0.0)
