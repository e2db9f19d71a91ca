"""Noise apart: the energy of the reference's residual stays, and no inertia gains by answering less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.prepare import prepare
from hil.identification.estimator import Fit
from hil.identification.noise_apart import noise_apart
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.residual_scales import inertia
from hil.identification.torque_left import fit_plain

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})


def measured() -> Fit:
    """A twin fitted to an axis whose torque was measured with much noise."""
    recording = changed(recorded(KNOWN, times=2, torque_noise_n_m=0.3), torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    return fit_nominal_parameters(prepare([recording], [], OWNER).train)


def test_no_inertia_gains_by_answering_less() -> None:
    fit = measured()
    plain = fit_plain(fit.data)
    assert plain is not None
    given = fit.hypothesis.given
    data = noise_apart(fit.data, given, plain)
    (before,), (after,) = given.residuals(fit.data).channels, given.residuals(data).channels
    assert np.mean(after["motor"] ** 2) == pytest.approx(np.mean(before["motor"] ** 2), rel=1e-6)
    for name in set(before) - {"motor"}:
        np.testing.assert_allclose(after[name], before[name], atol=1e-15)
    apart = replace(fit.estimator, data=data).fit(given)
    true = inertia(KNOWN)
    assert inertia(apart.bench) == pytest.approx(true, rel=0.02)
    assert abs(inertia(apart.bench) - true) < abs(inertia(fit.bench) - true)
