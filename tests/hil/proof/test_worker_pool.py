"""Processes that do cases side by side: how they end, and what they are given."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from processes import DEADLINE_S, is_over, wait_for

from hil.errors import InputError
from hil.proof.answer.worker_pool import cases_in

# Two cases, each of which says which process works at it and would take longer than anybody waits.
WORK = """
import os, time
from pathlib import Path
from hil.proof.answer.worker_pool import side_by_side

def work(place):
    (place / "part").write_text(str(os.getpid()))
    (place / "part").rename(place / "pid")
    time.sleep(300.0)

if __name__ == "__main__":
    list(side_by_side(work, [Path("one"), Path("two")], 2))
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_the_process_that_they_work_for(number: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / "work.py").write_text(WORK, encoding="utf-8")
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    pids = [tmp_path / name / "pid" for name in ("one", "two")]
    with subprocess.Popen(
        [sys.executable, "work.py"], cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        wait_for(lambda: all(path.exists() for path in pids))
        if number == signal.SIGINT:
            os.killpg(process.pid, number)  # as a terminal does
        else:
            process.send_signal(number)
        wait_for(lambda: all(is_over(int(path.read_text())) for path in pids))
        said = process.communicate(timeout=DEADLINE_S)[1]
    assert process.returncode == -number
    assert "SpawnProcess" not in said


def test_what_holds_no_cases_is_refused_with_what_is_allowed(tmp_path: Path) -> None:
    (tmp_path / "cases" / "case_0000").mkdir(parents=True)
    for folder in (tmp_path / "missing", tmp_path, tmp_path / "cases"):
        with pytest.raises(InputError, match=r"holds no cases, allowed .* DIR/cases"):
            cases_in(folder, tmp_path / "out")
    bench = tmp_path / "cases" / "case_0000" / "bench.yaml"
    bench.touch()
    assert cases_in(tmp_path / "cases", tmp_path / "out" / "deep") == [bench.parent]
    assert (tmp_path / "out" / "deep").is_dir()
    with pytest.raises(InputError, match=r"bench.yaml: cannot be made .*; give another"):
        cases_in(tmp_path / "cases", bench)
