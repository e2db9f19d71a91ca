"""Internal steps of the twin are as fine as the noise of the recordings asks."""

from __future__ import annotations

from dataclasses import replace

import pytest
from diagnosis_runs import bench, dataset, evaluated, recorded

from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.internal_steps import longest_steps
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.twin.axis import TWIN_STEPS, Steps


def recordings(*torque_noise_n_m: float) -> Dataset:
    runs = [take(recorded(bench(), torque_noise_n_m=one), bench()) for one in torque_noise_n_m]
    return dataset(runs, bench())


def steps(torque_noise_n_m: float) -> tuple[Steps, float]:
    """Longest steps on a recording with a noise of the torque, and what they change of the residuals [noise^2]."""
    data = recordings(torque_noise_n_m)
    fit = evaluated(Hypothesis(bench()), data)
    found = longest_steps(fit, data.over([]))
    longer = replace(fit.estimator, data=replace(data, steps=found)).residuals(fit.hypothesis)
    changed = longer.vector - fit.residuals.vector
    return found, float(changed @ changed)


@pytest.mark.parametrize("torque_noise_n_m", [1e-4, 0.01, 1.0])
def test_they_change_less_than_evidence(torque_noise_n_m: float) -> None:
    assert steps(torque_noise_n_m)[1] <= 2.0


def test_more_noise_allows_longer_ones() -> None:
    (fine, _), (coarse, _) = steps(1e-4), steps(1.0)
    assert fine.coarse_s < coarse.coarse_s
    assert coarse.fine_s > TWIN_STEPS.fine_s


def test_quiet_held_out_recordings_and_terms_ask_for_finer_ones() -> None:
    noisy, none = recordings(1.0), recordings(1.0).over([])
    fit = evaluated(Hypothesis(bench()), noisy)
    coarse = longest_steps(fit, none)
    assert longest_steps(fit, recordings(1e-4)).fine_s < coarse.fine_s
    play = evaluated(Hypothesis(bench(), (Term("backlash", 0, (20e-6,)),)), replace(noisy, steps=coarse))
    assert longest_steps(play, none).fine_s < coarse.fine_s
