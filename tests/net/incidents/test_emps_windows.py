"""Windows of force added to the EMPS recording: detected, fitted, and reported as one finding."""

from __future__ import annotations

from dataclasses import replace

import pytest
from emps_windows import PERIOD_S, Push, assert_found, irregular, pushed, regular, response, windows
from measured_recordings import emps

from hil.bench.bench_file import load_bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.preparation.split import split
from hil.diagnosis.search.event_detection import detect
from hil.diagnosis.search.events import event_term
from hil.diagnosis.search.events_everywhere import with_events
from hil.identification.dataset import prepare_dataset
from hil.identification.estimator import Fit
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.window_fit import fit_windows

pytestmark = pytest.mark.net


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
    found = with_events(nominal, there.data)
    assert_found(windows(found), held_out)
    assert found.cost == pytest.approx(nominal.cost)


def test_many_windows_of_any_height_do_not_count_as_noise() -> None:
    """The nominal twin lacks the offset of this axis, 3 N. Two of the weakest windows, 20 and 31 N, may be lost."""
    nominal, _, held_out, there = prepared(irregular(30, 5, 17.2, 24.3))
    found = windows(with_events(nominal, there.data))
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
    assert_found(windows(with_events(nominal, there.data)), held_out)


def test_without_an_event_the_held_out_part_of_emps_gets_none() -> None:
    nominal, *_, there = prepared([])
    assert with_events(nominal, there.data) is nominal


def test_faint_windows_are_left_for_later() -> None:
    nominal, *_ = prepared([Push(5.2, 6.4, 200.0), Push(8.6, 8.62, 30.0)])
    assert len(detect(nominal)) == 1


def diagnosed(pushes: list[Push], name: str = "emps_symmetric") -> Diagnosis:
    return diagnose([pushed(pushes)], [], load_bench(name))


MISFIT_N = 2.0  # twice the force that the best model leaves on EMPS: a short window of its own force is known to it


def assert_one_finding(found: Diagnosis, pushes: list[Push], common_n: float | None) -> None:
    """One finding holds all windows, with edges within 5 ms and a common force within 1 %."""
    (event,) = [finding for finding in found.result.missing if finding.effect == "external_force"]
    seen = [(one.start.value, one.end.value, one.strength.value) for one in event.windows]
    assert_found(seen, pushes)
    for (*_, force_n), push in zip(seen, pushes, strict=True):
        assert force_n == pytest.approx(push.force_n, abs=max(0.01 * abs(push.force_n), MISFIT_N))
    if common_n is not None:
        assert event.parameters["force_n"].value == pytest.approx(common_n, rel=0.01)
        assert len({force_n for *_, force_n in seen}) == 1
    assert found.plot("finding", 1 + found.result.missing.index(event)).axes


@pytest.mark.parametrize("name", ["emps_symmetric", "emps"])
@pytest.mark.parametrize(
    ("pushes", "common_n"),
    [
        ([Push(7.2, 7.9, -100.0)], -100.0),
        (regular(5, -60.0), -60.0),
        (regular(30, 50.0, 0.6, 24.0), 50.0),
        (irregular(30, 2), None),
        (regular(3, 60.0, 17.4, 24.0), 60.0),
    ],
    ids=["one", "five", "train", "irregular", "held out only"],
)
def test_windows_in_emps_are_one_finding(pushes: list[Push], common_n: float | None, name: str) -> None:
    found = diagnosed(pushes, name)
    assert_one_finding(found, pushes, common_n)
    train = next(finding.train for finding in found.result.missing if finding.effect == "external_force")
    assert (train is not None) == (common_n is not None and len(pushes) >= 3)


@pytest.mark.parametrize("name", ["emps_symmetric", "emps"])
def test_emps_without_added_forces_has_no_event_in_its_diagnosis(name: str) -> None:
    found = diagnose([emps()], [], load_bench(name))
    assert "external_force" not in [finding.effect for finding in found.result.missing]
