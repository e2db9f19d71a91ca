"""The refit of the nominal parameters is not drawn away by an effect that it lacks."""

from __future__ import annotations

import pytest
from linear_stage import BENCH, moved

from hil.diagnosis.preparation.preflight import preflight
from hil.identification.dataset import prepare_dataset
from hil.identification.derived_channels import reduced
from hil.identification.nominal_fit import fit_nominal_parameters


def test_a_slow_motion_does_not_make_the_axis_heavier() -> None:
    """Its inertia is a hundredth of the cogging: a heavier twin only answers less to the force it lacks."""
    slow = moved([(0.15, 0.06)])
    bench = reduced(BENCH, [slow])
    found = fit_nominal_parameters(prepare_dataset(preflight([slow], bench).accepted(), bench))
    owner = found.estimator.evaluate(found.hypothesis.given)
    assert found.missed_torque <= 1.01 * owner.missed_torque
    assert found.bench.axis.physics().chain.inertia_kg_m2.sum() == pytest.approx(11.5)
