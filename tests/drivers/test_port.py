"""The port of the drives: a second protocol runs a whole session, and mypy refuses an incomplete class."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ascii_drive import AsciiDevices, AsciiDrive
from bench_runs import MOVE, ScriptedClock, bench_with

from drivers.port import BusError, DriveGoal
from hil.bench.bench_file import Bench
from hil.errors import FieldError, HilError
from hil.loop import devices
from hil.loop.bounds import make_cycle
from hil.loop.outcome import Outcome
from hil.loop.run import run_profile
from hil.loop.session import Session
from hil.loop.supervision import Ending
from hil.motion.trajectory import plan
from hil.recording.recording import Recording, read_recording
from hil.recording.writer import Recorder

INCOMPLETE = """
from drivers.port import {port}

class Incomplete({port}):
    def set_up(self) -> None: ...

{port_lower}: {port} = Incomplete()
"""


def ascii_bench(**drive: Any) -> Bench:
    """The reference bench without linear encoder, over the ASCII protocol."""
    bench = bench_with(drive={"protocol": "ascii"} | drive)
    return bench.model_copy(update={"encoders": bench.encoders.model_copy(update={"table": None})})


def session(folder: Path, trip_at: int | None = None) -> tuple[Outcome, Recording, AsciiDrive]:
    """Run the standard move over the ASCII drive; its motor trips with code 7 at tick `trip_at`."""
    opened = AsciiDevices(ascii_bench())
    period_s = opened.bench.gains.period_s
    opened.set_up()
    cycle = make_cycle(opened, 0.0)
    clock = ScriptedClock({} if trip_at is None else {trip_at: lambda: setattr(opened.motor, "trips", 7)})
    with Recorder(folder, "ascii", cycle.channels, period_s, {}, lossless=True) as recorder:
        run = Session(opened, cycle, plan(MOVE, period_s, 0.0), MOVE.motion_limits, clock, recorder)
        outcome = run.run()
    return outcome, read_recording(recorder.path), opened.drive


def test_a_session_over_a_second_protocol_is_complete_and_recorded(tmp_path: Path) -> None:
    outcome, recording, drive = session(tmp_path)
    ratio_m_rad = bench_with().gains.ratio_m_rad
    assert outcome.ending is Ending.COMPLETE
    assert outcome.rows == recording["time_s"].size == len(plan(MOVE, 1e-3, 0.0))
    assert abs(ratio_m_rad * recording["motor_position_rad"][-1] - 0.05) < 1e-4
    assert np.abs(recording["torque_n_m"]).max() > 0.01
    assert drive.goal is DriveGoal.DISABLED
    assert not drive.motor.enabled


def test_a_trip_of_a_second_protocol_ends_the_run(tmp_path: Path) -> None:
    outcome, recording, drive = session(tmp_path, trip_at=300)
    assert outcome.ending is Ending.DRIVE_FAULT
    assert "code 7" in outcome.reason
    assert recording["drive_error_code"][-1] == 7
    assert not drive.motor.enabled


def test_a_bench_file_chooses_the_protocol_by_its_registration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = ascii_bench()
    with pytest.raises(FieldError, match="given ascii, allowed canopen"):
        run_profile(bench, MOVE, tmp_path, "refused", virtual=True)
    monkeypatch.setitem(devices.PROTOCOLS, "ascii", AsciiDevices)
    ran = run_profile(bench, MOVE, tmp_path, "ascii", virtual=True)
    assert ran.complete
    assert ran.recording is not None
    recording, (by_hand_outcome, by_hand, _) = read_recording(ran.recording), session(tmp_path / "by_hand")
    assert ran.outcome.rows == by_hand_outcome.rows
    assert np.array_equal(recording["torque_n_m"], by_hand["torque_n_m"])


def test_a_driver_error_while_opening_any_protocol_is_a_hil_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(bench: object, seed: object) -> devices.Devices:
        raise BusError("cannot be opened", where="serial line /dev/absent")

    monkeypatch.setitem(devices.PROTOCOLS, "ascii", broken)
    with pytest.raises(HilError, match="serial line /dev/absent: cannot be opened"):
        devices.open_devices(ascii_bench())


def test_the_second_protocol_is_written_in_less_than_80_lines_of_drive() -> None:
    text = (Path(__file__).parent / "ascii_drive.py").read_text()
    drive = text[text.index("class AsciiDrive") : text.index("class AsciiDevices")]
    assert len(drive.splitlines()) < 80


def mypy(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", *map(str, arguments)]
    root = Path(__file__).parents[2]
    return subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("port", ["Drive", "Encoder"])
def test_mypy_and_python_refuse_an_incomplete_implementation(tmp_path: Path, port: str) -> None:
    source = INCOMPLETE.format(port=port, port_lower=port.lower())
    file = tmp_path / "incomplete.py"
    file.write_text(source)
    checked = mypy(file)
    assert checked.returncode == 1
    assert 'Cannot instantiate abstract class "Incomplete"' in checked.stdout
    with pytest.raises(TypeError, match="abstract"):
        exec(source, {})


@pytest.mark.long
def test_mypy_accepts_the_second_protocol() -> None:
    checked = mypy(Path(__file__).parent / "ascii_drive.py")
    assert checked.returncode == 0, checked.stdout
