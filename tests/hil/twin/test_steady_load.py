"""Torque of steady motion where friction grows with the load, against its law."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench

from hil.bench.bench_file import MechanismEntry
from hil.identification.hypothesis import Hypothesis
from hil.twin.steady_motion import needed_torque


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("load_n_m", [-3.0, 0.4, 3.0])
@pytest.mark.parametrize("speed_m_s", [-0.02, 0.05])
def test_friction_of_a_load_that_drives_or_is_driven(share: float, load_n_m: float, speed_m_s: float) -> None:
    """T = L + s (Fc + mu |L|) + c v: the weight is carried."""
    effects = {"constant_load": {"load_torque_n_m": load_n_m}, "load_dependent_friction": {"share": share}}
    entries = tuple(MechanismEntry(effect=name, parameters=values) for name, values in effects.items())
    owner = bench().model_copy(update={"mechanisms": entries})
    physics, ratio = owner.axis.physics(), owner.axis.ratio_m_rad
    found = needed_torque(Hypothesis(owner).twin(), np.array([0.0, 0.03]), speed_m_s)
    friction = np.sign(speed_m_s) * (physics.coulomb_n_m + share * abs(load_n_m))
    expected = load_n_m + friction + physics.viscous_n_m_s_rad * speed_m_s / ratio
    np.testing.assert_allclose(found, expected, rtol=1e-7)
