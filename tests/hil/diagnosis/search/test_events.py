"""Forces in windows of time: they act in their recording only, and are reported as one finding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, evaluated, recorded
from emps_windows import Push, assert_found, emps_recording, irregular, pushed, regular

from hil.bench.bench_file import load_bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.preparation.split import split
from hil.diagnosis.acceptance import is_constant
from hil.diagnosis.search.events import inside_windows
from hil.diagnosis.verdict.event_windows import Seen, joined
from hil.diagnosis.verdict.findings import diagnosed_bench
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term, Window
from hil.identification.window_fit import fit_windows

OWNER = bench()
PUSHES = (Term("external_force", 0, (150.0, 0.5, 0.8)),)
TWICE = Term("external_force", 0, (150.0, 0.5, 0.7), windows=(Window("run"), Window("run", 0.45, 0.55, -0.5)))


def test_the_last_part_of_a_recording_keeps_its_clock() -> None:
    recording = recorded(OWNER)
    (first,), (last,) = split([recording])
    assert last.start_s == pytest.approx(len(first) * recording.period_s)
    for part in (first, last):
        assert take(part, OWNER).time_s == pytest.approx(part["time_s"], abs=recording.period_s * 5)
    whole = recorded(OWNER, *PUSHES)
    run = take(split([whole])[0][0], OWNER)
    late = replace(run, start=run.start._replace(time_s=run.start.time_s + 10.0))
    expected = Hypothesis(OWNER, PUSHES).blocks(run, 0.002)["motor"]
    assert np.abs(expected).max() < 0.1 * np.abs(Hypothesis(OWNER, PUSHES).blocks(late, 0.002)["motor"]).max()


def test_an_event_acts_in_its_windows_of_its_recording_only() -> None:
    run = take(recorded(OWNER), OWNER)
    other = replace(run, name="other")
    with_event, without = Hypothesis(OWNER, (TWICE,)), Hypothesis(OWNER)
    assert np.array_equal(with_event.blocks(other, 0.002)["motor"], without.blocks(other, 0.002)["motor"])
    moved = np.abs(with_event.blocks(run, 0.002)["motor"] - without.blocks(run, 0.002)["motor"])
    size, quiet = moved.max(), run.time_s < 0.49
    assert moved[quiet].max() < 1e-6 * size
    assert moved[(run.time_s > 0.55) & (run.time_s < 0.65)].max() > 0.5 * size


def test_a_window_has_the_force_of_the_mechanism_with_the_same_values() -> None:
    run = take(recorded(OWNER, *PUSHES), OWNER)
    everywhere = Hypothesis(OWNER, PUSHES).blocks(run, 0.002)
    window = Hypothesis(OWNER, (replace(PUSHES[0], windows=(Window("run"),)),)).blocks(run, 0.002)
    for name, values in everywhere.items():
        assert window[name] == pytest.approx(values, abs=1e-9 * max(np.abs(values).max(), 1.0))


def blows(*starts_s: float) -> Term:
    """Half a sine of 1500 N over 0.06 s from each start, in steps."""
    steps, width_s = 12, 0.06
    shifts = [
        (start_s - starts_s[0] + k * width_s / steps, float(np.sin(np.pi * (k + 0.5) / steps)))
        for start_s in starts_s
        for k in range(steps)
    ]
    windows = tuple(Window("run", later_s, later_s, factor) for later_s, factor in shifts)
    return Term("external_force", 0, (1500.0, starts_s[0], starts_s[0] + width_s / steps), windows=windows)


def test_a_single_blow_of_any_form_is_a_force_and_repeated_ones_are_not() -> None:
    for starts_s in ((0.52,), (0.52, 0.68)):
        quiet = take(recorded(OWNER), OWNER)
        answer = Hypothesis(OWNER, (blows(*starts_s),)).respond(quiet)
        change = Hypothesis(OWNER).respond(quiet)
        run = replace(
            quiet,
            motor=quiet.motor + answer.motor_position - change.motor_position,
            table_m=quiet.table_m + answer.table_position_m - change.table_position_m,
            torque=quiet.torque + answer.torque - change.torque,
            torque_command=quiet.torque_command + answer.torque_command - change.torque_command,
        )
        base = evaluated(Hypothesis(OWNER), [run])
        windows = tuple(Window("run", start_s - starts_s[0], start_s - starts_s[0]) for start_s in starts_s)
        constant = Term("external_force", 0, (1000.0, starts_s[0] + 0.01, starts_s[0] + 0.05), windows=windows)
        found = fit_windows(evaluated(Hypothesis(OWNER, (constant,)), [run]))
        assert is_constant(inside_windows(found, base)) == (len(starts_s) == 1)


def test_the_diagnosed_bench_expects_no_event() -> None:
    run = take(recorded(OWNER), OWNER)
    found = evaluated(Hypothesis(OWNER, (TWICE, Term("cogging_torque", 0, (0.1, 6.0, 0.2)))), [run])
    assert [entry.effect for entry in diagnosed_bench(OWNER, found).mechanisms] == ["cogging_torque"]


def diagnosed(pushes: list[Push], name: str = "emps_symmetric") -> Diagnosis:
    return diagnose([pushed(pushes)], [], load_bench(name))


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


MISFIT_N = 2.0  # twice the force that the best model leaves on EMPS: a short window of its own force is known to it


@pytest.mark.long
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


@pytest.mark.long
@pytest.mark.parametrize("name", ["emps_symmetric", "emps"])
def test_emps_without_added_forces_has_no_event_in_its_diagnosis(name: str) -> None:
    found = diagnose([emps_recording()], [], load_bench(name))
    assert "external_force" not in [finding.effect for finding in found.result.missing]


def test_a_ramp_is_part_of_its_window_and_equal_neighbours_are_one() -> None:
    run = take(recorded(OWNER), OWNER)
    error = (1e-4, 1e-4, 0.1)
    ramp, push, other = (
        Seen(run, values, error) for values in ((1.0, 1.02, 20.0), (1.021, 1.8, 45.0), (1.8, 2.8, 30.0))
    )
    assert [one.values for one in joined([push, ramp, other])] == [(1.0, 1.8, 45.0), (1.8, 2.8, 30.0)]
    equal = [replace(one, values=(*one.values[:2], 40.0)) for one in (push, other)]
    assert [one.values for one in joined(equal, alike=True)] == [(1.021, 2.8, 40.0)]
    apart = [push, replace(other, values=(1.9, 2.0, 45.0)), replace(other, values=(2.0, 2.1, -45.0))]
    assert joined(apart, alike=True) == apart
