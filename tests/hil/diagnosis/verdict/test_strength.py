"""A term is there by its strength, though its other values are not told."""

from __future__ import annotations

from diagnosis_runs import bench, dataset, fitted, recorded

from hil.diagnosis.verdict.strength import strength_over_error
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import standard_errors
from hil.identification.measured import take
from hil.identification.terms import Term

OWNER = bench()
DRIFT = Term("friction_drift", 0, (4.0, 400.0))


def test_a_drift_that_goes_on_beyond_the_recording_is_there() -> None:
    """Only its rate is told: fraction and time constant have errors above their values."""
    data = dataset([take(recorded(OWNER, DRIFT), OWNER)], OWNER)
    found = fitted(Hypothesis(OWNER, (DRIFT,)), data)
    error = standard_errors(found)[found.hypothesis.columns(0)][0]
    assert abs(found.terms[0].values[0]) < error
    assert strength_over_error(found, 0) > 5.0


def test_a_drift_that_is_not_there_is_told_by_the_same_measure() -> None:
    data = dataset([take(recorded(OWNER), OWNER)], OWNER)
    assert strength_over_error(fitted(Hypothesis(OWNER, (DRIFT,)), data), 0) < 3.0


def test_the_error_of_a_strength_beside_known_values_is_no_larger() -> None:
    data = dataset([take(recorded(OWNER, DRIFT), OWNER)], OWNER)
    found = fitted(Hypothesis(OWNER, (DRIFT,)), data)
    fraction, time_constant = range(*found.hypothesis.columns(0).indices(found.hypothesis.x.size))
    free, beside = standard_errors(found), standard_errors(found, {time_constant})
    assert 0.0 < beside[fraction] <= free[fraction]
    assert beside[time_constant] < 1e-3 * free[time_constant]
