"""What `hil run` shows of a run: one line in a terminal, a scope beside it, and what to do next."""

from __future__ import annotations

import os
import pty
import re
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import pytest
import yaml
from command_line import hil, refused
from compare_runs import LIMITS, THERE_AND_BACK
from patient_bench import patient_bench_file
from processes import DEADLINE_S
from scope_process import page_of

from hil.commands import beside
from hil.scope import server
from hil.scope.page_session import PageSession
from hil.scope.server import ScopeServer, address, bound, serve
from hil.scope.status_line import line
from hil.scope.traces import traces_of


def profile(folder: Path, laps: int) -> Path:
    path = folder / "laps.yaml"
    segments = [{"kind": "repeat", "times": laps, "segments": THERE_AND_BACK}]
    path.write_text(yaml.safe_dump({"schema_version": 1, "limits": LIMITS, "segments": segments}))
    return path


def test_a_terminal_shows_the_run_in_one_line_and_what_to_do_next(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    bench = str(patient_bench_file(tmp_path))
    command = ["run", str(profile(tmp_path, 3)), "--bench", bench, "--force", "--out", "out"]
    process = subprocess.Popen(
        [sys.executable, "-m", "hil.cli", *command],
        cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs,
        env=os.environ | {"COLUMNS": "140", "TERM": "xterm"},
    )  # fmt: skip
    os.close(theirs)
    shown = b""
    try:
        while True:
            shown += os.read(ours, 4096)
    except OSError:  # EIO: the other end is closed
        pass
    os.close(ours)
    assert process.wait(DEADLINE_S) == 0
    text = shown.decode()
    lines = re.findall(
        r"(\d+) %  position (\S+) \S+  following error \S+ \S+  torque \S+ m?N m  operation enabled", text
    )
    shares = [int(share) for share, _ in lines]
    assert len(lines) >= 3
    assert shares == sorted(shares)
    assert len({position for _, position in lines}) >= 3
    assert "next: hil compare out/laps.parquet" in text


def test_without_a_terminal_there_is_no_line(tmp_path: Path) -> None:
    ran = hil(tmp_path, "run", str(profile(tmp_path, 1)), "--virtual", "--out", "out")
    assert ran.returncode == 0
    assert "%" not in ran.stderr
    assert ran.stdout.splitlines()[-1] == "next: hil compare out/laps.parquet"


def test_a_scope_beside_virtual_time_is_refused(tmp_path: Path) -> None:
    assert "hil scope FILE" in refused(tmp_path, "run", str(profile(tmp_path, 1)), "--virtual", "--scope")


def test_the_line_tells_fault_and_stop() -> None:
    traces = traces_of(("time_s", "position_command_m", "motor_position_m", "force_n"), {})
    told = {"state": "fault", "fault": "0x8611 following error", "stopping": True, "newest": {"force_n": 2.0}}
    assert line(told, traces) == "force 2.00 N  fault, stopping  0x8611 following error"


def free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port: int = taken.getsockname()[1]
        return port


def test_a_scope_is_started_once(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(beside, "SCOPE_PORT", free_port())
    process = beside.scope_beside()
    assert process is not None
    try:
        first = capsys.readouterr().out.strip()
        assert first == f"scope: http://127.0.0.1:{beside.SCOPE_PORT}/"
        with urllib.request.urlopen(first.removeprefix("scope: ")) as page:
            assert b"hil scope" in page.read()
        assert beside.scope_beside() is None
        assert capsys.readouterr().out.strip() == f"{first} (it runs already)"
    finally:
        process.terminate()
        process.wait(DEADLINE_S)


def test_a_port_of_another_program_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        monkeypatch.setattr(beside, "SCOPE_PORT", taken.getsockname()[1])
        with pytest.raises(beside.HilError, match="without --scope"):
            beside.scope_beside()


def test_a_scope_beside_a_run_ends_when_no_page_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "UNWATCHED_S", 0.5)
    run = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    listening = bound("127.0.0.1", 0)
    served = ScopeServer(lambda page: PageSession(live=lambda: None, about={"page": page, "saves": False}), None)
    thread = threading.Thread(target=serve, args=(served, listening, run.pid))
    thread.start()
    with page_of(address(listening, "")):
        run.communicate(b"\n", timeout=DEADLINE_S)
        time.sleep(1.5)
        assert thread.is_alive()
    thread.join(DEADLINE_S)
    assert not thread.is_alive()
    listening.close()
