"""A round of the search: what is tried, and what the noise of a sampled torque does not add."""

from __future__ import annotations

from dataclasses import replace

import pytest
from diagnosis_runs import SEGMENTS, bench, changed, moves, recorded

from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.preparation.structure import rigid
from hil.diagnosis.search.next_term import SearchRound, next_term
from hil.diagnosis.search.score_test import Candidate, screen_library
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.motion.profile import Profile

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})
COGGING = Term("cogging_torque", 0, (0.2, 6.0, 0.4))


def test_the_noise_of_a_sampled_torque_is_no_evidence() -> None:
    """An axis without any effect whose torque was only measured: a delay of half a row would average its noise."""
    recording = changed(recorded(KNOWN, times=2, torque_noise_n_m=0.05), torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    found = fit_nominal_parameters(prepare([recording], [], OWNER).train)
    delay_s = found.hypothesis.values[found.hypothesis.nominal.index("torque_delay_s")]
    assert abs(delay_s) < 0.1 * recording.period_s
    candidates = [Candidate(COGGING, 0.9)]
    additions = next_term(SearchRound(found, found, found), candidates, print)
    assert (additions.fits, additions.best) == ([], None)


TO_AND_FRO = [
    {"kind": "sine_squared", "to_m": 0.06, "feed_m_s": 0.1},
    {"kind": "dwell", "duration_s": 0.2},
    {"kind": "sine_squared", "to_m": 0.0, "feed_m_s": 0.25},
]


@pytest.mark.parametrize("profile", [moves(SEGMENTS), moves(TO_AND_FRO, 2)], ids=["with creep", "to and fro"])
@pytest.mark.parametrize("load_n_m", [2.0, 6.0])
def test_a_weight_is_found_though_the_refit_without_it_ends_at_its_bounds(profile: Profile, load_n_m: float) -> None:
    """Beside friction that was refitted to it, a weight looks like a push, or friction that differs by direction."""
    owner = rigid(KNOWN).model_copy(update={"control": UnknownControl(law="unknown")})
    lifted = recorded(KNOWN, Term("constant_load", 0, (load_n_m,)), profile=profile)
    recording = changed(lifted, torque_command_n_m=None, table_position_m=None)
    base = fit_nominal_parameters(prepare([recording], [], owner).train)
    assert base.at_bound
    given = base.estimator.evaluate(base.hypothesis.given)
    best = next_term(SearchRound(base, base, given), screen_library(base), print).best
    assert best is not None
    (load,) = best.fit.terms
    assert load.effect == "constant_load"
    assert load.values == pytest.approx((load_n_m,), rel=0.01)
