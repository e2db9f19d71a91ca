"""The score test finds a known direction and its strength."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, dataset, fitted, recorded

from hil.diagnosis.search.score_test import screen
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term

OWNER = bench()


def test_the_score_test_finds_a_known_direction_and_its_strength() -> None:
    """The nominal parameters are right, so that the residual is noise and the effect of a small load."""
    load = Term("constant_load", 0, (0.05,))
    data = dataset([take(recorded(OWNER, load), OWNER)], OWNER)
    base = fitted(Hypothesis(OWNER), data, evaluations=1)  # its derivatives, no step
    points = [Term("constant_load", 0, (0.02,)), Term("encoder_eccentricity", 0, (1e-4, 0.0))]
    first, second = screen(base, points)
    assert first.term.effect == "constant_load"
    assert first.term.values[0] == pytest.approx(0.05, rel=0.1)
    assert first.score > 10.0 * second.score
