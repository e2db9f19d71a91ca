"""Set-points of the shipped profiles and of motions that start from any state."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hil.errors import FieldError, InputError
from hil.motion.pieces import MotionLimits
from hil.motion.profile import load_profile
from hil.motion.trajectory import Trajectory, plan, stop_from

PROFILES = Path(__file__).parents[3] / "profiles"
SHIPPED = sorted(PROFILES.glob("*.yaml"))
PERIOD_S = 0.001
LIMITS = MotionLimits(0.3, 2.0, 100.0)


def planned(name: str, period_s: float = PERIOD_S, start_m: float | None = None) -> Trajectory:
    return plan(load_profile(PROFILES / f"{name}.yaml"), period_s, start_m)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.parametrize("period_s", [0.001, 0.0007])
def test_a_shipped_profile_holds_its_limits_and_is_consistent(path: Path, period_s: float) -> None:
    profile = load_profile(path)
    t = plan(profile, period_s)
    assert t.time_s == pytest.approx(np.arange(len(t)) * period_s, abs=0)
    for values, limit in zip(
        (t.velocity_m_s, t.acceleration_m_s2, t.jerk_m_s3), profile.limits.model_dump().values(), strict=True
    ):
        assert np.abs(values).max() <= limit * (1 + 1e-9)
    assert profile.position_min_m is not None
    assert profile.position_max_m is not None
    assert profile.position_min_m <= t.position_m.min() < t.position_m.max() <= profile.position_max_m
    assert abs(t.position_m[-1] - profile.runs[-1].move.end_m) <= 1e-9
    assert (t.velocity_m_s[-1], t.acceleration_m_s2[-1], t.jerk_m_s3[-1]) == (0, 0, 0)
    # each derivative integrates to the one above it: trapezoid, whose error the next derivative bounds
    limits = profile.limits
    for value, slope, bound in (
        (t.position_m, t.velocity_m_s, limits.jerk_m_s3 * period_s**3 / 4),
        (t.velocity_m_s, t.acceleration_m_s2, 2 * limits.jerk_m_s3 * period_s),
    ):
        step = np.diff(value) - (slope[1:] + slope[:-1]) / 2 * period_s
        assert np.abs(step).max() <= bound * (period_s if value is t.velocity_m_s else 1)


def at_constant_feed(t: Trajectory) -> NDArray[np.bool_]:
    return (t.acceleration_m_s2 == 0) & (t.jerk_m_s3 == 0) & (t.velocity_m_s != 0)


def test_the_reference_moves_are_those_of_the_source() -> None:
    slow, fast, lowered = (planned(f"reference_100mm_{feed}") for feed in (7, 22, 30))
    for trajectory, feed_m_min in ((slow, 7), (fast, 22)):
        assert trajectory.velocity_m_s.max() * 60 == pytest.approx(feed_m_min, rel=1e-4)
        assert trajectory.position_m.max() == pytest.approx(0.1, abs=1e-9)
        assert trajectory.notes == ()
    constant = [np.mean(at_constant_feed(t)[t.segment == 1]) for t in (slow, fast, lowered)]
    assert constant[0] > 0.8
    assert 0 < constant[1] < 0.1  # "very little time at constant feed"
    assert constant[2] == 0
    assert 22 < lowered.velocity_m_s.max() * 60 < 25
    assert lowered.notes[0].startswith("segments[1]: feed lowered from 0.5 m/s (30 m/min) to ")
    assert lowered.position_m.max() == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("name", ["reference", "identification"])
def test_laps_repeat_sample_by_sample(name: str) -> None:
    t = planned(name)
    pieces = {(run.name, run.lap): t.position_m[t.segment == index] for index, run in enumerate(t.runs)}
    repeated = [key for key in pieces if key[1] > 0]
    assert repeated
    for place, lap in repeated[:-1]:  # the last run of all has one sample more
        assert np.array_equal(pieces[place, lap], pieces[place, 0])
    starts = np.array([run.start_s for run in t.runs])
    assert starts / 0.004 == pytest.approx(np.round(starts / 0.004), abs=1e-9)  # the position loop's period


def test_a_feed_sweep_has_both_directions_at_every_feed() -> None:
    t = planned("friction_sweep")
    constant = t.velocity_m_s[at_constant_feed(t)]
    feeds, counts = np.unique(np.round(constant, 9), return_counts=True)
    expected = (0.002, 0.005, 0.01, 0.02, 0.04, 0.07, 0.11, 0.16, 0.22, 0.3)
    assert feeds.tolist() == sorted(sign * feed for feed in expected for sign in (-1, 1))
    assert counts.min() >= 0.7 / PERIOD_S
    assert len(t.notes) == 1
    assert "0.3 m/s: constant feed shortened" in t.notes[0]


def test_standing_elsewhere_an_approach_comes_first() -> None:
    home, away = planned("reference"), planned("reference", start_m=0.05)
    assert away.runs[0].kind == "approach"
    assert away.position_m[0] == 0.05
    first = int(np.argmax(away.segment == 1))
    assert away.position_m[first:] == pytest.approx(home.position_m, abs=1e-15)
    with pytest.raises(InputError, match=r"start_m: given positions from 0 to 0\.5 m, allowed -0\.05 to 0\.35 m"):
        planned("reference", start_m=0.5)
    with pytest.raises(InputError, match="given nan, allowed a finite number"):
        planned("reference", start_m=float("nan"))


def test_a_period_must_be_positive_and_short_enough_for_the_band() -> None:
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(FieldError, match=r"period_s: given .*, allowed a positive number"):
            planned("reference", bad)
    with pytest.raises(FieldError, match=r"segments\[1\]: given 60 Hz at a control period of 0\.005 s, allowed up"):
        planned("chirp", 0.005)


def test_set_points_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        planned("jog").position_m[0] = 1.0


def test_a_stop_in_the_middle_of_a_move_begins_where_the_axis_is() -> None:
    t = planned("reference_100mm_22")
    k = int(np.argmax(t.velocity_m_s))
    s = stop_from(t.position_m[k], t.velocity_m_s[k], t.acceleration_m_s2[k], LIMITS, PERIOD_S)
    assert (s.position_m[0], s.velocity_m_s[0]) == (t.position_m[k], t.velocity_m_s[k])  # 0.37 m/s, beyond 0.3
    assert s.velocity_m_s[-1] == 0
    assert np.abs(s.acceleration_m_s2).max() <= 2.0 * (1 + 1e-9)
    assert (np.diff(s.velocity_m_s) <= 1e-12).all()


def test_a_state_far_beyond_the_limits_is_refused() -> None:
    limits = MotionLimits(0.0016, 1e-3, 5.2)
    with pytest.raises(InputError, match=r"stop: given MotionState\(.*, allowed up to 3600 s; raise the limits"):
        stop_from(0.0, 10.0, 0.0, limits, PERIOD_S)


@pytest.mark.parametrize("state", [(float("nan"), 0, 0), (0, float("inf"), 0), (0, 0, float("nan"))])
def test_states_must_be_finite(state: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="allowed a finite number"):
        stop_from(*state, LIMITS, PERIOD_S)


def test_the_module_is_light_to_import() -> None:
    code = (
        "import sys, hil.motion.trajectory; heavy = {'scipy', 'matplotlib', 'pyarrow', 'bokeh', 'pydantic', 'yaml'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
