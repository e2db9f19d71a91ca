"""Forces in windows of time: they act in their recording only, and a blow is told from what repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, evaluated, recorded

from hil.diagnosis.acceptance import is_event
from hil.diagnosis.search.events import inside_windows
from hil.diagnosis.verdict.corrections import diagnosed_bench
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term, Window
from hil.identification.window_fit import fit_windows

OWNER = bench()
PUSHES = (Term("external_force", 0, (150.0, 0.5, 0.8)),)
TWICE = Term("external_force", 0, (150.0, 0.5, 0.7), windows=(Window("run"), Window("run", 0.45, 0.55, -0.5)))


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
        assert is_event(inside_windows(found, base)) == (len(starts_s) == 1)


def test_windows_at_each_acceleration_are_told_from_windows_anywhere() -> None:
    """On a drive of constant feeds, where the axis accelerates in a small part of the time."""
    run = take(recorded(OWNER), OWNER)
    steps = np.repeat(np.tile([0.1, -0.1], run.time_s.size), 200)[: run.time_s.size]
    run = replace(run, velocity_command_m_s=np.convolve(steps, np.ones(10) / 10.0, "same"))
    base = evaluated(Hypothesis(OWNER), [run])
    turns_s = run.time_s[200:-200:200]

    def chance(shift_s: float) -> float:
        windows = tuple(
            Window("run", at_s + shift_s - run.time_s[0], at_s + shift_s - run.time_s[0]) for at_s in turns_s
        )
        start_s = float(run.time_s[0])
        term = Term("external_force", 0, (100.0, start_s - 0.002, start_s + 0.003), windows=windows)
        seen = inside_windows(evaluated(Hypothesis(OWNER, (term,)), [run]), base)
        assert seen is not None
        return seen.chance

    assert chance(0.0) < 1e-6
    assert chance(100 * run.period_s) == 1.0


def test_the_diagnosed_bench_expects_no_event() -> None:
    run = take(recorded(OWNER), OWNER)
    found = evaluated(Hypothesis(OWNER, (TWICE, Term("cogging_torque", 0, (0.1, 6.0, 0.2)))), [run])
    assert [entry.effect for entry in diagnosed_bench(OWNER, found).mechanisms] == ["cogging_torque"]
