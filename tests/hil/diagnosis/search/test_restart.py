"""A fit that ended in a corner is tried again from the parameters of the bench file."""

from __future__ import annotations

from diagnosis_runs import bench, recorded

from hil.diagnosis.search.restart import again
from hil.identification.dataset import prepare_dataset
from hil.identification.estimator import Estimator
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term

STRIBECK = Term("stribeck_friction", 0, (1.6, 2.0))


def test_a_fit_with_a_parameter_at_its_bound_is_fitted_from_the_bench_file() -> None:
    owner = bench()
    data = prepare_dataset([take(recorded(owner, STRIBECK), owner)], owner)
    wrong = Hypothesis(owner, (Term("stribeck_friction", 1, (3.0, 2e-5)),))  # too slow to act: nothing leads out of it
    corner = wrong.moved(wrong.x.copy())
    mass = [coordinate.name for coordinate in wrong.coordinates].index("table_mass_kg")
    corner.x[mass] = wrong.bounds[0][mass]
    stuck = Estimator(data).fit(corner, evaluations=10, fixed=[mass])
    assert not stuck.at_floor
    assert stuck.at_bound
    found = again(stuck, 40)
    assert found.at_floor
    assert [term.effect for term in found.terms] == ["stribeck_friction"]
    assert again(found, 40) is found  # at its floor there is nothing to look for
