"""Inverse dynamics of a rigid twin against its own simulation, and in rows too slow for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hil.bench.bench_file import Bench
from hil.bench.turning_axes import Rotary, RotaryTwoMass
from hil.identification.hypothesis import Hypothesis
from hil.identification.inverse_twin import as_observed, at_each_tick, is_rigid, lacking
from hil.identification.measured import Measured, take
from hil.identification.terms import Term
from hil.recording.recording import Recording

PERIOD_S, INERTIA, COULOMB = 1e-3, 0.01, 0.3
AXIS = Rotary(inertia_kg_m2=INERTIA, coulomb_torque_n_m=COULOMB, viscous_torque_n_m_s_rad=0.02)
UNSAMPLED = Bench.model_validate(
    {
        "axis": AXIS.model_dump(),
        "control": {"law": "unknown"},
        "encoders": {"motor": {"counts_per_rev": 1e6}, "table": None},
    }
)
OWNER = UNSAMPLED.sampled(PERIOD_S)
TIME_S = np.arange(6000) * PERIOD_S
TORQUE = 1.5 * np.sin(2.0 * np.pi * 0.7 * TIME_S) + 0.9 * np.sin(2.0 * np.pi * 1.9 * TIME_S + 1.0)


def simulated(*terms: Term) -> Measured:
    """A run of the twin with terms under a torque; what its encoder reads."""
    twin = Hypothesis(OWNER, terms).twin()
    motor = twin.drive(TORQUE).motor_position
    columns = {"time_s": TIME_S, "motor_position_rad": motor, "torque_n_m": TORQUE}
    return take(Recording("log", columns, PERIOD_S, {"source": "log.csv"}), OWNER)


def sliding(run: Measured) -> NDArray[np.bool_]:
    speed = np.gradient(run.motor, PERIOD_S)
    slow = np.abs(speed) < 0.03 * np.max(np.abs(speed))
    rows = np.convolve(slow, np.ones(31), mode="same") == 0.0
    rows[:50] = rows[-50:] = False
    return rows


def left(run: Measured, *terms: Term) -> float:
    """Torque (rms, of its deviation) that the twin with terms lacks."""
    hypothesis = Hypothesis(OWNER, terms)
    twin = hypothesis.twin(run=run)
    assert is_rigid(twin)
    assert at_each_tick(twin).active == tuple(twin.active)
    missing = lacking(twin, hypothesis.undelayed(twin, run), run)
    return float(np.sqrt(np.mean(missing[sliding(run)] ** 2)) / np.std(TORQUE))


@pytest.mark.parametrize(
    "term",
    [
        Term("constant_load", 0, (0.2,)),
        Term("spring_load", 0, (0.01, 3.0)),
        Term("gravity_torque", 0, (0.25, 0.4)),
        Term("cogging_torque", 0, (0.1, 2.0, 0.7)),
        Term("torque_ripple", 0, (0.1, 2.0, 0.7)),
        Term("periodic_force", 0, (0.15, 3.0, 0.2)),
        Term("stribeck_friction", 0, (0.5, 4.0)),
        Term("nonlinear_viscous_friction", 0, (0.002,)),
        Term("load_dependent_friction", 0, (0.15,)),
        Term("friction_drift", 0, (0.5, 2.0)),
        Term("torque_saturation", 1, (1.6,)),
        Term("torque_constant_saturation", 0, (0.03,)),
        Term("encoder_eccentricity", 0, (0.05, 0.3)),
    ],
    ids=lambda term: term.effect,
)
def test_the_torque_that_a_simulated_motion_needs_is_the_one_that_made_it(term: Term) -> None:
    run = simulated(term)
    assert left(run, term) < 3e-3
    assert left(run) > 10.0 * left(run, term)


def test_noise_of_the_torque_moves_no_twin_of_much_friction_and_few_rows() -> None:
    """Rows of 20 ms with half the friction as noise of the torque: a twin with twice the friction lacks just that."""
    every = 20
    rows = np.arange(0, TIME_S.size - every, every)
    position = np.cumsum(3.0 * np.sin(2.0 * np.pi * 0.3 * TIME_S)) * PERIOD_S
    way = np.sign(np.gradient(position, PERIOD_S))
    noise = 0.5 * COULOMB * np.random.default_rng(1).standard_normal(rows.size)
    columns = {
        "time_s": TIME_S[rows], "motor_position_rad": position[rows], "torque_n_m": COULOMB * way[rows] + noise
    }  # fmt: skip
    axis = AXIS.model_copy(update={"coulomb_torque_n_m": 2.0 * COULOMB, "viscous_torque_n_m_s_rad": 0.0})
    owner = UNSAMPLED.model_copy(update={"axis": axis.model_copy(update={"inertia_kg_m2": 1e-4})}).sampled(
        every * PERIOD_S
    )
    run = take(Recording("log", columns, every * PERIOD_S, {"source": "log.csv"}), owner)
    twin = Hypothesis(owner).twin(run=run)
    missing = lacking(twin, Hypothesis(owner).undelayed(twin, run), run)[5:-5]
    forwards = way[rows][5:-5] > 0.0
    assert np.mean(missing[forwards]) == pytest.approx(COULOMB, abs=0.03)
    assert np.mean(missing[~forwards]) == pytest.approx(-COULOMB, abs=0.03)


def test_an_observed_torque_is_late_and_goes_on_where_it_is_not_known() -> None:
    rows = np.ones(400, dtype=bool)
    rows[150:250] = False
    torque = np.where(rows, 0.7, 50.0)
    seen = as_observed(torque, rows, 0.2)
    np.testing.assert_allclose(seen[60:], 0.7, rtol=1e-3)
    assert seen[1] < 0.1
    np.testing.assert_array_equal(as_observed(torque, np.zeros(400, dtype=bool), 0.2), 0.0)


def test_a_spring_is_not_rigid_and_a_bristle_acts_between_the_ticks() -> None:
    two = RotaryTwoMass(
        motor_inertia_kg_m2=0.005, load_inertia_kg_m2=0.005, stiffness_n_m_rad=100.0, coulomb_torque_n_m=COULOMB,
        viscous_torque_n_m_s_rad=0.02,
    )  # fmt: skip
    assert not is_rigid(Hypothesis(OWNER.model_copy(update={"axis": two})).twin())
    twin = Hypothesis(OWNER, (Term("presliding_hysteresis", 0, (50.0,)), Term("constant_load", 0, (0.1,)))).twin()
    assert [one.effect for one in at_each_tick(twin).active] == ["constant_load"]
    assert at_each_tick(replace(twin, active=())).active == ()
