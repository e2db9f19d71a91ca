"""A force in a window of time, told by least squares of the torque alone: found once, and not where motion repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, dataset, evaluated, moves, recorded
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.diagnosis.search.event_detection import Event
from hil.diagnosis.search.events_everywhere import with_events
from hil.diagnosis.search.force_windows import strength_told, torque_over_time, torque_windows, windows_of
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import measured_motion
from hil.identification.measured import Measured, take
from hil.identification.structure import ResidualSeries
from hil.identification.terms import Term, Window
from hil.identification.torque_left import fit_plain

OWNER = bench()
TO_AND_FRO = [(0.06, 0.1), (0.0, 0.2), (0.04, 0.15), (0.0, 0.08)]
PROFILE = moves([{"kind": "sine_squared", "to_m": to_m, "feed_m_s": feed} for to_m, feed in TO_AND_FRO], 4)
RUN = take(recorded(OWNER, profile=PROFILE), OWNER)
MOTION = measured_motion(RUN)
SLOWEST = fit_plain(dataset([RUN], OWNER)).slowest  # type: ignore[union-attr]
SLIDING = MOTION.sliding(SLOWEST)
DURATION_S = float(RUN.time_s[-1])


def slow_noise(size: float, seed: int) -> FloatArray:
    """A torque (n,) [N m] that wanders within 50 ms."""
    white = np.random.default_rng(seed).normal(0.0, 1.0, MOTION.torque.size)
    rows = round(0.05 / RUN.period_s)
    smooth = np.convolve(white, np.ones(rows) / rows, "same")
    return np.asarray(size * smooth / np.std(smooth))


def told(torque: FloatArray, run: Measured = RUN) -> list[tuple[float, float, float]]:
    """Windows of a torque (n,) of a run: start, end [s], torque needed [N m]."""
    found = windows_of(torque_over_time([run], [ResidualSeries(torque, SLIDING)], None))
    return [(one.start_s, one.end_s, one.level) for one in found]


@settings(max_examples=25, deadline=None)
@given(st.floats(0.15, 0.55), st.floats(0.12, 0.3), st.sampled_from([-0.4, 0.4]), st.integers(0, 1000))
def test_a_window_is_told_with_its_edges_and_force(begin: float, width: float, level: float, seed: int) -> None:
    start_s, end_s = begin * DURATION_S, (begin + width) * DURATION_S
    inside = (RUN.time_s >= start_s) & (RUN.time_s < end_s)
    found = told(MOTION.torque + slow_noise(0.03, seed) + level * inside)
    assert found
    rows = RUN.time_s[inside & SLIDING]  # edges are known where the axis slides
    assert found[0][0] == pytest.approx(float(rows[0]), abs=0.02 * DURATION_S)
    assert found[0][1] == pytest.approx(float(rows[-1]), abs=0.02 * DURATION_S)
    assert found[0][2] == pytest.approx(level, abs=0.1)


@pytest.mark.parametrize("correlation_s", [0.02, 1.0, 10.0])
def test_chance_tells_no_window(correlation_s: float) -> None:
    """1 % each, however slowly the torque wanders."""
    keep, found = np.exp(-RUN.period_s / correlation_s), 0
    for seed in range(40):
        white = np.random.default_rng(seed).normal(0.0, 0.05, 3 * MOTION.torque.size)
        wander = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white)[-MOTION.torque.size :]
        found += bool(told(MOTION.torque + np.asarray(wander)))
    assert found <= 2


@pytest.mark.parametrize("size", [0.05, 0.2, 1.0])
def test_friction_that_the_plain_model_lacks_is_no_force_in_a_window(size: float) -> None:
    """It comes again with the motion."""
    moved = MOTION.moved
    bend = np.sign(moved.velocity) * np.exp(-np.abs(moved.velocity) / (0.1 * np.max(np.abs(moved.velocity))))
    place = np.sin(2.0 * np.pi * moved.position / (0.4 * np.ptp(moved.position)))
    for lacked in (bend, place, moved.direction * place):
        assert told(MOTION.torque + size * lacked + slow_noise(0.02, 3)) == []


def test_windows_are_apart_and_the_shorter_side_of_a_step_is_the_window() -> None:
    time_s = RUN.time_s
    two = 0.5 * ((time_s > 0.1 * DURATION_S) & (time_s < 0.25 * DURATION_S)) - 0.25 * (
        (time_s > 0.5 * DURATION_S) & (time_s < 0.64 * DURATION_S)
    )
    found = sorted(told(MOTION.torque + slow_noise(0.02, 1) + two))
    assert [np.sign(level) for *_, level in found] == [1.0, -1.0]
    assert found[0][1] <= found[1][0]
    ((start_s, end_s, level),) = told(MOTION.torque + slow_noise(0.02, 1) + 0.4 * (time_s < 0.8 * DURATION_S))
    assert (start_s, end_s) == pytest.approx((0.8 * DURATION_S, time_s[SLIDING][-1]), abs=0.03 * DURATION_S)
    assert level == pytest.approx(-0.4, abs=0.05)


def test_few_rows_and_values_that_are_no_numbers_tell_nothing() -> None:
    still = replace(RUN, motor=np.full(RUN.motor.size, RUN.motor[0]))
    fit = evaluated(Hypothesis(OWNER), dataset([RUN], OWNER))
    assert torque_windows(fit, fit.data.over([still])) == []
    unknown = replace(RUN, torque=np.full(RUN.torque.size, np.nan))
    assert torque_windows(fit, fit.data.over([unknown])) == []


def parts(run: Measured, share: float) -> tuple[Measured, Measured]:
    """A run in two parts, one of them its lead-in in the other."""
    cut = round(share * run.motor.size)
    return replace(run.until(cut), name="run (first part)"), replace(run, name="run (last part)", lead_in=cut)


def pushed(force_n: float, start_s: float, end_s: float) -> tuple[Measured, Measured]:
    """A push in a recording in two parts, of an axis whose second encoder and torque wander."""
    push = Term("external_force", 0, (force_n, start_s, end_s))
    recording = recorded(OWNER, push, profile=PROFILE)
    wanders = slow_noise(0.03, 2)[: len(recording)]
    return parts(take(changed(recording, torque_n_m=recording["torque_n_m"] + wanders), OWNER), 0.5)


@pytest.mark.parametrize("place", [0.2, 0.7], ids=["first part", "last part"])
def test_a_push_is_found_in_whichever_part_it_is(place: float) -> None:
    start_s, end_s = place * DURATION_S, (place + 0.15) * DURATION_S
    first, last = pushed(300.0, start_s, end_s)
    fit = evaluated(Hypothesis(OWNER), dataset([first], OWNER))
    events = torque_windows(fit, fit.data.over([first, last]))
    assert {one.run for one in events} == {(first if place < 0.5 else last).name}
    found = with_events(fit, fit.data.over([last]))
    (term,) = found.hypothesis.resolved.terms
    ((found_s, found_end_s),) = [term.edges(one) for one in term.windows]
    assert (found_s, found_end_s) == pytest.approx((start_s, end_s), abs=0.1)
    assert term.at(term.windows[0])[0] == pytest.approx(300.0, rel=0.2)


def test_parts_are_put_together_by_recording() -> None:
    first, last = pushed(300.0, 0.45 * DURATION_S, 0.6 * DURATION_S)
    others = [replace(one, name=one.name.replace("run", "other")) for one in parts(RUN, 0.5)]
    fit = evaluated(Hypothesis(OWNER), dataset([first, others[0]], OWNER))
    events = torque_windows(fit, fit.data.over([first, others[0], last, others[1]]))
    assert [one.run for one in events] == [first.name, last.name]  # a window over the cut is one in each part


def test_events_carry_the_force_on_the_axis_and_not_the_torque_that_the_drive_needs() -> None:
    first, last = pushed(300.0, 0.2 * DURATION_S, 0.35 * DURATION_S)
    fit = evaluated(Hypothesis(OWNER), dataset([first], OWNER))
    events: list[Event] = torque_windows(fit, fit.data.over([first, last]))
    ratio = OWNER.axis.ratio_m_rad
    assert [one.level / ratio for one in events] == pytest.approx([300.0], rel=0.2)


def test_a_long_window_is_an_event_only_where_the_torque_tells_it_beside_a_slow_wander() -> None:
    push = (300.0, 0.3 * DURATION_S, 0.5 * DURATION_S)
    for number, told_so in ((1.0, True), (0.0, False)):
        first, last = pushed(number * push[0], *push[1:])
        without = evaluated(Hypothesis(OWNER), dataset([first], OWNER))
        names = ((first.name, push[1:]), (last.name, push[1:]))
        windows = tuple(Window(name) for name, _ in names)
        term = Term("external_force", 0, push, windows=windows)
        assert strength_told(without, term, without.data.over([first, last])) == told_so
    short = replace(term, values=(300.0, 1.0, 1.05))
    assert strength_told(without, short, without.data.over([first, last]))  # not asked


@pytest.mark.parametrize(("share", "force_n", "told_so"), [(0.25, 300.0, True), (0.01, 0.0, False)])
def test_the_state_in_which_a_recording_begins_is_no_event(share: float, force_n: float, told_so: bool) -> None:
    """A single short window from the first row that slides on is asked too."""
    first, last = pushed(force_n, 0.0, share * DURATION_S)
    without = evaluated(Hypothesis(OWNER), dataset([first], OWNER))
    every = without.data.over([first, last])
    begin_s = float(RUN.time_s[SLIDING][0])
    term = Term("external_force", 0, (300.0, begin_s, begin_s + share * DURATION_S), windows=(Window(first.name),))
    assert strength_told(without, term, every) == told_so
