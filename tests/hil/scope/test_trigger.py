"""Level, slope and events; pre-trigger rows at the rate of the loop; the same row however the rows are cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from drivers.cia402 import DriveState
from hil.scope.capture import Still, Waiting
from hil.scope.messages import Arm
from hil.scope.rows import FixedRows, RowBlock
from hil.scope.traces import traces_of
from hil.scope.trigger import ScopeEvent, Slope, beginnings, crossings

PERIOD_S = 1e-3
TRACES = arrays(np.float64, st.integers(2, 60), elements=st.integers(-3, 3).map(float))


@given(TRACES, st.floats(-3.0, 3.0), st.sampled_from(Slope))
def test_a_level_is_passed_where_two_rows_lie_on_its_sides(values: np.ndarray, level: float, slope: Slope) -> None:
    expected = []
    for row in range(1, len(values)):
        before, after = values[row - 1], values[row]
        rises, falls = before < level <= after, before > level >= after
        if (rises and slope is not Slope.FALLING) or (falls and slope is not Slope.RISING):
            expected.append(row)
    assert crossings(values, level, slope).tolist() == expected


@pytest.mark.parametrize(
    ("event", "rows"),
    [
        (ScopeEvent.FAULT, [3]),
        (ScopeEvent.STATE, [1, 3, 4]),
        (ScopeEvent.SEGMENT, [2, 5]),
        (ScopeEvent.STOP, [5]),
    ],
)
def test_events_begin_at_their_row(event: ScopeEvent, rows: list[int]) -> None:
    state = [DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED, DriveState.OPERATION_ENABLED]
    state += [DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT, DriveState.FAULT]
    columns = {
        "time_s": np.arange(6) * PERIOD_S,
        "drive_state": np.array(state, float),
        "drive_error_code": np.array([0, 0, 0, 0x2310, 0x2310, 0x2310], float),
        "segment": np.array([0, 0, 1, 1, 1, -1], float),
    }
    assert beginnings(columns, event).tolist() == rows


def test_a_recording_without_state_has_no_events() -> None:
    columns = {"time_s": np.arange(5) * PERIOD_S}
    assert not any(beginnings(columns, event).size for event in ScopeEvent)


class GrowingRows:
    """Rows that come in pieces; `end` is how many have come."""

    name, period_s, metadata = "growing", PERIOD_S, dict[str, object]()

    def __init__(self, torque: np.ndarray) -> None:
        time_s = np.arange(len(torque)) * PERIOD_S
        columns = {"time_s": time_s, "motor_position_rad": np.cumsum(torque), "torque_n_m": torque}
        self.rows = FixedRows("all", columns, PERIOD_S)
        self.channels, self.first, self.end, self.ended = self.rows.channels, 0, 0, False

    def read(self, first: int, end: int) -> RowBlock:
        return self.rows.read(first, min(end, self.end))


def captured(torque: np.ndarray, arm: Arm, pieces: list[int]) -> Still | None:
    rows = GrowingRows(torque)
    traces, waiting = traces_of(rows.channels, {}), Waiting(arm, 0)
    for piece in pieces:
        rows.end = min(rows.end + piece, len(torque))
        if (found := waiting.look(rows, traces)) is not None:
            return found
    rows.end, rows.ended = len(torque), True
    return waiting.look(rows, traces)


@given(TRACES, st.sampled_from(["torque_n_m", "difference_motor"]), st.lists(st.integers(1, 7), max_size=20))
def test_the_capture_does_not_depend_on_how_the_rows_come(torque: np.ndarray, trace: str, pieces: list[int]) -> None:
    arm = Arm(do="arm", trace=trace, level=0.5, pre_s=0.004, post_s=0.006)
    at_once, in_pieces = captured(torque, arm, []), captured(torque, arm, pieces)
    if at_once is None:
        assert in_pieces is None
        return
    assert in_pieces is not None
    assert in_pieces.zero_s == at_once.zero_s
    for name in ("time_s", "torque_n_m"):
        shown = [still.rows.read(still.first, still.end).columns[name] for still in (at_once, in_pieces)]
        assert np.array_equal(*shown)


def test_every_row_before_and_after_the_trigger_is_captured() -> None:
    torque = np.zeros(1000)
    torque[400:] = 2.0
    still = captured(torque, Arm(do="arm", trace="torque_n_m", level=1.0, pre_s=0.1, post_s=0.2), [100] * 10)
    assert still is not None
    assert still.zero_s == pytest.approx(0.4)
    assert (still.first, still.end) == (300, 601)
    assert np.allclose(np.diff(still.rows.read(still.first, still.end).columns["time_s"]), PERIOD_S)


def test_a_run_that_ends_gives_what_came_after_the_trigger() -> None:
    torque = np.r_[np.zeros(50), np.ones(20)]
    still = captured(torque, Arm(do="arm", trace="torque_n_m", level=1.0, pre_s=0.01, post_s=10.0), [60])
    assert still is not None
    assert (still.first, still.end) == (40, 70)
