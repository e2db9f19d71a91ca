"""Motions designed to separate what a recording ties, and to show what it hides; nothing is promised that none does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, fitted, moves, recorded, searched

from hil.bench.bench_file import Bench
from hil.bench.hardware import SetPointLimits
from hil.diagnosis.candidate_motions import candidates, reach
from hil.diagnosis.experiment import Experiment, separating, showing
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.verdict.testability import not_testable
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import TIED, bic_gain
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.motion.profile import Profile, load_profile, write_profile
from hil.motion.trajectory import plan

OWNER = bench()
REST = {"kind": "dwell", "duration_s": 0.3}
ONE_WAY = moves([REST, {"kind": "sine_squared", "to_m": 0.2, "feed_m_s": 0.124}, REST])
SLOW = moves([REST, {"kind": "sine_squared", "to_m": 0.06, "feed_m_s": 0.03, "acceleration_m_s2": 0.1}, REST])


def runs(profile: Profile, *terms: Term, seed: int = 1, believed: Bench = OWNER) -> Dataset:
    return dataset([take(recorded(OWNER, *terms, seed=seed, profile=profile), believed)], believed)


NONE = dataset([], OWNER)


def designed(right: Fit, *others: Fit, tied: bool = False) -> Experiment:
    """The experiment for a fit and its rivals, as evidence on these recordings has them, or taken as tied."""
    rivals = [RivalFit.of(other, 0.0 if tied else bic_gain(right, other)) for other in others]
    found = separating(searched(right, right, right, {right.terms[-1].key: rivals}), right, NONE)
    assert found is not None
    return found


def test_a_motion_is_designed_that_separates_what_one_way_ties() -> None:
    """Friction that changes with the position or with the time: at one feed in one direction they are the same."""
    place = Term("position_dependent_friction", 0, (0.006, 1.0, 0.0))
    train = runs(ONE_WAY, place)
    first = fitted(Hypothesis(OWNER, (place,)), train)
    second = fitted(Hypothesis(OWNER, (Term("friction_drift", 0, (0.006, 2.0)),)), train)
    assert abs(bic_gain(first, second)) < TIED
    found = designed(first, second)
    assert found.profile is not None
    assert found.separates == ("friction_drift", "position_dependent_friction")
    assert "is expected to distinguish friction drift from position dependent friction" in found.note
    for right, wrong in ((first, second), (second, first)):  # whichever of the two is true
        truth = right.terms
        both = dataset([*runs(ONE_WAY, *truth).runs, *runs(found.profile, *truth, seed=2).runs], OWNER)
        a, b = (fitted(other.hypothesis, both, evaluations=6) for other in (right, wrong))
        assert bic_gain(a, b) > 10.0 * TIED


def test_no_motion_is_promised_that_gains_nothing() -> None:
    lag = Term("current_loop_lag", 0, (1e-4,))  # of a tenth of a tick, on a motion without jerk
    train = runs(SLOW, lag)
    found = designed(
        fitted(Hypothesis(OWNER, (lag,)), train),
        fitted(Hypothesis(OWNER, (Term("transport_delay", 0, (1e-4,)),)), train),
    )
    assert found.profile is None
    assert (
        "No motion within the range of these recordings distinguishes current loop lag from transport delay"
        in found.note
    )


def test_the_same_torque_on_every_motion_needs_no_search() -> None:
    uneven = Term("asymmetric_friction", 0, (0.2,))
    train = runs(moves([REST, {"kind": "reversal", "stroke_m": 0.05, "feed_m_s": 0.1}, REST]), uneven)
    found = designed(fitted(Hypothesis(OWNER, (uneven,)), train))
    assert found.profile is None
    assert "No motion distinguishes asymmetric friction from constant load" in found.note


def test_a_cause_without_rivals_needs_no_experiment() -> None:
    play = Term("backlash", 0, (20e-6,))
    train = runs(ONE_WAY, play)
    right, nominal = fitted(Hypothesis(OWNER, (play,)), train), fitted(Hypothesis(OWNER), train)
    assert separating(searched(nominal, nominal, right), right, NONE) is None


def test_what_a_motion_hides_is_shown_by_another() -> None:
    """Friction that changes while the axis runs, on a motion of a few seconds."""
    drift = "friction_drift"
    train = runs(moves([REST, {"kind": "sine_squared", "to_m": 0.7, "feed_m_s": 0.124}, REST]))
    nominal = fitted(Hypothesis(OWNER), train)
    hidden = not_testable(nominal)
    assert {drift, "torque_saturation"} <= set(hidden)
    found = showing(nominal, hidden, NONE)
    assert found is not None
    assert found.profile is not None
    assert drift in found.separates
    assert "torque_saturation" not in found.separates  # takes more torque than these limits ever ask for
    shown = runs(found.profile, seed=2)
    assert drift not in not_testable(fitted(Hypothesis(OWNER), shown))


@pytest.mark.parametrize("travel_m", [None, (-0.06, 0.36)])
def test_candidates_keep_to_what_was_recorded(travel_m: tuple[float, float] | None, tmp_path: Path) -> None:
    assert OWNER.drive is not None
    owner = OWNER.model_copy(update={"drive": OWNER.drive.model_copy(update={"travel_m": travel_m})})
    train = runs(
        moves(
            [
                REST,
                {"kind": "sine_squared", "to_m": 0.06, "feed_m_s": 0.25},
                {"kind": "sine_squared", "to_m": 0.01, "feed_m_s": 0.1},
            ]
        ),
        believed=owner,
    )
    reached = reach(train.runs, owner)
    short, long = candidates(reached)
    assert len(short) >= 5
    assert long
    velocity = train.runs[0].velocity_command_m_s
    fastest, hardest = np.abs(velocity).max(), np.abs(np.diff(velocity)).max() / OWNER.gains.period_s
    low, high = (0.0, 0.06) if travel_m is None else (travel_m[0] + 0.003, travel_m[1] - 0.003)
    for profile in (*short, *long):
        trajectory = plan(profile, OWNER.gains.period_s)
        assert low <= trajectory.position_m.min() + 1e-12
        assert trajectory.position_m.max() - 1e-12 <= high
        assert np.abs(trajectory.velocity_m_s).max() <= fastest
        assert np.abs(trajectory.acceleration_m_s2).max() <= hardest
        write_profile(tmp_path / "profile.yaml", profile)
        assert load_profile(tmp_path / "profile.yaml") == profile


@pytest.mark.long
def test_limits_of_the_bench_count_instead_of_what_was_recorded() -> None:
    """An error of the encoder or of the screw: gently moved, the table goes wherever the motor does."""
    gentle = moves([REST, {"kind": "sine_squared", "to_m": 0.03, "feed_m_s": 0.01, "acceleration_m_s2": 0.1}, REST])
    error = Term("encoder_eccentricity", 0, (2e-4, 1.0))
    limits = SetPointLimits(velocity_m_s=0.4, acceleration_m_s2=2.2, jerk_m_s3=100.0)
    assert OWNER.drive is not None
    free = OWNER.model_copy(update={"drive": OWNER.drive.model_copy(update={"limits": limits})})
    train = runs(gentle, error)
    right = fitted(Hypothesis(OWNER, (error,)), train, evaluations=6)
    wrong = fitted(Hypothesis(OWNER, (Term("periodic_lead_error", 0, (3e-7, 4.1)),)), train, evaluations=6)
    careful = designed(right, wrong, tied=True).profile
    assert careful is None or careful.limits.velocity_m_s <= 0.01
    right, wrong = (replace(found, hypothesis=replace(found.hypothesis, bench=free)) for found in (right, wrong))
    profile = designed(right, wrong, tied=True).profile
    assert profile is not None
    assert profile.limits.model_dump() == limits.model_dump()


@pytest.mark.parametrize(
    ("change", "count"),
    [
        ({"high_m": 0.0005}, 5),
        ({"velocity_m_s": 0.004}, 3),
        ({"start_m": 0.1}, 7),
        ({"acceleration_m_s2": 0.01}, 3),
        ({"acceleration_m_s2": 0.0}, 0),
    ],
)
def test_an_axis_that_may_do_little_still_gets_candidates(change: dict[str, float], count: int) -> None:
    reached = replace(reach(runs(ONE_WAY).runs, OWNER), low_m=0.0, high_m=0.1)
    short, long = candidates(replace(reached, **change))
    assert len(short) + len(long) >= count


def test_candidates_of_a_load_that_turns_many_times_are_those_that_a_profile_may_hold() -> None:
    """A profile holds positions up to 100 m or rad, and an hour."""
    turning = replace(reach(runs(ONE_WAY).runs, OWNER), low_m=-20.0, high_m=150.0, start_m=0.0)
    short, long = candidates(turning)
    assert short or long
    assert candidates(replace(turning, start_m=120.0)) == ([], [])
