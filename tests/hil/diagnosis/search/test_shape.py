"""Evidence below the noise: the shape of a term in the torque that a twin leaves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded
from scipy.integrate import quad
from scipy.stats import t as student

from hil.bench.control_section import UnknownControl
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.search.shape import _first_coefficient, _log_tail, log_chance_below_noise, log_chance_of_shape, shown
from hil.identification.estimator import Fit
from hil.identification.laps import Laps
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})
COGGING = Term("cogging_torque", 0, (0.05, 6.0, 0.4))
MODE = Term("structural_mode", 0, (180.0, 0.02, 0.3))
NEEDED = math.log(CRITERIA.significance)
DELAY = Term("transport_delay", 1, (0.5 * KNOWN.gains.period_s,))


def base(*terms: Term) -> Fit:
    """A twin without new terms on an axis whose torque was measured with much noise."""
    recording = changed(recorded(KNOWN, *terms, times=6, torque_noise_n_m=0.3), torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    fit = fit_nominal_parameters(prepare([recording], [], OWNER).train)
    assert fit.within_noise
    return fit


@pytest.mark.parametrize(("terms", "told"), [((COGGING,), True), ((), False)])
def test_a_shape_below_the_noise_is_told_where_it_is(terms: tuple[Term, ...], told: bool) -> None:
    without = base(*terms)
    begun = without.estimator.evaluate(without.hypothesis.with_term(COGGING))
    assert (log_chance_of_shape(begun.hypothesis, without) < NEEDED) == told
    assert [one.term for one in shown(without, [Candidate(COGGING, 0.0)])] == [COGGING] * told


def test_a_shape_of_the_opposite_sign_is_told_only_before_it_is_fitted() -> None:
    without = base(COGGING)
    opposite = replace(COGGING, values=(0.05, 6.0, 0.4 + math.pi))
    begun = without.estimator.evaluate(without.hypothesis.with_term(opposite))
    assert log_chance_of_shape(begun.hypothesis, without) > math.log(0.5)
    assert log_chance_of_shape(begun.hypothesis, without, fitted=False) < NEEDED


def test_a_delay_or_a_resonance_that_passes_less_noise_is_not_told() -> None:
    without = base(COGGING)
    for term in (DELAY, MODE):
        begun = without.estimator.evaluate(without.hypothesis.with_term(term))
        chance = log_chance_below_noise(begun, without)
        assert chance is not None
        assert chance > NEEDED


@pytest.mark.parametrize("free", [3.0, 40.0, 3e3, 1e5])
@pytest.mark.parametrize("ratio", [0.0, 2.0, 30.0, 90.0, 1e3])
def test_the_tail_of_students_t_is_told_where_it_is_no_floating_point_number(ratio: float, free: float) -> None:
    """Two shapes whose chances are both 0.0 as numbers can be ordered by their logarithms."""

    def over_density(way: float) -> float:
        return math.exp(student.logpdf(ratio + way, free) - student.logpdf(ratio, free))

    width = 1.0 / max(1.0, ratio * (free + 1.0) / (free + ratio**2))
    area = width * quad(lambda way: over_density(width * way), 0.0, math.inf, limit=400)[0]
    assert _log_tail(ratio, free) == pytest.approx(student.logpdf(ratio, free) + math.log(area), abs=0.02)


def test_noise_that_repeats_from_lap_to_lap_tells_no_more_than_one_lap() -> None:
    rng, lap, rows = np.random.default_rng(5), 1200, np.ones(2400, dtype=bool)
    laps = Laps(np.arange(lap), np.arange(lap) + lap)
    shape = np.tile(np.sin(0.05 * np.arange(lap)), 2)
    matrix = np.column_stack([shape, np.ones(2 * lap)])
    ratios = {"repeats": list[float](), "not told": list[float](), "does not": list[float]()}
    for _ in range(120):
        same, other = np.tile(rng.standard_normal(lap), 2), rng.standard_normal(2 * lap)
        ratios["repeats"].append(_first_coefficient(matrix, same, [rows], [laps])[1])
        ratios["not told"].append(_first_coefficient(matrix, same, [rows], [None])[1])
        ratios["does not"].append(_first_coefficient(matrix, other, [rows], [laps])[1])
    spread = {name: float(np.std(values)) for name, values in ratios.items()}
    assert spread["repeats"] == pytest.approx(1.0, abs=0.15)
    assert spread["does not"] == pytest.approx(1.0, abs=0.15)
    assert spread["not told"] > 1.25  # what the error would be wrong by
