"""A term that only filters the counts of an encoder is told from one that moves the axis."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, fitted, moves, recorded

from hil.bench.bench_file import Bench
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.diagnosis.verdict.noise_free import energy_without_noise
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import bic_gain
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.motion.trajectory import plan
from hil.recording.recording import Recording
from hil.twin.axis import Start

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


def with_misread_motor(owner: Bench, term: Term, noise_rad: float) -> Dataset:
    """A recording whose controller sees a motor encoder with white noise."""
    dwell = {"kind": "dwell", "duration_s": 0.2}
    setpoints = plan(moves([dwell, {"kind": "sine_squared", "to_m": 0.01, "feed_m_s": 0.01}, dwell]), 1e-3)
    rows = setpoints.position_m.size
    noise = np.random.default_rng(4)
    misread = np.stack([noise.normal(0.0, noise_rad, rows), np.zeros(rows)])
    twin = Hypothesis(owner, (term,)).twin()
    found = twin.simulate(setpoints.position_m, setpoints.velocity_m_s, Start(), np.empty(0), misread)
    columns = {
        "time_s": np.arange(rows) * 1e-3,
        "position_command_m": setpoints.position_m,
        "velocity_command_m_s": setpoints.velocity_m_s,
        "motor_position_rad": found.motor_position + misread[0],
        "table_position_m": np.round(found.table_position_m / 0.5e-6) * 0.5e-6,
        "torque_command_n_m": found.torque_command,
        "torque_n_m": found.torque + noise.normal(0.0, 0.01, rows),
    }
    return dataset([take(Recording("run", columns, 1e-3), owner)], owner, observer_s=0.0025)


def test_a_lag_of_the_drive_shows_by_the_noise_of_its_command() -> None:
    """The recorded command is exact, whatever moves it."""
    owner, lag = bench(), Term("current_loop_lag", 0, (5e-5,))
    data = with_misread_motor(owner, lag, 1e-3)
    plain, found = fitted(Hypothesis(owner), data), fitted(Hypothesis(owner, (lag,)), data)
    assert plain.worst_ratio > 2.0 * found.worst_ratio
    proof = cross_validate(plain, found, data.over(()))
    assert [term.effect for term in proof.final.terms] == ["current_loop_lag"]


def test_a_filter_of_counts_gains_evidence_but_not_on_motion_without_noise() -> None:
    owner = coarse_motor()
    data = constant_feed(owner)
    plain, found = fitted(Hypothesis(owner), data), fitted(Hypothesis(owner, (FLEXIBLE_LOAD,)), data)
    gained, alone = plain.cost - found.cost, energy_without_noise(found, plain)
    assert bic_gain(found, plain) > 1000.0
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
