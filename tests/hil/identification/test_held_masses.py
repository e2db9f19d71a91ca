"""Masses that an owner holds: of a sum that is told, the other one takes the rest."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench

from hil.bench.bench_file import Bench
from hil.diagnosis.preparation.structure import rigid
from hil.fleet.constants import with_inertia
from hil.identification.residual_scales import factor_of_masses, inertia

OWNER = bench()


def holding(*held: str) -> Bench:
    """The owner's bench with values that a diagnosis keeps."""
    return OWNER.model_copy(update={"axis": OWNER.axis.model_copy(update={"held": held})})


def test_a_held_mass_keeps_its_value_where_the_inertia_is_another_one() -> None:
    owner, wanted = holding("table_mass_kg"), 1.3 * inertia(OWNER)
    other = with_inertia(owner, wanted)
    assert inertia(other) == pytest.approx(wanted)
    assert other.axis.table_mass_kg == OWNER.axis.table_mass_kg
    assert with_inertia(OWNER, wanted).axis.table_mass_kg == pytest.approx(1.3 * OWNER.axis.table_mass_kg)


def test_nothing_is_scaled_where_all_masses_are_held() -> None:
    owner = holding(*OWNER.axis.MASSES)
    assert factor_of_masses(owner, 2.0 * inertia(OWNER)) == 1.0
    assert with_inertia(owner, 2.0 * inertia(OWNER)).axis == owner.axis


def test_one_inertia_is_held_if_each_part_of_it_is() -> None:
    assert rigid(holding(*OWNER.axis.MASSES)).axis.held == ("mass_kg",)
    assert rigid(holding("table_mass_kg", "coulomb_torque_n_m")).axis.held == ("coulomb_torque_n_m",)
    assert not rigid(holding(*OWNER.axis.MASSES, *OWNER.axis.FRICTION)).axis.refitted
