"""Evidence below the noise: the shape of a term in the torque that a twin leaves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.bench.control_section import UnknownControl
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.search.by_shape import _of_clearest_channel, _resolved, fitted, shown
from hil.diagnosis.search.forward_selection import over
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.search.shape import Size, log_chance_below_noise, log_chance_of_shape, sizes
from hil.identification.coefficient import Coefficient
from hil.identification.estimator import Fit
from hil.identification.intended_motion import measured_motion
from hil.identification.noise_apart import noise_apart
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})
COGGING = Term("cogging_torque", 0, (0.05, 6.0, 0.4))
MODE = Term("structural_mode", 0, (180.0, 0.02, 0.3))
NEEDED = math.log(CRITERIA.significance)
DELAY = Term("transport_delay", 1, (0.5 * KNOWN.gains.period_s,))


def base(*terms: Term, torque_noise_n_m: float = 0.3) -> Fit:
    """A twin without new terms on an axis whose torque was measured with much noise."""
    recording = recorded(KNOWN, *terms, times=6, torque_noise_n_m=torque_noise_n_m)
    recording = changed(recording, torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    fit = fit_nominal_parameters(prepare([recording], [], OWNER).train)
    assert fit.within_noise
    return fit


def apart(fit: Fit) -> Fit:
    """The fit as a search has it, with the noise apart."""
    plain = fit_plain(fit.data)
    assert plain is not None
    return over(noise_apart(fit.data, fit.hypothesis.given, plain), fit)


@pytest.mark.parametrize(("terms", "told"), [((COGGING,), True), ((), False)])
def test_a_shape_below_the_noise_is_told_where_it_is(terms: tuple[Term, ...], told: bool) -> None:
    without = apart(base(*terms))
    begun = without.estimator.evaluate(without.hypothesis.with_term(COGGING))
    assert (log_chance_of_shape(begun.hypothesis, without) < NEEDED) == told
    assert bool(shown(without, [Candidate(COGGING, 0.0)])) == told


def test_a_shape_of_the_opposite_sign_is_told_only_before_it_is_fitted() -> None:
    without = apart(base(COGGING))
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


def test_a_start_gets_the_size_and_angle_that_the_torque_tells() -> None:
    without = apart(base(COGGING, torque_noise_n_m=0.15))
    wrong = replace(COGGING, values=(0.001, 6.0, 2.0))
    (found,) = shown(without, [Candidate(wrong, 0.0)])
    size, order, angle = found.term.values
    assert order == 6.0
    assert size == pytest.approx(COGGING.values[0], rel=0.3)
    assert math.remainder(angle - COGGING.values[2], 2.0 * math.pi) == pytest.approx(0.0, abs=0.5)
    best = fitted(without, [found])[0]
    assert best.terms[-1].effect == "cogging_torque"
    assert best.terms[-1].values[:2] == pytest.approx(COGGING.values[:2], rel=0.3)


def test_a_start_gets_the_sign_that_the_torque_tells_or_is_not_begun() -> None:
    without = apart(base(Term("constant_load", 0, (-0.2,))))
    (found,) = shown(without, [Candidate(Term("constant_load", 0, (0.01,)), 0.0)])
    assert found.term.values == pytest.approx((-0.2,), rel=0.1)
    with_drag = apart(base(Term("nonlinear_viscous_friction", 0, (-2e-5,))))
    (of_drag,) = shown(with_drag, [Candidate(Term("nonlinear_viscous_friction", 0, (1e-6,)), 0.0)])
    assert of_drag.term.values[0] < 0.0


def test_a_wave_that_the_rows_do_not_resolve_is_not_begun() -> None:
    without = base(COGGING)
    plain = fit_plain(without.data)
    assert plain is not None
    moved = [(run, measured_motion(run)) for run in without.data.runs]
    steps = [np.abs(np.diff(run.motor, append=run.motor[-1]))[one.sliding(plain.slowest)] for run, one in moved]
    highest = math.pi / float(np.median(np.concatenate(steps)))  # two rows for each cycle
    begun = [Term("cogging_torque", 0, (0.05, order, 0.4)) for order in (6.0, 0.9 * highest, 1.1 * highest)]
    assert [_resolved(without, one) for one in begun] == [True, True, False]


def test_a_smoothed_motion_tells_no_lag() -> None:
    """A mean is one."""
    without = base(torque_noise_n_m=0.15)
    lag, cogging = (without.hypothesis.with_term(term) for term in (Term("current_loop_lag", 1, (1e-3,)), COGGING))
    asked = [len(sizes([one], without)) for one in (lag, cogging)]
    assert asked[0] == asked[1] - 1 > 0


def test_a_size_is_that_of_the_channel_that_tells_it() -> None:
    """The torque tells nothing of an encoder's error: its size of 87, at 2.4 errors, does not count."""
    told = {"torque": [(-87.3, -2.44), (-66.0, -1.8)], "difference": [(1.02, 22.1), (1.09, 22.0)]}
    seen = [[Size(name, Coefficient(*one, 200.0), 10.0, 3000)] for name, ones in told.items() for one in ones]
    assert _of_clearest_channel(seen)[0].told.value == 1.09
