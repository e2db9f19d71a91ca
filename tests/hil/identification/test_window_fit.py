"""Edges and forces of all windows in one fit."""

from __future__ import annotations

from dataclasses import replace

import pytest
from diagnosis_runs import bench, evaluated, recorded
from emps_windows import windows

from hil.diagnosis.search.events import revised
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term, Window
from hil.identification.window_fit import fit_windows, window_errors

OWNER = bench()
EDGE_S = 0.005
TWICE = Term("external_force", 0, (150.0, 0.5, 0.7), windows=(Window("run"), Window("run", 0.45, 0.55, -0.5)))


def recorded_twice() -> Fit:
    """A fit of a simulated axis with two pushes, from edges and forces that are wrong."""
    axis = Hypothesis(OWNER, (TWICE,))
    run = take(recorded(OWNER), OWNER)
    answer = axis.respond(run)
    run = replace(run, motor=answer.motor_position, table_m=answer.table_position_m)
    run = replace(run, torque_command=answer.torque_command, torque=answer.torque)
    start = replace(TWICE, values=(120.0, 0.507, 0.694), windows=(Window("run"), Window("run", 0.438, 0.56, -0.7)))
    return evaluated(Hypothesis(OWNER, (start,)), [run])


def test_edges_and_forces_of_all_windows_are_fitted_together() -> None:
    found = fit_windows(recorded_twice(), 20)
    first, second = windows(found)
    assert first == pytest.approx((0.5, 0.7, 150.0), rel=1e-3)
    assert second == pytest.approx((0.95, 1.25, -75.0), rel=1e-3)
    errors = window_errors(found, 0)
    assert errors.shape == (2, 3)
    assert errors[:, :2].max() < EDGE_S


def test_an_edge_of_a_force_that_nothing_shows_may_lie_anywhere() -> None:
    found = fit_windows(recorded_twice(), 20)
    (term,) = found.hypothesis.terms
    weak = replace(term, windows=(term.windows[0], term.windows[1]._replace(factor=1e-6)))
    errors = window_errors(found.estimator.evaluate(found.hypothesis.replaced(0, weak)), 0)
    assert errors[0, :2].max() < EDGE_S
    assert errors[1, :2].min() >= 0.4


def test_two_windows_that_touch_with_one_force_are_one() -> None:
    found = fit_windows(recorded_twice(), 20)
    (term,) = found.hypothesis.terms
    first, second = term.windows
    cut = (first._replace(end_later_s=-0.1), first._replace(later_s=0.1), second)
    split_up = found.estimator.evaluate(found.hypothesis.replaced(0, replace(term, windows=cut)))
    one, two = windows(revised(split_up))
    assert one == pytest.approx((0.5, 0.7, 150.0), rel=1e-3)
    assert two == pytest.approx((0.95, 1.25, -75.0), rel=1e-3)


def test_windows_alone_leave_the_other_parameters() -> None:
    begun = recorded_twice()
    found = fit_windows(begun, 20, others=False)
    assert found.hypothesis.values[: begun.hypothesis.nominal_count] == begun.hypothesis.values[:6]
    assert windows(found)[1][:2] == pytest.approx((0.95, 1.25), abs=1e-3)
