"""Detect windows of force in the EMPS recording, in the training part and in the held-out one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, evaluated, fitted, recorded
from emps_windows import PERIOD_S, Push, assert_found, emps_recording, irregular, pushed, regular, response, windows

from hil.bench.bench_file import load_bench
from hil.diagnosis.preparation.split import split
from hil.diagnosis.search.event_detection import detect
from hil.diagnosis.search.events import event_term, with_events_of
from hil.identification.dataset import prepare_dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.identification.window_fit import fit_windows

OWNER = bench()


def prepared(pushes: list[Push], name: str = "emps_symmetric") -> tuple[Fit, list[Push], list[Push], Fit]:
    """Nominal fits of the first part and of the last one, with the pushes in them; none at the cut between them."""
    owner = load_bench(name)
    first, last = ([take(part, owner) for part in parts] for parts in split([pushed(pushes)]))
    data = prepare_dataset(first, owner)
    cut_s = last[0].time_s[last[0].evaluated.start]
    assert not any(push.start_s < cut_s < push.end_s for push in pushes)
    nominal = fit_nominal_parameters(data)
    there = replace(nominal.estimator, data=data.over(last)).evaluate(nominal.hypothesis)
    return nominal, [p for p in pushes if p.end_s < cut_s], [p for p in pushes if p.start_s > cut_s], there


def test_forces_are_added_through_the_loop_as_newton_says() -> None:
    position_m, motor_n = response(3000, [Push(0.5, 2.5, 100.0)])
    assert motor_n[2000] == pytest.approx(-100.0, rel=1e-6)  # at rest again, the motor holds the force
    speed = (position_m[521] - position_m[519]) / (2.0 * PERIOD_S)
    momentum = 95.1 * speed + 203.5 * position_m[520]
    assert momentum == pytest.approx(PERIOD_S * (100.0 * 20 + motor_n[500:520].sum()), abs=0.02)


def test_emps_itself_has_no_event() -> None:
    nominal, *_, there = prepared([])
    assert detect(nominal) == []
    assert detect(there) == []


@pytest.mark.parametrize(
    "pushes",
    [[Push(5.2, 5.9, 20.0)], regular(5, -60.0), regular(30, 50.0, 0.6, 24.0), irregular(30, 2)],
    ids=["one", "five", "train", "irregular"],
)
def test_windows_in_emps_are_found_at_once(pushes: list[Push]) -> None:
    nominal, inside, *_ = prepared(pushes)
    start = nominal.estimator.evaluate(nominal.hypothesis.given)
    for _ in range(2):
        term = event_term("external_force", detect(start), 1.0)
        start = fit_windows(nominal.estimator.evaluate(nominal.hypothesis.given.with_term(term)))
    assert_found(windows(start), inside)


def test_windows_of_the_held_out_part_are_found_there() -> None:
    nominal, _, held_out, there = prepared(regular(4, 60.0, 17.4, 24.0))
    found = with_events_of(there.data, nominal)
    assert_found(windows(found), held_out)
    assert found.cost == pytest.approx(nominal.cost)


def test_many_windows_of_any_height_do_not_count_as_noise() -> None:
    """The nominal twin lacks the offset of this axis, 3 N. Two of the weakest windows, 20 and 31 N, may be lost."""
    nominal, _, held_out, there = prepared(irregular(30, 5, 17.2, 24.3))
    found = windows(with_events_of(there.data, nominal))
    assert len(held_out) - 2 <= len(found) <= len(held_out)
    for start_s, end_s, force_n in found:
        (push,) = [one for one in held_out if one.start_s < (start_s + end_s) / 2.0 < one.end_s]
        assert (start_s, end_s) == pytest.approx((push.start_s, push.end_s), abs=0.02)
        assert force_n == pytest.approx(push.force_n, abs=8.0)
    missed = [
        one for one in held_out if not any(start_s < one.end_s and one.start_s < end_s for start_s, end_s, _ in found)
    ]
    assert all(abs(one.force_n) < 35.0 for one in missed)


def test_a_window_about_a_reversal_is_found_beside_others() -> None:
    reversal_s = 18.27
    nominal, _, held_out, there = prepared(
        [Push(17.4, 17.6, 60.0), Push(reversal_s - 0.04, reversal_s + 0.03, -50.0), Push(20.5, 20.8, 60.0)]
    )
    assert [event.level > 0.0 for event in detect(there)] == [True, True]
    assert_found(windows(with_events_of(there.data, nominal)), held_out)


def test_a_row_after_a_cut_in_motion_is_evaluated() -> None:
    owner = load_bench("emps_symmetric")
    first, last = [take(part, owner) for (part,) in split([emps_recording()])]
    assert last.time_s[last.evaluated.start] == pytest.approx(first.time_s[-1] + PERIOD_S)


def test_without_an_event_the_held_out_part_gets_none() -> None:
    nominal, *_, there = prepared([])
    assert with_events_of(there.data, nominal) is nominal
    run = take(recorded(OWNER), OWNER)
    plain = fitted(Hypothesis(OWNER), [run])
    assert with_events_of(dataset([take(recorded(OWNER, seed=2), OWNER)], OWNER), plain) is plain


def test_edges_of_a_window_are_where_the_axis_moves() -> None:
    """At rest friction holds a force, and its window may begin anywhere."""
    run = take(recorded(OWNER, Term("external_force", 0, (100.0, 1.42, 2.0))), OWNER)
    moves = np.abs(np.gradient(run.motor, run.period_s)) > 1e-3
    found = detect(evaluated(Hypothesis(OWNER), [run]))
    assert found
    for event in found:
        for edge_s in (event.start_s, event.end_s):
            assert moves[np.abs(run.time_s - edge_s) < 0.02].any()


def test_faint_windows_are_left_for_later() -> None:
    nominal, *_ = prepared([Push(5.2, 6.4, 200.0), Push(8.6, 8.62, 30.0)])
    assert len(detect(nominal)) == 1
