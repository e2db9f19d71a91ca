"""Weights: beside what the bench knows of them, and heavier than any friction."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, recorded

from hil.bench import Bench, MechanismEntry
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.explain import claimable
from hil.diagnosis.terms import Term

OWNER = bench()
COULOMB_N_M = OWNER.axis.physics().coulomb_n_m


def knowing(effect: str, parameter: str, value: float) -> Bench:
    """The bench with a mechanism that its owner knows of."""
    return OWNER.model_copy(update={"mechanisms": (MechanismEntry(effect=effect, parameters={parameter: value}),)})


@pytest.mark.parametrize(("effect", "parameter"), [
    ("constant_load", "load_torque_n_m"), ("asymmetric_friction", "offset_torque_n_m")])
def test_a_load_that_is_known_too_small_is_corrected_not_doubled(effect: str, parameter: str) -> None:
    truth = Term("constant_load", 0, (0.8,))
    found = diagnose([recorded(OWNER, truth)], [recorded(OWNER, truth, seed=2)], knowing(effect, parameter, 0.3))
    assert [one.effect for one in found.result.missing] == [effect]
    (entry,) = found.bench.mechanisms
    assert entry.effect == effect
    assert entry.parameters[parameter] == pytest.approx(0.8, rel=0.01)


def test_a_weight_above_coulomb_friction_is_no_friction() -> None:
    assert claimable(Term("asymmetric_friction", 0, (-0.9 * COULOMB_N_M,)), OWNER)
    assert not claimable(Term("asymmetric_friction", 0, (1.1 * COULOMB_N_M,)), OWNER)
    assert claimable(Term("constant_load", 0, (3.0 * COULOMB_N_M,)), OWNER)
