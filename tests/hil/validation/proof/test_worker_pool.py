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
from hil.validation.proof.case_folder import cases_in

# Two cases, each of which says which process works at it and would take longer than anybody waits.
WORK = """
import os, time
from pathlib import Path
from hil.workers.pool import side_by_side

def work(place):
    (place / "part").write_text(str(os.getpid()))
    (place / "part").rename(place / "pid")
    time.sleep(300.0)

if __name__ == "__main__":
    list(side_by_side(work, [Path("one"), Path("two")], 2))
"""

THREADS = """
import os
from hil.workers.pool import completed, local

def threads(_):
    from hil.identification.parallel import POOL, THREADS
    return THREADS, POOL._max_workers

if __name__ == "__main__":
    jobs = len(os.sched_getaffinity(0))
    with local(jobs) as workers:
        print({threads for _, threads in completed(workers, threads, range(2 * jobs))})
    with local(1) as workers:
        print([threads[0] - jobs for _, threads in completed(workers, threads, [0])])
"""


def test_a_process_has_as_many_threads_as_cores(tmp_path: Path) -> None:
    (tmp_path / "threads.py").write_text(THREADS, encoding="utf-8")
    ran = subprocess.run([sys.executable, "threads.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.stdout.splitlines() == ["{(1, 1)}", "[0]"], ran.stderr


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
