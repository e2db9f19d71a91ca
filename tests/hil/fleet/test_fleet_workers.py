"""Own workers that are replaced while recordings run: nothing is lost nor done twice."""

from __future__ import annotations

import json
import os
from functools import partial
from pathlib import Path
from time import sleep

import pytest
from distributed import get_worker

from hil.fleet.engine import Engine, StageOfWork, WorkItem, columns
from hil.fleet.store import Row, Store
from hil.workers.cluster import own_cluster

ITEM_S, ITEMS, LAST = 0.05, 60, ("03", "31", "44")  # items within which the lifetime of their worker ends


def worked_on(folder: Path, item: WorkItem) -> Row:
    """Stands for a recording; some end the lifetime of their worker, by what its timer calls."""
    with (folder / "log").open("a", encoding="utf-8") as file:
        file.write(json.dumps([item.id, os.getpid()]) + "\n")
    if item.id in LAST and not (folder / item.id).exists():
        (folder / item.id).touch()
        worker = get_worker()
        worker.loop.add_callback(worker.close_gracefully, restart=True, reason="worker-lifetime-reached")
    sleep(ITEM_S)
    return {}


@pytest.mark.long
def test_workers_that_are_replaced_lose_no_recording_and_do_none_twice(tmp_path: Path) -> None:
    results = Store(str(tmp_path / "out"))
    items = [WorkItem(f"{at:02d}", f"axis-{at % 3}", f"file-{at}") for at in range(ITEMS)]
    told = list[int]()
    with own_cluster(2) as workers:
        engine = Engine(results, lambda: workers, lambda stage, done, of, left_s: told.append(done))
        rows = engine.run(StageOfWork("tried", columns(), partial(worked_on, tmp_path)), items)
    begun = [json.loads(line) for line in (tmp_path / "log").read_text(encoding="utf-8").splitlines()]
    assert len({pid for _, pid in begun}) >= 3  # two at first, and one that took over
    assert [row["id"] for row in rows] == [item.id for item in items]
    assert {row["status"] for row in rows} == {"good"}
    assert told[-1] == ITEMS
    assert sorted(row["id"] for row in results.rows("tried")) == [item.id for item in items]
    assert results.names("parts/tried") == []
    assert len(begun) - ITEMS <= len(LAST)  # again at most what a worker had begun, and not written, at its end
