"""The stages of a fleet in this process: what is done once, what is reported, and what bad recordings change."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fsspec
import pytest

from hil.errors import HilError, InputError
from hil.fleet.engine import Engine, StageOfWork, WorkItem, columns
from hil.fleet.fleet import CONDITION, Fleet
from hil.fleet.reading import moment_of
from hil.fleet.store import RESULTS, Row, Store
from hil.recording.recording import read_recording
from hil.workers.pool import Workers

AT_WORK = list[str]()  # files of the items that `note` did


class Gone(BaseException):
    """What a task raises whose workers were ended."""


class InProcess:
    """Workers of this process, connected when there is work."""

    def __init__(self) -> None:
        self.connected = 0

    def __call__(self) -> Workers:
        self.connected += 1
        return Workers(ThreadPoolExecutor(1), lambda: 2, Gone)


def fleet_at(url: str) -> tuple[Fleet, InProcess]:
    workers = InProcess()
    store = Store(url)
    return Fleet(store, Engine(store.within(RESULTS), workers, lambda *told: None)), workers


def note(item: WorkItem) -> Row:
    AT_WORK.append(item.file)
    if item.file == "heavy":
        raise Gone
    if item.file == "broken":
        raise ZeroDivisionError("a defect")
    return {}


def test_bad_recordings_are_told_and_change_nothing_of_the_rest(fleet: Path, with_bad: Path, tmp_path: Path) -> None:
    good, _ = fleet_at(str(fleet))
    before = {row["file"]: row for row in good.compare()}
    assert {row["status"] for row in before.values()} == {"good"}
    for path in with_bad.rglob("*_2300.parquet"):
        shutil.copy2(path, fleet / path.relative_to(with_bad))
    after = {row["file"]: row for row in fleet_at(str(with_bad))[0].compare()}
    shutil.rmtree(with_bad / RESULTS)
    bad = {file: row["reason"] for file, row in after.items() if row["status"] == "bad"}
    assert len(after) - len(bad) == len(before)
    quantities = [name for name in next(iter(before.values())) if name != "id"]  # ids have the time of the file
    for file, row in before.items():
        assert [after[file][name] for name in quantities] == [row[name] for name in quantities]
    for words in ("the file is empty", "is of another axis", "has a row every 0.004 s", "Parquet"):
        assert sum(words in reason for reason in bad.values()) == 2, (words, bad)
    again = good.compare()  # with the bad ones: the good ones are kept
    assert sorted(row["id"] for row in again if row["status"] == "good") == sorted(row["id"] for row in before.values())


def test_what_is_done_is_kept_and_what_is_new_or_changed_is_added(fleet: Path) -> None:
    one, workers = fleet_at(str(fleet))
    first = one.compare()
    connected = workers.connected
    assert one.compare() == first
    assert workers.connected == connected  # nothing to do
    paths = sorted((fleet / "axis-001").glob("*.parquet"))
    paths[-1].unlink()
    shutil.copy(paths[0], fleet / "axis-001" / "2026-02-03.parquet")
    second = {row["file"]: row for row in one.compare()}
    assert set(second) == {row["file"] for row in first} - {f"axis-001/{paths[-1].name}"} | {
        "axis-001/2026-02-03.parquet"
    }
    assert {row["file"] for row in one.results.rows(CONDITION)} == set(second)
    bench = fleet / "axis-000" / "bench.yaml"
    bench.write_text(bench.read_text() + "# checked\n")
    third = {row["file"]: row["id"] for row in one.compare()}
    assert {file[:8] for file, row in second.items() if third[file] != row["id"]} == {"axis-000"}


def test_a_fleet_at_another_place_than_this_machine(fleet: Path) -> None:
    memory = fsspec.filesystem("memory")
    axis = fleet / "axis-000"
    memory.put(str(axis), "/hall/axis-000", recursive=True)
    told = fleet_at("memory://hall")[0].compare()
    shutil.rmtree(fleet / "axis-001")
    here = fleet_at(str(fleet))[0].compare()
    assert [row["coulomb_forward"] for row in told] == [row["coulomb_forward"] for row in here]
    assert memory.exists("/hall/_fleet/condition/axis=axis-000/rows.parquet")


def test_a_recording_that_ends_its_workers_is_told_and_the_others_are_done(tmp_path: Path) -> None:
    AT_WORK.clear()
    engine = Engine(Store(str(tmp_path)), InProcess(), lambda *told: None)
    items = [
        WorkItem(f"id-{at}", "axis", "heavy" if at == 7 else "broken" if at == 9 else f"file-{at}") for at in range(40)
    ]
    rows = engine.run(StageOfWork("tried", columns(), note), items)
    assert [row["id"] for row in rows] == [item.id for item in items]
    reasons = {row["file"]: row["reason"] for row in rows if row["status"] == "bad"}
    assert reasons == {
        "heavy": "ended the workers that read it, perhaps for want of memory",
        "broken": "ZeroDivisionError: a defect",
    }
    assert engine.results.names("parts/tried") == []
    assert len(engine.results.rows("tried")) == 40


def test_results_of_a_client_that_was_killed_are_taken(tmp_path: Path) -> None:
    AT_WORK.clear()
    store = Store(str(tmp_path))
    items = [WorkItem(f"id-{at}", "axis", f"file-{at}") for at in range(4)]
    for item in items[:3]:
        store.write_part("tried", {**item._asdict(), "status": "good", "reason": "kept"})
    rows = Engine(store, InProcess(), lambda *told: None).run(StageOfWork("tried", columns(), note), items)
    assert AT_WORK == ["file-3"]
    assert [row["reason"] for row in rows] == ["kept", "kept", "kept", ""]


def test_a_task_that_is_begun_again_goes_on(tmp_path: Path) -> None:
    """Its first worker was ended after two of three recordings."""
    from hil.fleet.engine import _code, do

    AT_WORK.clear()
    store = Store(str(tmp_path))
    items = [WorkItem(f"id-{at}", "axis", f"file-{at}") for at in range(3)]
    first = do(store, "tried", note, _code(), items[:2])
    again = do(store, "tried", note, _code(), items)
    assert AT_WORK == ["file-0", "file-1", "file-2"]
    assert again[:2] == first


def test_a_worker_with_other_code_is_refused(tmp_path: Path) -> None:
    from hil.fleet.engine import do

    with pytest.raises(HilError, match=r"the worker has other code or libraries \(code\)"):
        do(Store(str(tmp_path)), "tried", note, {"code": "0"}, [])


@pytest.mark.parametrize(
    ("name", "moment"),
    [
        ("2025-03-01.csv", "2025-03-01T00:00:00+00:00"),
        ("x-axis_20250301T0607.mf4", "2025-03-01T06:07:00+00:00"),
        ("check 2025.03.01 06-07-08.csv", "2025-03-01T06:07:08+00:00"),
    ],
)
def test_the_moment_is_that_of_the_name(name: str, moment: str, fleet: Path) -> None:
    recording = read_recording(next(fleet.rglob("*.parquet")))
    assert moment_of(recording, name).isoformat() == moment
    recording.metadata["start_time"] = "2024-12-24T18:00:00+01:00"
    assert moment_of(recording, name).isoformat() == "2024-12-24T17:00:00+00:00"


def test_a_recording_without_a_moment_is_refused(fleet: Path) -> None:
    with pytest.raises(InputError, match="its moment is not known: no start_time"):
        moment_of(read_recording(next(fleet.rglob("*.parquet"))), "run-12345678.csv")


def test_a_folder_without_recordings_says_how_a_fleet_looks(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no recordings, allowed a folder for each axis"):
        fleet_at(str(tmp_path))[0].index()
    with pytest.raises(InputError, match="nothing is compared yet; call first: hil fleet compare"):
        fleet_at(str(tmp_path))[0].trend()
