"""Windows of force in a simulated recording: found with edges and height, and none where none is."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, evaluated, fitted, recorded
from emps_windows import EDGE_S, windows

from hil.diagnosis.search.event_detection import detect
from hil.diagnosis.search.events import event_term
from hil.diagnosis.search.events_everywhere import with_events
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.identification.window_fit import fit_windows

OWNER = bench()


@pytest.mark.parametrize("push", [(150.0, 0.4, 0.7), (-150.0, 0.4, 0.7)], ids=["forwards", "backwards"])
def test_a_window_is_detected_and_its_fit_has_edges_and_force(push: tuple[float, float, float]) -> None:
    given = evaluated(Hypothesis(OWNER), [take(recorded(OWNER, Term("external_force", 0, push), times=3), OWNER)])
    term = event_term("external_force", detect(given), 1.0)
    found = fit_windows(given.estimator.evaluate(given.hypothesis.with_term(term)))
    ((start_s, end_s, force_n),) = windows(found)
    assert (start_s, end_s) == pytest.approx(push[1:], abs=EDGE_S)
    assert force_n == pytest.approx(push[0], rel=0.02)


def test_a_window_of_the_held_out_part_is_found_there() -> None:
    plain = fitted(Hypothesis(OWNER), [take(recorded(OWNER, times=3), OWNER)])
    push = Term("external_force", 0, (150.0, 0.4, 0.7))
    pushed = take(recorded(OWNER, push, seed=2, name="other", times=3), OWNER)
    found = with_events(plain, dataset([pushed], OWNER))
    ((start_s, end_s, force_n),) = windows(found)
    assert (start_s, end_s) == pytest.approx((0.4, 0.7), abs=EDGE_S)
    assert force_n == pytest.approx(150.0, rel=0.02)


def test_an_axis_as_believed_has_no_event() -> None:
    assert detect(evaluated(Hypothesis(OWNER), [take(recorded(OWNER, times=2), OWNER)])) == []


def test_edges_of_a_window_are_where_the_axis_moves() -> None:
    """At rest friction holds a force, and its window may begin anywhere."""
    run = take(recorded(OWNER, Term("external_force", 0, (100.0, 1.42, 2.0))), OWNER)
    moves = np.abs(np.gradient(run.motor, run.period_s)) > 1e-3
    found = detect(evaluated(Hypothesis(OWNER), [run]))
    assert found
    for event in found:
        for edge_s in (event.start_s, event.end_s):
            assert moves[np.abs(run.time_s - edge_s) < 0.02].any()


def test_without_an_event_the_held_out_part_gets_none() -> None:
    run = take(recorded(OWNER), OWNER)
    plain = fitted(Hypothesis(OWNER), [run])
    assert with_events(plain, dataset([take(recorded(OWNER, seed=2), OWNER)], OWNER)) is plain
