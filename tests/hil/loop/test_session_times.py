"""How long each phase of a session lasts, what it records of time, and that it waits for late answers."""

from __future__ import annotations

from collections.abc import Callable
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from bench_runs import MOVE, MOVING, Ran, ScriptedClock, bench_with, run
from faulty_bench import FaultyBench

from drivers.cia402 import DriveState
from drivers.port import Condition, DriveGoal
from hil.errors import HilError
from hil.loop.bounds import make_cycle
from hil.loop.cycle import Samples
from hil.loop.devices import Rig
from hil.loop.session import Session
from hil.loop.stall import stalled
from hil.loop.supervision import Ending
from hil.motion.trajectory import plan

PERIOD_S = 1e-3
ARMING = 3  # a tick before the drive is enabled
ROWS = len(plan(MOVE, PERIOD_S, 0.0))


@pytest.fixture
def at(tmp_path: Path) -> FaultyBench:
    return FaultyBench(tmp_path)


def stops(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
    return {MOVING: session.ask_stop}


# -- phases -----------------------------------------------------------------------------------------------------------


def test_a_drive_that_does_not_enable_is_given_two_seconds(at: FaultyBench) -> None:
    heard: list[float] = []

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        def deafen() -> None:
            rig.nodes.drive._take_controlword = lambda now_s: None
            rig.nodes.drive.port.listen(0x205, lambda can_id, data, now_s: heard.append(now_s))

        return {1: deafen}

    with pytest.raises(HilError, match=r"did not enable within 2 s: it is SWITCH_ON_DISABLED"):
        at.run(bench_with(), events)
    shutdowns = [now_s for now_s in heard if now_s < 2.001]
    assert len(shutdowns) == 2000
    assert len(heard) <= 2002  # power is off: two answers say so, and nothing more is sent


def test_arming_that_is_late_is_told_as_such(at: FaultyBench) -> None:
    """The drive misses the master's heartbeat, which the loop did not send in time."""

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        return {2: lambda: 0.2, ARMING: lambda: rig.nodes.drive.emergency(0x8130, 0x11, 0.003)}

    with pytest.raises(HilError, match=r"the loop was 0\.2\d\d s late while the drive was armed.*allowed: 0\.0\d\d s"):
        at.run(bench_with(), events)
    with pytest.raises(HilError, match="EMCY 0x8130"):  # in time: the drive itself is the reason
        FaultyBench(at.folder / "again").run(bench_with(), lambda *given: {ARMING: events(*given)[ARMING]})


def test_a_controlled_stop_is_held_for_a_tenth_of_a_second(tmp_path: Path) -> None:
    ran = run(tmp_path, script=stops)
    stop = ran.recording["segment"] == -1
    assert ran.outcome.stop_asked
    held = stop & (ran.recording["position_command_m"] == ran.recording["position_command_m"][-1])
    assert int(held.sum()) == pytest.approx(100, abs=2)
    assert len(ran.recording) == ran.outcome.rows <= len(ran.outcome.lateness_s)


@pytest.mark.parametrize("tick", [130, MOVING])
def test_a_stop_begins_at_the_set_point_of_its_tick(tmp_path: Path, tick: int) -> None:
    """Position, velocity and acceleration go on, in the acceleration and at constant feed: the jerk keeps its limit."""
    recording = run(tmp_path, script=lambda _, session: {tick: session.ask_stop}).recording
    first = int(np.argmax(recording["segment"] == -1))
    usual = plan(MOVE, PERIOD_S, 0.0)
    assert np.array_equal(recording["position_command_m"][:first], usual.position_m[:first])
    assert recording["position_command_m"][first] == pytest.approx(usual.position_m[first], abs=1e-7)
    assert recording["velocity_command_m_s"][first] == pytest.approx(usual.velocity_m_s[first], abs=1e-4)
    jerk = np.diff(recording["acceleration_command_m_s2"][first - 3 : first + 50]) / PERIOD_S
    assert np.abs(jerk).max() < 1.05 * 100.0


def test_a_stop_for_a_following_error_begins_where_the_axis_is(tmp_path: Path) -> None:
    wall = {"effect": "external_force", "parameters": {"force_n": -9000.0, "start_s": 0.4, "end_s": 0.42}}
    ran = run(tmp_path, bench_with(simulation={"effects": [wall]}, drive={"following_error_m": 0.0005}))
    recording = ran.recording
    assert ran.outcome.ending is Ending.FOLLOWING_ERROR
    first = int(np.argmax(recording["segment"] == -1))
    error_m = recording["position_command_m"] - recording["motor_position_rad"] * 0.01 / (2.0 * np.pi)
    assert abs(error_m[first - 1]) > 0.0005
    assert abs(error_m[first]) < 0.0002
    speed_m_s = np.gradient(recording["motor_position_rad"], PERIOD_S) * 0.01 / (2.0 * np.pi)
    assert recording["velocity_command_m_s"][first] == pytest.approx(speed_m_s[first], abs=0.02)
    # the acceleration was not measured: it begins with none
    assert abs(recording["acceleration_command_m_s2"][first]) < 0.2


def test_the_first_reason_is_kept(tmp_path: Path) -> None:
    """A travel limit stays the ending when the user asks twice for a stop meanwhile."""

    def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        def ask() -> None:
            if session._phase:
                session.ask_stop()

        return dict.fromkeys(range(MOVING, MOVING + 200), lambda: ask() if session._stops_asked < 2 else None)

    ran = run(tmp_path, bench_with(drive={"travel_m": [-0.01, 0.03]}), script=script)
    assert ran.outcome.ending is Ending.TRAVEL_LIMIT
    assert "left (-0.01, 0.03) m" in ran.outcome.reason
    assert ran.outcome.stop_asked
    assert DriveState.QUICK_STOP_ACTIVE in ran.recording["drive_state"]


def test_a_quick_stop_is_recorded_until_a_tenth_of_a_second_after_power_off(tmp_path: Path) -> None:
    ran = run(tmp_path, script=lambda _, session: {MOVING: session.ask_stop, MOVING + 1: session.ask_stop})
    states = ran.recording["drive_state"]
    powered = np.flatnonzero((states == DriveState.QUICK_STOP_ACTIVE) | (states == DriveState.OPERATION_ENABLED))
    assert len(states) - 1 - powered[-1] == pytest.approx(101, abs=2)
    held = ran.recording["position_command_m"][ran.recording["segment"] == -1]
    assert np.ptp(held) == 0.0


def test_a_quick_stop_that_does_not_end_is_waited_for_two_seconds(tmp_path: Path) -> None:
    def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        read = rig.drive.read
        last = {"read": lambda now_s: read(now_s)._replace(powered=True)}

        def stop() -> None:
            rig.drive.read = last["read"]
            session.ask_stop()
            session.ask_stop()

        return {MOVING: stop, MOVING + 2030: lambda: setattr(rig.drive, "read", read)}

    ran = run(tmp_path, script=script)
    assert int((ran.recording["segment"] == -1).sum()) == pytest.approx(2000, abs=3)


@pytest.mark.parametrize(("powered", "enabled", "asked_after"), [
    ([False], False, 0), ([True, False, False], True, 0),
    ([True, False], True, 200), ([True], True, 200), ([True], False, 2200)])  # fmt: skip
def test_two_answers_in_a_row_say_that_power_is_off(
    tmp_path: Path, powered: list[bool], enabled: bool, asked_after: int
) -> None:
    """Else the drive is asked by another way, after 0.2 s; after 2 s more if it brakes: under power, not enabled."""
    questions: list[float] = []

    def script(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        read, said = rig.drive.read, cycle(powered)

        def faulty(now_s: float) -> Any:
            sample = read(now_s)
            if rig.drive.goal is not DriveGoal.DISABLED:
                return sample
            on = next(said)
            return sample._replace(powered=on, enabled=on and enabled)

        rig.drive.read = faulty
        rig.drive.confirm_off = lambda now_s: bool(questions.append(now_s)) or True
        return {}

    ran = run(tmp_path, script=script)
    assert ran.outcome.ending is Ending.COMPLETE
    assert bool(questions) == bool(asked_after)
    if asked_after:
        armed = 4  # ticks before the first row
        assert questions[0] / PERIOD_S - ROWS - armed == pytest.approx(asked_after, abs=3)


def test_the_lateness_of_every_tick_of_the_longest_run_is_kept(tmp_path: Path) -> None:
    """Arming 2 s, stop 10 s, hold 0.1 s, ramp of the drive 10 s, aftermath 0.1 s, switching off 0.2 s."""
    sessions: list[Session] = []

    def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        sessions.append(session)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(tmp_path, script=script)
    for _ in range(30_000):
        sessions[0].late.add(0.0)
    assert sessions[0].late.ticks == ROWS + 22_400


# -- time in the recording --------------------------------------------------------------------------------------------


def test_the_cycle_is_timed_without_the_lateness_of_its_tick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tick that is late by 0.3 ms, and one that is taken after seven were left out, 0.2 ms late."""
    late = {MOVING: 0.0003, MOVING + 100: 0.0068, MOVING + 107: 0.0002}
    monkeypatch.setattr(ScriptedClock, "since", lambda self, tick: late.get(tick, 0.0) + 1e-4)
    ran = run(tmp_path, script=lambda *_: {tick: lambda late_s=late_s: late_s for tick, late_s in late.items()})
    assert ran.outcome.skipped == 7
    stored = pq.read_table(tmp_path / "run.parquet")  # a reader fills the rows left out
    assert len(stored) == ROWS - 7
    assert np.allclose(stored["cycle_s"].to_numpy(), 1e-4, atol=1e-9)
    assert sorted(set(np.round(stored["lateness_s"].to_numpy(), 7)) - {0.0}) == [0.0003, 0.0072]


def test_late_answers_are_waited_for_within_the_time_of_the_bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drive and an encoder whose answers are there at the second and third look at the bus."""
    asked: list[tuple[int, float]] = []
    looks, waited_s = {"drive": 0, "encoder": 0}, list[float]()

    def may_wait(_: ScriptedClock, tick: int, span_s: float) -> bool:
        asked.append((tick, span_s))
        return True

    def script(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        def late(device: str, count: int) -> Callable[[], None]:
            read = getattr(rig, device).read

            def faulty(now_s: float) -> Any:
                looks[device] += 1
                sample = read(now_s)
                return sample._replace(age_cycles=1) if looks[device] <= count else sample

            return lambda: setattr(getattr(rig, device), "read", faulty)

        poll = rig.master.poll
        rig.master.poll = lambda now_s, timeout_s=0.0: waited_s.append(timeout_s) or poll(now_s)
        return {MOVING: late("drive", 1), MOVING + 10: late("encoder", 2)}

    monkeypatch.setattr(ScriptedClock, "may_wait", may_wait)
    ran = run(tmp_path, script=script)
    assert [wait_s for wait_s in waited_s if wait_s] == [0.1 * PERIOD_S] * 3  # a tenth of a period at a time
    assert ran.outcome.ending is Ending.COMPLETE
    assert [tick for tick, _ in asked] == [MOVING, MOVING + 10, MOVING + 10]
    assert {span_s for _, span_s in asked} == {bench_with().drive.response * PERIOD_S}


def test_the_drive_hears_the_master_from_the_first_ticks_on(at: FaultyBench) -> None:
    heard: dict[int, list[float]] = {0x080: [], 0x701: []}

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        for can_id, times in heard.items():
            rig.nodes.drive.port.listen(can_id, lambda can_id, data, now_s, times=times: times.append(now_s))
        return {}

    at.run(bench_with(), events)
    assert heard[0x080][0] == pytest.approx(PERIOD_S, abs=0.2e-3)
    assert heard[0x701][0] < 0.021
    assert np.diff(heard[0x701]).max() < 0.022  # drive.heartbeat_s of 20 ms


def test_a_stall_is_kept_with_its_time_its_row_and_the_speed_of_the_set_points(tmp_path: Path) -> None:
    sessions: list[Session] = []

    def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        sessions.append(session)
        return {MOVING: lambda: 0.0078, MOVING - 50: lambda: 0.0016}

    bench = bench_with(drive={"mode": "csv"})
    ran = run(tmp_path, bench, script=script)
    assert (ran.outcome.ending, ran.outcome.skipped) == (Ending.COMPLETE, 2 + 8)
    stored = pq.read_table(tmp_path / "run.parquet")
    ticks = np.round(stored["time_s"].to_numpy() / PERIOD_S).astype(int)
    row = int(ticks[np.argmax(np.diff(ticks) == 9) + 1])
    assert sessions[0]._stall == stalled(bench, 0.008, row, float(plan(MOVE, PERIOD_S, 0.0).velocity_m_s[row]))
    # a step of the twin more or less would be 0.1 mm; the drive holds its speed meanwhile
    assert np.abs(stored["table_position_m"].to_numpy() - stored["twin_table_position_m"].to_numpy()).max() < 5e-5


def test_ticks_left_out_at_a_constant_speed_do_not_change_the_speed_that_is_fed_back() -> None:
    """The motor's travel over eight periods is no travel of one."""
    with Rig(bench_with()) as rig:
        cycle = make_cycle(rig, 0.0)
    sample = lambda tick, skipped: Samples(0.1 * tick, 0.0, 0.0, 4, 0, 0.0, 0.0, skipped=skipped)  # noqa: E731
    for tick in range(1, 100):
        cycle.step(tick, sample(tick, 0))
    speed_m_s = cycle.velocity_m_s
    assert speed_m_s == pytest.approx(0.1 / PERIOD_S * bench_with().gains.ratio_m_rad)
    cycle.skip(100, 106, 0.1 * 107)
    for tick in range(100, 110):
        cycle.step(tick, sample(tick + 7, 7))
        assert cycle.velocity_m_s == pytest.approx(speed_m_s)


def test_a_bench_without_a_table_encoder_runs(tmp_path: Path) -> None:
    ran = run(tmp_path, bench_with(encoders={"table": None}))
    assert ran.outcome.ending is Ending.COMPLETE
    assert not ran.outcome.stop_asked
    assert "table_position_m" not in ran.recording.columns


def test_an_encoder_that_is_late_stops_nothing_and_one_that_is_stale_does(tmp_path: Path) -> None:
    def script(condition: Condition) -> Callable[[Rig, Session], dict[int, Callable[[], Any]]]:
        def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
            read = rig.encoder.read
            faulty = lambda now_s: read(now_s)._replace(condition=condition)  # noqa: E731
            return {MOVING: lambda: setattr(rig.encoder, "read", faulty)}

        return events

    assert run(tmp_path / "late", script=script(Condition.LATE)).outcome.ending is Ending.COMPLETE
    ran: Ran = run(tmp_path / "stale", script=script(Condition.LATE | Condition.STALE))
    assert ran.outcome.ending is Ending.ENCODER_FAULT
