"""Every recording carries how punctual its loop was; a request to end by the terminal stops the axis under control."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from bench_runs import MOVE, bench_with
from patient_bench import patient_bench, patient_bench_file
from processes import DEADLINE_S, wait_for

from drivers.cia402 import DriveState
from hil.bench.hardware import DriveSection
from hil.loop.certificate import before_run, of_rows, of_run
from hil.loop.disturbances import Disturbances
from hil.loop.realtime import NotArmed
from hil.loop.run import run_profile
from hil.recording.recording import read_recording

PROFILE = Path(__file__).parents[3] / "profiles" / "friction_sweep.yaml"


def certificate(recording: Path | None) -> dict[str, Any]:
    assert recording is not None
    return read_recording(recording).metadata["real_time"]


def test_a_run_by_the_wall_clock_carries_the_certificate(tmp_path: Path) -> None:
    ran = run_profile(patient_bench(), MOVE, tmp_path, "run", force=True)
    found = certificate(ran.recording)
    lateness_s = pq.read_table(ran.recording).column("lateness_s").to_numpy()  # without rows that a reader interpolates
    assert found["clock"] == "wall"
    assert found["period_s"] == 0.001
    assert found["budget"] == {"jitter_p99_s": 0.0005, "bus_load": 0.7}
    assert found["bus_load"] == pytest.approx(0.455, abs=0.01)  # SYNC 55, RPDO 95, TPDOs 135 and 75, encoder 95 bits
    assert {"kernel", "preempt_rt", "governor", "cores"} <= set(found["machine"])
    assert found["jitter_before_arming"]["ticks"] > 0
    run = found["run"]
    assert run["ticks"] >= len(lateness_s)
    assert run["max_s"] >= lateness_s.max()
    assert run["missed"] >= (lateness_s >= 0.001).sum()
    assert run["skipped"] == ran.outcome.skipped
    assert set(run) >= {"p50_s", "p99_s", "page_faults", "preemptions", "collections", "threads"}
    assert run["collections"] == 0


def test_a_run_in_virtual_time_says_so(tmp_path: Path) -> None:
    found = certificate(run_profile(bench_with(), MOVE, tmp_path, "run", virtual=True).recording)
    assert found["clock"] == "virtual"
    assert (found["run"]["max_s"], found["run"]["missed"], found["run"]["skipped"]) == (0.0, 0, 0)
    assert "page_faults" not in found["run"]


def test_a_run_that_fails_carries_it_as_well(tmp_path: Path) -> None:
    bench = bench_with(drive={"missed_answers": 0, "interface": "virtual", "channel": "certificate"})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hil.loop.session.Session._loop", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            run_profile(bench, MOVE, tmp_path, "run", virtual=True)
    assert list(tmp_path.iterdir()) == []  # without a row no file


def test_a_bench_may_allow_to_arm_above_its_budget_and_the_recording_says_so(tmp_path: Path) -> None:
    with pytest.raises(NotArmed, match=r"The drive was not armed: raise .* or say drive.watch_setpoint: false, or arm"):
        run_profile(bench_with(drive={"bitrate": 250_000}), MOVE, tmp_path, "run", virtual=True)
    bench = bench_with(drive={"bitrate": 250_000, "over_budget": "arm"})
    ran = run_profile(bench, MOVE, tmp_path, "run", virtual=True)
    assert len(ran.doubts) == 1
    assert ran.doubts[0].endswith("the drive was armed all the same, as --force or drive.over_budget asks")
    assert "not armed" not in ran.doubts[0]
    assert read_recording(ran.recording).metadata["overridden"] == list(ran.doubts)


@pytest.mark.parametrize("first", [0, 100, 1000, 123_456])
def test_the_certificate_of_rows_counts_the_ticks_between_them(first: int) -> None:
    """Ticks times the period are rounded: three periods from 0.1 s on come out as less than three."""
    columns = {"time_s": (first + np.array([0, 1, 2, 5, 6, 8])) * 1e-3, "lateness_s": np.array([0.0] * 5 + [1.5e-3])}
    metadata = {"period_s": 0.001, "real_time": {"clock": "wall"}}
    found = of_rows(columns, metadata)["real_time"]
    assert found["clock"] == "wall"
    assert (found["run"]["ticks"], found["run"]["skipped"], found["run"]["missed"]) == (6, 3, 1)
    assert metadata["real_time"] == {"clock": "wall"}
    assert of_rows({"time_s": columns["time_s"]}, metadata) == {}
    assert of_rows(columns, {"period_s": 0.001}) == {}


def test_the_certificate_before_a_run_has_what_the_machine_granted() -> None:
    section = DriveSection(jitter_p99=0.25, bus_load=0.5)
    virtual = before_run(0.002, 0.4, section, None)
    assert virtual == {"clock": "virtual", "period_s": 0.002, "bus_load": 0.4,
                       "budget": {"jitter_p99_s": 0.0005, "bus_load": 0.5}}  # fmt: skip
    assert before_run(0.002, 0.4, section, {"machine": 1}) == virtual | {"clock": "wall", "machine": 1}
    counted = of_run([0.0, 0.0], 4, 0.002, Disturbances(5, 6, 7, 8))["run"]
    assert [counted[name] for name in ("ticks", "skipped", "page_faults", "threads")] == [2, 4, 5, 8]


# -- the terminal is closed -------------------------------------------------------------------------------------------


@pytest.fixture
def running(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[bytes], int, Path]]:
    """`hil run` in a terminal of its own, moving; the process, the terminal's other end, its stream."""
    ours, theirs = pty.openpty()
    # SIGHUP as in a terminal, also where the tests run under nohup
    start = (
        "import os, signal, sys; signal.signal(signal.SIGHUP, signal.SIG_DFL); os.login_tty(int(sys.argv[1])); "
        "os.execv(sys.executable, [sys.executable, *sys.argv[2:]])"
    )
    bench = str(patient_bench_file(tmp_path))
    command = ["-m", "hil.cli", "run", str(PROFILE), "--bench", bench, "--force", "--out", str(tmp_path)]
    process = subprocess.Popen([sys.executable, "-c", start, str(theirs), *command], pass_fds=[theirs])
    os.close(theirs)
    try:
        stream = tmp_path / "friction_sweep.arrows"
        wait_for(lambda: stream.exists() and stream.stat().st_size > 100_000)
        yield process, ours, tmp_path / "friction_sweep.parquet"
    finally:
        process.kill()
        process.wait()


def assert_stopped_under_control(path: Path) -> None:
    recording = read_recording(path)
    assert recording.metadata["ended"] == "interrupted: stopped by the user"
    assert recording["segment"][-1] == -1
    assert DriveState.QUICK_STOP_ACTIVE not in recording["drive_state"]
    # the set-points are at rest; the axis follows some time after a stall of the machine
    assert np.ptp(recording["position_command_m"][-20:]) < 1e-5


def test_sighup_stops_the_axis_under_control(running: tuple[subprocess.Popen[bytes], int, Path]) -> None:
    process, ours, path = running
    process.send_signal(signal.SIGHUP)
    code = process.wait(DEADLINE_S)
    assert_stopped_under_control(path)
    assert code == 130
    os.close(ours)


def test_a_terminal_that_is_closed_stops_the_axis_under_control(
    running: tuple[subprocess.Popen[bytes], int, Path],
) -> None:
    process, ours, path = running
    os.close(ours)  # the kernel sends SIGHUP, and nothing can be printed any more
    process.wait(DEADLINE_S)
    assert_stopped_under_control(path)
