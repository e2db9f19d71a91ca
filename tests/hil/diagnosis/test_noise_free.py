"""A term that only filters the counts of an encoder is told from one that moves the axis."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, dataset, fitted, moves, recorded

from hil.bench.bench_file import Bench
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.diagnosis.verdict.noise_free import energy_without_noise
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import against
from hil.identification.measured import take
from hil.identification.terms import Term

FLEXIBLE_LOAD = Term("structural_mode", 2, (238.0, 0.15, 1.0))
COGGING = Term("cogging_torque", 0, (0.05, 12.0, 0.0))


def coarse_motor() -> Bench:
    """The reference bench with 16384 counts per revolution of the motor."""
    content = bench().model_dump(mode="json", exclude_none=True)
    content["encoders"]["motor"]["counts_per_rev"] = 2**14
    return Bench.model_validate(content)


def constant_feed(owner: Bench, *terms: Term) -> Dataset:
    """A recording at a slow feed, at which the counts come as a regular pattern."""
    dwell = {"kind": "dwell", "duration_s": 0.2}
    profile = moves([dwell, {"kind": "sine_squared", "to_m": 0.06, "feed_m_s": 0.01}, dwell])
    return dataset([take(recorded(owner, *terms, profile=profile), owner)], owner, observer_s=0.0025)


def test_a_filter_of_counts_gains_evidence_but_not_on_motion_without_noise() -> None:
    owner = coarse_motor()
    data = constant_feed(owner)
    plain, found = fitted(Hypothesis(owner), data), fitted(Hypothesis(owner, (FLEXIBLE_LOAD,)), data)
    gained, alone = plain.cost - found.cost, energy_without_noise(found, plain)
    assert against(found, plain) > 1000.0
    assert alone is not None
    assert alone < 0.05 * gained
    proof = cross_validate(plain, found, data.over(()))
    assert not proof.final.terms
    assert "noise of the sensors" in proof.dropped[0].refuted


def test_an_effect_of_the_axis_gains_as_much_on_motion_without_noise() -> None:
    owner = bench()
    data = constant_feed(owner, COGGING)
    plain, found = fitted(Hypothesis(owner), data), fitted(Hypothesis(owner, (COGGING,)), data)
    assert energy_without_noise(found, plain) == pytest.approx(plain.cost - found.cost, rel=0.05)
    proof = cross_validate(plain, found, data.over(()))
    assert [term.effect for term in proof.final.terms] == ["cogging_torque"]
