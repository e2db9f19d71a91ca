"""The torque that moves a motor beyond its twin: sign and size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.prepare import prepare
from hil.identification.estimator import Estimator
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import measured_motion
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain, lacking_torque

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})


def test_a_load_is_told_with_its_sign_and_size_and_a_ripple_is_there() -> None:
    load, ripple = Term("constant_load", 0, (0.2,)), Term("cogging_torque", 0, (0.1, 3.0, 0.4))
    recording = changed(recorded(KNOWN, load, ripple, times=2), torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    data = Estimator(prepare([recording], [], OWNER).train).data
    (torque,), (run,), plain = lacking_torque(Hypothesis(data.bench), data), data.runs, fit_plain(data)
    assert plain is not None
    rows = measured_motion(run).sliding(plain.slowest)
    angle = 3.0 * run.motor + 0.4
    columns = np.column_stack([np.ones(torque.size), np.sin(angle), np.cos(angle)])[rows]
    one, sine, cosine = np.linalg.lstsq(columns, torque[rows], rcond=None)[0]
    assert one == pytest.approx(-0.2, rel=0.05)
    # smoothing takes off what the motor follows of the ripple
    assert 0.05 < np.hypot(sine, cosine) < 0.12
