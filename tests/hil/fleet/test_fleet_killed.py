"""hil fleet with own workers: one is killed, then the client; the next call goes on, nothing lost, nothing twice."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from processes import is_over, wait_for

from hil.fleet.engine import Engine
from hil.fleet.fleet import CONDITION, Fleet
from hil.fleet.quantities import QUANTITIES
from hil.fleet.store import Store
from hil.workers.pool import Workers

COPIES = 3


def compare(fleet: Path, out: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hil.cli", "fleet", "compare", str(fleet), "--out", str(out), "--workers", "2"],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def workers_of(client: subprocess.Popen[str]) -> list[int]:
    children = [
        one for task in Path(f"/proc/{client.pid}/task").iterdir() for one in (task / "children").read_text().split()
    ]
    return [int(pid) for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]


@pytest.mark.long
def test_a_killed_worker_and_a_killed_client_lose_nothing(fleet: Path, tmp_path: Path) -> None:
    for at, path in enumerate(sorted(fleet.rglob("*.parquet"))):
        original = path.rename(path.with_name(f"2025-01-01_10{at:02d}.parquet"))
        for copy in range(1, COPIES + 1):
            shutil.copy(original, path.with_name(f"2025-01-{copy + 1:02d}_10{at:02d}.parquet"))
    files = len(list(fleet.rglob("*.parquet")))
    out = tmp_path / "out"

    def conditions() -> list[Path]:
        return list((out / "parts" / CONDITION).glob("*.json"))

    client = compare(fleet, out)
    wait_for(lambda: len(conditions()) >= 3 or client.poll() is not None)
    first, second = workers_of(client)
    os.kill(first, signal.SIGKILL)
    wait_for(lambda: len(conditions()) >= 8 or client.poll() is not None)
    os.killpg(client.pid, signal.SIGKILL)
    client.communicate()
    wait_for(lambda: is_over(second))
    before = {path.name: path.stat().st_mtime_ns for path in conditions()}
    assert 8 <= len(before) < files

    here = Workers(ThreadPoolExecutor(1), lambda: 1)  # any workers go on with it
    Fleet(Store(str(fleet)), Engine(Store(str(out)), lambda: here, lambda *told: None)).compare()
    rows = Store(str(out)).rows(CONDITION)
    assert len({row["id"] for row in rows}) == len(rows) == files
    assert {name.removesuffix(".json") for name in before} <= {row["id"] for row in rows}

    alike = defaultdict[str, list[Any]](list)  # copies of a recording, by whichever worker and client
    for row in rows:
        alike[row["axis"] + row["file"][-12:]].append([row[one.name] for one in QUANTITIES])
    assert all(len(each) == COPIES + 1 and all(one == each[0] for one in each) for each in alike.values())
