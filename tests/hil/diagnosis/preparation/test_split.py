"""Parts of a recording for training and validation: where it is cut, which moves are in training, and their clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, recorded
from linear_stage import moved

from hil.bench.bench_file import load_bench
from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.split import held_out_note, split
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import LEAD_IN, take
from hil.identification.terms import Term
from hil.recording.recording import Recording

ROWS, PERIOD_S = 6000, 1e-3
BENCH = load_bench("emps_symmetric").model_copy(
    update={"control": UnknownControl(law="unknown", velocity_period_s=PERIOD_S)}
)


def swinging(rest: bool) -> Recording:
    """A sine of 1 Hz without a row at rest, or with a rest of half a second at two thirds."""
    time_s = np.arange(ROWS) * PERIOD_S
    position = 0.1 * np.sin(2.0 * np.pi * time_s + 0.01)
    if rest:
        position[4000:4500] = 0.0
    columns = {
        "motor_position_m": position,
        "force_n": np.cos(3.0 * time_s),
        "position_command_m": position,
        "velocity_command_m_s": np.gradient(position, PERIOD_S),
    }
    return Recording("swing", columns, PERIOD_S)


def test_a_part_that_begins_in_motion_has_rows_before_it_that_are_not_evaluated() -> None:
    (train,), (held_out,) = split([swinging(rest=False)])
    assert LEAD_IN not in train.metadata
    lead = held_out.metadata[LEAD_IN]
    assert lead == len(held_out) / 2 == ROWS - len(train)
    assert held_out.start_s + lead * PERIOD_S == pytest.approx(len(train) * PERIOD_S)
    assert take(held_out, BENCH).evaluated.start == lead
    assert take(train, BENCH).evaluated.start < lead


def test_a_part_that_begins_at_rest_has_none() -> None:
    _, (held_out,) = split([swinging(rest=True)])
    assert LEAD_IN not in held_out.metadata


@pytest.fixture(scope="module")
def slow_first() -> Recording:
    return moved([(0.15, 0.06), (0.15, 0.3), (0.15, 0.6)])


def test_the_fast_moves_are_in_training(slow_first: Recording) -> None:
    (train,), (held_out,) = split([slow_first])
    assert train.start_s > held_out.start_s
    assert "stage (first part)" in held_out_note([held_out])
    fast_first = replace(slow_first, columns={name: values[::-1] for name, values in slow_first.columns.items()})
    (train,), (held_out,) = split([fast_first])
    assert train.start_s < held_out.start_s
    assert held_out_note([held_out]).endswith("validation.")


def test_the_part_held_out_lies_within_the_travel_of_the_training() -> None:
    """Swings whose last third goes on to a place where the axis was not before."""
    time_s = np.arange(ROWS) * PERIOD_S
    position = 0.1 * np.sin(2.0 * np.pi * time_s) + np.where(time_s > 4.0, 0.3 * (time_s - 4.0), 0.0)
    farther = swinging(rest=False)
    columns = farther.columns | {"motor_position_m": position, "position_command_m": position}
    (train,), (held_out,) = split([replace(farther, columns=columns)])
    assert held_out.name.endswith("(first part)")
    near = held_out["motor_position_m"]
    known = train["motor_position_m"]
    assert np.mean((near >= known.min()) & (near <= known.max())) > 0.8


def test_the_part_held_out_moves_both_ways() -> None:
    """A third is one slow feed: friction and a load would be one offset in it."""
    feeds = moved([(0.15, 0.02), (0.15, 0.06)])
    (train,), (held_out,) = split([feeds])
    position = held_out["motor_position_m"]
    assert np.max(position) - position[-1] > 0.1 * np.ptp(position)
    assert len(train) > 0.4 * len(feeds)


def test_training_moves_both_ways() -> None:
    """There and back once, with a turn on the way back: its second half alone would move one way."""
    feeds = moved([(0.15, 0.06)])
    turns_m = 0.3 * np.array([0.0, 0.0, 0.1, 0.3, 0.5, 0.3, 0.1, 0.13, 0.1, 0.0, 0.0])
    rows = np.linspace(0.0, 1.0, len(feeds))
    position = np.interp(rows, np.linspace(0.0, 1.0, turns_m.size), turns_m)
    (train,), (held_out,) = split([replace(feeds, columns=feeds.columns | {"motor_position_m": position})])
    forwards, backwards = (np.sum(np.diff(side * train["motor_position_m"]).clip(0.0)) for side in (1.0, -1.0))
    assert min(forwards, backwards) > 0.1 * np.ptp(position)
    assert held_out.start_s > train.start_s


def test_the_last_part_of_a_recording_keeps_its_clock() -> None:
    owner = bench()
    pushes = (Term("external_force", 0, (150.0, 0.5, 0.8)),)
    recording = recorded(owner)
    (first,), (last,) = split([recording])
    assert last.start_s == pytest.approx(len(first) * recording.period_s)
    for part in (first, last):
        assert take(part, owner).time_s == pytest.approx(part["time_s"], abs=recording.period_s * 5)
    whole = recorded(owner, *pushes)
    run = take(split([whole])[0][0], owner)
    late = replace(run, start=run.start._replace(time_s=run.start.time_s + 10.0))
    expected = Hypothesis(owner, pushes).blocks(run, 0.002)["motor"]
    assert np.abs(expected).max() < 0.1 * np.abs(Hypothesis(owner, pushes).blocks(late, 0.002)["motor"]).max()
