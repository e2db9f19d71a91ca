"""What a page sees, without a network: a recording at rest, two of them, a replay, a run that rolls, wrong messages."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from compare_runs import bench_with, record
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hil.recording.recording import Recording
from hil.scope.decimation import min_max, stretch
from hil.scope.messages import frame, read_frame
from hil.scope.page_session import PageSession
from hil.scope.rows import FixedRows, ReplayedRows

NAMES = ["position_command_m", "table_position_m", "torque_n_m", "residual_torque"]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return record(tmp_path_factory.mktemp("scope"), bench_with())


def took(session: PageSession, **message: Any) -> list[tuple[dict[str, Any], np.ndarray]]:
    """What the session answers to a message."""
    answers = session.step([json.dumps(message)] if message else [])
    return [(json.loads(one), np.empty(0)) if isinstance(one, str) else read_frame(one) for one in answers]


def only(answers: list[tuple[dict[str, Any], np.ndarray]], kind: str) -> tuple[dict[str, Any], np.ndarray]:
    (found,) = [answer for answer in answers if answer[0]["kind"] == kind]
    return found


def session_of(*recordings: Recording) -> PageSession:
    session = PageSession(recordings=[FixedRows.of_recording(one) for one in recordings])
    told = only(took(session), "rows")[0]
    assert {"position_command_m", "following_error_m", "residual_torque"} <= {one["name"] for one in told["traces"]}
    return session


def see(session: PageSession, points: int = 500, **other: Any) -> list[tuple[dict[str, Any], np.ndarray]]:
    return took(session, do="see", traces=NAMES, window_s=1.0, points=points, **other)


def test_a_recording_is_shown_whole_and_reduced_by_extremes(recording: Recording) -> None:
    header, values = only(see(session_of(recording)), "view")
    step = stretch(len(recording), 500)
    assert (header["traces"], header["step"], header["still"]) == (NAMES, step, True)
    assert values.shape[1] <= 502
    assert np.array_equal(values[3], min_max(recording["torque_n_m"][None], step)[0])
    residual = recording["torque_n_m"] - recording["twin_torque_n_m"]
    assert np.array_equal(values[4], min_max(residual[None], step)[0])


def test_a_short_stretch_has_every_row(recording: Recording) -> None:
    session = session_of(recording)
    see(session)
    _, values = only(took(session, do="show", from_s=0.1, to_s=0.3), "view")
    rows = (recording["time_s"] > 0.0999) & (recording["time_s"] < 0.3019)
    assert np.array_equal(values[0], recording["time_s"][rows][: values.shape[1]])
    assert values.shape[1] in (201, 202)
    assert np.array_equal(values[1], recording["position_command_m"][rows][: values.shape[1]])


def test_the_second_recording_is_shifted(recording: Recording) -> None:
    session = session_of(recording, recording)
    see(session)
    took(session, do="show", from_s=0.1, to_s=0.3)
    _, second = only(see(session, shift_s=0.05), "second")
    assert second[0, 0] == pytest.approx(0.1)
    at = np.searchsorted(recording["time_s"], 0.0499)
    assert second[3, 0] == recording["torque_n_m"][at]


def test_measurements_are_those_of_all_rows(recording: Recording) -> None:
    session = session_of(recording)
    see(session, points=10)
    told = only(took(session, do="measure", from_s=0.2, to_s=0.25), "measured")[0]
    torque = recording["torque_n_m"][200:251]
    assert told["rows"] in (51, 52)
    assert told["traces"]["torque_n_m"]["max"] == pytest.approx(torque.max())
    assert told["traces"]["torque_n_m"]["first"] == torque[0]


def test_spectrum_and_one_over_the_other(recording: Recording) -> None:
    session = session_of(recording)
    _, spectrum = only(took(session, do="spectrum", trace="torque_n_m"), "spectrum")
    assert spectrum.shape[0] == 2
    assert spectrum[0, -1] <= 500.0
    _, pairs = only(took(session, do="xy", x="table_position_m", y="torque_n_m"), "xy")
    assert pairs[0, 0] == recording["table_position_m"][0]
    assert pairs[1, 0] == recording["torque_n_m"][0]


def test_a_trigger_in_a_recording_goes_from_one_to_the_next(recording: Recording) -> None:
    session = session_of(recording)
    see(session)
    arm = {"do": "arm", "event": "change of segment", "pre_s": 0.05, "post_s": 0.05}
    changes = recording["time_s"][1:][np.diff(recording["segment"]) != 0.0]
    for change in changes:
        answers = took(session, **arm)
        assert only(answers, "triggered")[0]["time_s"] == pytest.approx(change)
        header, values = only(answers, "view")
        assert header["zero_s"] == pytest.approx(change)
        assert values[0, 0] == pytest.approx(max(0.0, change - 0.05))
    assert "does not come" in only(took(session, **arm), "refused")[0]["text"]


def test_a_replay_brings_rows_in_time(recording: Recording) -> None:
    now = [0.0]
    session = PageSession(recordings=[FixedRows.of_recording(recording)], now_s=lambda: now[0])
    took(session)
    see(session)
    took(session, do="play", from_s=0.0, speed=2.0)
    now[0] = 0.1
    _, first = only(took(session), "view")
    assert first[0, -1] == pytest.approx(0.2, abs=0.01)
    now[0] = 0.15
    _, more = only(took(session), "append")
    assert more[0, -1] == pytest.approx(0.3, abs=0.01)
    assert more[0, 0] > first[0, -1]
    now[0] = 1e3
    answers = took(session) + took(session)
    assert [header["still"] for header, _ in answers if header["kind"] == "view"][-1]


def test_what_rolls_is_the_same_as_what_is_sent_whole(recording: Recording) -> None:
    """The points that came one after the other are those of the whole window."""
    now = [0.0]
    fixed = FixedRows.of_recording(recording)
    replayed = ReplayedRows(fixed, 0, 1.0, lambda: now[0])
    rolling = PageSession(live=lambda: replayed)  # type: ignore[arg-type, return-value]
    took(rolling)
    see(rolling, points=100)
    pieces = []
    for _ in range(20):
        now[0] += 0.0371
        pieces += [values for header, values in took(rolling) if header["kind"] in ("view", "append")]
    joined = np.hstack(pieces)
    whole = [values for header, values in see(rolling, points=100) if header["kind"] == "view"][-1]
    assert np.array_equal(joined[:, -whole.shape[1] :], whole)


def test_a_trigger_waits_on_in_the_next_run_if_that_has_its_trace(recording: Recording) -> None:
    now, present = [0.0], list[ReplayedRows]()
    session = PageSession(live=lambda: present[-1] if present else None)  # type: ignore[arg-type, return-value]
    columns = {name: recording[name] for name in ("time_s", "motor_position_rad", "table_position_m")}
    present.append(ReplayedRows(FixedRows.of_recording(recording), 0, 1.0, lambda: now[0]))
    took(session)
    took(session, do="arm", trace="table_position_m", level=0.02, pre_s=0.0, post_s=0.01)
    present.append(ReplayedRows(FixedRows("next", columns, recording.period_s), 0, 1.0, lambda: now[0]))
    assert only(took(session), "rows")[0]["name"] == "next"
    assert session.mode == "waiting"
    now[0] = 10.0
    assert only(took(session), "triggered")
    took(session, do="arm", trace="table_position_m", level=0.02, pre_s=0.0, post_s=0.01)
    del columns["table_position_m"]
    present.append(ReplayedRows(FixedRows("other", columns, recording.period_s), 0, 1.0, lambda: now[0]))
    took(session)
    assert session.mode == "rolling"


@given(arrays(np.float64, st.tuples(st.integers(0, 5), st.integers(0, 9))), st.text(max_size=20))
def test_a_frame_is_read_as_it_was_made(values: np.ndarray, text: str) -> None:
    data = frame("view", values, traces=[text])
    header, read = read_frame(data)
    assert (header["kind"], header["traces"]) == ("view", [text])
    assert np.array_equal(read, values, equal_nan=True)
    assert (len(data) - values.nbytes) % 8 == 0  # aligned, as Float64Array asks for


@pytest.mark.parametrize(
    ("message", "says"),
    [
        ("no JSON", "JSON"),
        ('{"do": "dance"}', "dance"),
        ('{"do": "show", "from_s": NaN, "to_s": 1}', "finite"),
        ('{"do": "measure", "from_s": 50, "to_s": 60}', "no rows"),
        ('{"do": "spectrum", "trace": "nothing"}', "nothing"),
        ('{"do": "see", "traces": [], "window_s": -1, "points": 5}', "greater than 0"),
        ('{"do": "arm", "trace": "torque_n_m", "level": 1e999, "pre_s": 0, "post_s": 1}', "finite"),
    ],
)
def test_a_wrong_message_is_refused_with_what_is_allowed(recording: Recording, message: str, says: str) -> None:
    session = session_of(recording)
    (refused,) = [text for text in session.step([message]) if isinstance(text, str) and '"refused"' in text]
    assert says in json.loads(refused)["text"]


def test_a_recording_of_another_program_has_traces_of_its_own() -> None:
    """A linear axis without bench, state and twin."""
    time_s = np.arange(300) * 0.002
    columns = {"time_s": time_s, "motor_velocity_m_s": np.sin(9 * time_s), "force_n": np.cos(9 * time_s)}
    session = PageSession(recordings=[FixedRows("other", columns, 0.002)])
    told = only(took(session), "rows")[0]
    assert [(one["name"], one["unit"], one["panel"]) for one in told["traces"]] == [
        ("force_n", "N", "force"),
        ("motor_velocity_m_s", "m/s", "velocity"),
    ]
