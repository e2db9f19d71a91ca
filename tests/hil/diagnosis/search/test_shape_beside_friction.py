"""The torque shows an effect that is below the noise of one row, even if the twin has too much friction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded
from scipy.stats import norm

from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.search.shape import _searched, _without_harmonics
from hil.diagnosis.verdict.cross_validation import _by_torque
from hil.diagnosis.verdict.findings import _sure
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.identification.torque_left import (
    fit_plain,
    left_by_twin,
    measured_motion,
    missed_beyond_noise,
    needed_torque,
    torque_deviation,
    torque_missed,
)

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})
COULOMB = "coulomb_torque_n_m"
COGGING = Term("cogging_torque", 0, (0.05, 6.0, 0.4))


@pytest.fixture(scope="module")
def without() -> Fit:
    """A twin without the cogging of an axis whose torque was measured with much noise."""
    recording = changed(recorded(KNOWN, COGGING, times=6, torque_noise_n_m=0.3), torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    return fit_nominal_parameters(prepare([recording], [], OWNER).train)


def more_friction(fit: Fit, factor: float) -> Fit:
    hypothesis, x = fit.hypothesis, fit.hypothesis.x.copy()
    index = hypothesis.nominal.index(COULOMB)
    x[index] = hypothesis.coordinates[index].x(factor * hypothesis.values[index])
    return fit.estimator.fit(hypothesis.moved(x), evaluations=1)


@pytest.mark.parametrize("factor", [1.3, 2.0])
def test_the_torque_that_a_twin_lacks_is_told_where_it_sticks_without(without: Fit, factor: float) -> None:
    plain, wrong = fit_plain(without.data), more_friction(without, factor)
    assert plain is not None
    less, more = (needed_torque(one.hypothesis, without.data, plain)[0] for one in (without, wrong))
    rows, way = more.rows & more.clear, measured_motion(without.data.runs[0]).moved.direction
    index = wrong.hypothesis.nominal.index(COULOMB)
    added = wrong.hypothesis.values[index] - without.hypothesis.values[index]
    assert np.count_nonzero(rows) > 0.95 * np.count_nonzero(more.rows)
    assert np.median(((less.left - more.left) * way)[rows]) == pytest.approx(added, rel=0.1)


def test_the_energy_of_the_torque_counts_below_the_noise_alone(without: Fit) -> None:
    fit = without.estimator.fit(without.hypothesis.with_term(COGGING))
    (run,) = without.data.runs
    whole, part = without.data, without.data.over([run.until(run.motor.size // 4)])
    told = _by_torque(fit, without, fit.terms[0], [whole])

    def ratio(data: Dataset) -> float:
        left = [torque_missed(one, data) or math.nan for one in (fit, without)]
        return (left[1] / left[0]) ** 2

    assert told == pytest.approx(ratio(without.data))
    assert told > 1.0
    assert ratio(part) != pytest.approx(told, rel=1e-3)
    assert _by_torque(fit, without, fit.terms[0], [whole, part]) == pytest.approx(min(told, ratio(part)))
    assert _by_torque(fit, more_friction(without, 3.0), fit.terms[0], [whole]) == 1.0


def test_a_strength_is_sure_by_its_error_or_by_its_shape(without: Fit) -> None:
    begun = without.hypothesis.with_term(replace(COGGING, values=(1e-4, 6.0, 0.4)))
    weak = without.estimator.fit(begun, evaluations=1)
    assert _sure(weak, 0, None) < 0.5
    assert _sure(weak, 0, 0.0) == _sure(weak, 0, None)
    deviate = norm.isf(1e-3)
    assert _sure(weak, 0, math.log(1e-3)) == pytest.approx(1.0 - 1.0 / deviate**2)


def test_the_torque_of_a_slow_end_is_missed_as_a_share_of_that_of_all_motion(without: Fit) -> None:
    """A part that needs hardly any torque of its own makes no error of the twin large."""
    (run,) = without.data.runs
    part = without.data.over([run.until(run.motor.size // 4)])
    plain = fit_plain(without.data)
    assert plain is not None
    own, every = (torque_deviation(data, plain.slowest) for data in ([part], [without.data, part]))
    assert own != pytest.approx(every, rel=1e-3)
    wrong = without.estimator.evaluate(more_friction(without, 1.5).hypothesis)
    missed = torque_missed(wrong, part)
    assert missed is not None
    assert missed * every == pytest.approx((left_by_twin(wrong.hypothesis, part, plain, own) or 0.0) * own)
    assert 0.9 * missed < missed_beyond_noise(wrong, part) < missed


def test_a_lead_error_is_asked_without_the_harmonics_that_it_need_not_have() -> None:
    """Else it loses to one wave of another cause by the values that were searched for them."""
    found = Hypothesis(KNOWN, (Term("periodic_lead_error", 0, (1e-6, 0.7, 2e-7, 0.3, 1e-7, 0.1)),))
    plain = _without_harmonics(found, found.terms[0])
    assert plain is not None
    assert plain.terms[0].values == (1e-6, 0.7, 0.0, 0.0, 0.0, 0.0)
    one_wave = Hypothesis(KNOWN, (Term("encoder_eccentricity", 0, (1e-4, 0.7)),))
    assert _searched(plain) == _searched(one_wave) < _searched(found)
    assert _without_harmonics(plain, plain.terms[0]) is None
    assert _without_harmonics(one_wave, one_wave.terms[0]) is None
