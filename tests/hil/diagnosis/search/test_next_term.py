"""A round of the search: what is tried, and what the noise of a sampled torque does not add."""

from __future__ import annotations

from dataclasses import replace

from diagnosis_runs import bench, changed, recorded

from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.search.next_term import SearchRound, next_term
from hil.diagnosis.search.score_test import Candidate
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term

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
