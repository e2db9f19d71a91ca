"""The server as a process: live rows, a new start of the bench, saving for `hil compare`, who is let in."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from command_line import hil, refused
from compare_runs import bench_with, record
from scope_process import ScopeClient, page_of, post, scope
from websockets.exceptions import InvalidStatus

from hil.recording.recording import Recording, read_recording
from hil.recording.writer import Recorder

NAMES = ["position_command_m", "table_position_m", "twin_table_position_m", "torque_n_m"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("server")


@pytest.fixture(scope="module")
def run(folder: Path) -> Recording:
    return record(folder, bench_with())


@pytest.fixture(scope="module")
def live(folder: Path) -> Iterator[str]:
    """A scope that waits for runs."""
    with scope(folder, "--within", ".") as address:
        yield address


@pytest.fixture(scope="module")
def shown(folder: Path, run: Recording) -> Iterator[str]:
    """A scope that shows the recording."""
    with scope(folder, "run.parquet", "--out", "saved") as address:
        yield address


def recorder_of(folder: Path, run: Recording, name: str) -> Recorder:
    """The recorder of a bench in wall-clock time with the channels of a run, its loop this process."""
    return Recorder(folder, name, tuple(run.columns), run.period_s, {"bench": run.metadata["bench"]})


def rows_of(run: Recording, first: int, end: int) -> list[tuple[float, ...]]:
    return list(zip(*(values[first:end].tolist() for values in run.columns.values()), strict=True))


def shown_rows(page: ScopeClient, came: np.ndarray, count: int) -> np.ndarray:
    """The points (k, n) that the page shows once they are `count`: a view replaces those that came before."""
    while came.shape[1] < count:
        header, values = page.next("view", "append")
        came = values if header["kind"] == "view" else np.hstack((came, values))
    return came


def test_rows_come_as_they_are_recorded_also_after_a_new_start(folder: Path, run: Recording, live: str) -> None:
    with page_of(live) as page:
        for name in ("first", "second"):
            with recorder_of(folder, run, name) as recorder:
                for row in rows_of(run, 0, 300):
                    recorder.record(row)
                header, _ = page.next("rows")
                assert header["name"] == name
                page.send("see", traces=NAMES, window_s=0.5, points=5000)
                came = shown_rows(page, np.empty((5, 0)), 300)
                for row in rows_of(run, 300, 400):
                    recorder.record(row)
                came = shown_rows(page, came, 400)
                for index, channel in enumerate(["time_s", *NAMES]):
                    assert np.array_equal(came[index], run[channel][:400]), channel
                status, _ = page.next("status")
                assert status["state"] == "operation enabled"


def test_a_single_shot_has_the_rows_of_the_loop_before_and_after_it(folder: Path, run: Recording, live: str) -> None:
    with page_of(live) as page:
        level = 0.5 * float(run["table_position_m"].max())
        with recorder_of(folder, run, "shot") as recorder:
            recorder.record(rows_of(run, 0, 1)[0])
            while page.next("rows")[0]["name"] != "shot":
                pass
            page.send("see", traces=NAMES, window_s=0.5, points=100)
            page.send("arm", trace="table_position_m", level=level, slope="rising", pre_s=0.05, post_s=0.1)
            while page.next("status")[0]["mode"] != "waiting":
                pass
            for row in rows_of(run, 1, len(run)):
                recorder.record(row)
            told, _ = page.next("triggered")
            page.send("see", traces=NAMES, window_s=0.5, points=5000)
            header, values = page.next("view")
        passed = int(np.flatnonzero(run["table_position_m"] >= level)[0])
        assert told["time_s"] == header["zero_s"] == run["time_s"][passed]
        assert np.array_equal(values[0], run["time_s"][passed - 50 : passed + 101])
        assert np.array_equal(values[2], run["table_position_m"][passed - 50 : passed + 101])


def test_rows_come_thirty_times_a_second(folder: Path, run: Recording, live: str) -> None:
    with page_of(live) as page, recorder_of(folder, run, "rate") as recorder:
        rows, start_s, k, frames = rows_of(run, 0, len(run)), time.monotonic(), 0, 0
        recorder.record(rows[0])
        while page.next("rows")[0]["name"] != "rate":
            pass
        page.send("see", traces=NAMES, window_s=0.5, points=5000)
        while (passed_s := time.monotonic() - start_s) < 1.0:
            while k < 1000 * passed_s and k < len(rows) - 1:
                k += 1
                recorder.record(rows[k])
            page.next("view", "append")
            frames += 1
    assert 5 <= frames <= 33  # fewer on a busy machine, never more


def test_what_is_saved_is_a_recording_that_compare_reads(folder: Path, run: Recording, shown: str) -> None:
    with page_of(shown) as page:
        identity = page.next("rows")[0]["page"]
        status, told = post(shown, {"page": identity, "name": "cut", "from_s": 0.0, "to_s": 0.9})
        assert status == 200, told
        saved = read_recording(folder / told["path"])
        assert told["path"] == "saved/cut.parquet"
        assert len(saved) == told["rows"]
        assert np.array_equal(saved["torque_n_m"], run["torque_n_m"][: len(saved)])
        assert saved.metadata["bench"] == run.metadata["bench"]
        ran = hil(folder, "compare", "saved/cut.parquet", "--out", "compared")
        assert ran.returncode == 0, ran.stderr
        assert (folder / "compared" / "compare.html").exists()
        assert post(shown, {"page": identity, "name": "cut"})[1]["path"] == "saved/cut_2.parquet"


@pytest.mark.parametrize(
    ("body", "status", "says"),
    [
        ({"name": "../out"}, 400, "allowed letters"),
        ({"name": "short", "from_s": 0.1, "to_s": 0.11}, 400, "50 or more"),
        ({"name": "nowhere", "from_s": 70.0, "to_s": 80.0}, 400, "no rows"),
        ({"name": "text", "from_s": "x"}, 400, "another form"),
        ({}, 400, "another form"),
        ({"name": "strange", "page": "x"}, 404, "not connected"),
    ],
)
def test_what_cannot_be_saved_is_refused(shown: str, body: dict[str, object], status: int, says: str) -> None:
    with page_of(shown) as page:
        answer = post(shown, {"page": page.next("rows")[0]["page"]} | body)
        assert answer[0] == status
        assert says in answer[1]["refused"]


def test_pages_of_other_origins_and_names_are_refused(shown: str) -> None:
    with pytest.raises(InvalidStatus):
        page_of(shown, Origin="http://elsewhere.example").__enter__()
    request = urllib.request.Request(shown, headers={"Host": "elsewhere.example"})
    with pytest.raises(urllib.error.HTTPError) as error:
        urllib.request.urlopen(request)
    with error.value:
        assert error.value.code == 403
    with urllib.request.urlopen(shown) as answer:
        assert b"<title>hil scope</title>" in answer.read()
    with page_of(shown, Origin=shown.rstrip("/")) as page:
        page.next("rows")


def test_other_computers_need_the_token_and_save_nothing(folder: Path, run: Recording) -> None:
    with scope(folder, "run.parquet", "--host", "0.0.0.0") as told:
        port, token = told.rsplit(":", 1)[1].split("/?token=")
        address = f"http://127.0.0.1:{port}/?token={token}"
        with page_of(address) as page:
            assert page.next("rows")[0]["saves"] is False
        for wrong in (f"http://127.0.0.1:{port}/", f"http://127.0.0.1:{port}/?token=guess"):
            with pytest.raises(InvalidStatus):
                page_of(wrong).__enter__()
            with pytest.raises(urllib.error.HTTPError) as error:
                urllib.request.urlopen(wrong)
            error.value.close()
        assert post(address, {"page": "x", "name": "y"})[0] == 403


def test_arguments_that_are_wrong(folder: Path, run: Recording) -> None:
    assert "allowed one or two" in refused(folder, "scope", *["run.parquet"] * 3)
    assert "no.parquet" in refused(folder, "scope", "no.parquet")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        assert "another --port" in refused(folder, "scope", "--port", str(taken.getsockname()[1]))
    assert "cannot be used" in refused(folder, "scope", "--host", "192.0.2.1", "--port", "0")


def test_without_the_extra_the_message_says_what_to_install(folder: Path) -> None:
    code = "import sys; sys.modules['uvicorn'] = None; sys.argv = ['hil', 'scope']; from hil.cli import main; main()"
    ran = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert ran.stderr.strip() == "this command needs uvicorn, which is not installed: pip install 'hil-servo[scope]'"


def test_a_page_that_sends_nonsense_is_told_so_and_stays(shown: str) -> None:
    with page_of(shown) as page:
        page.socket.send("[]")
        assert "given" in page.next("refused")[0]["text"]
        page.send("see", traces=NAMES, window_s=1.0, points=100)
        assert json.dumps(page.next("view")[0]["traces"]) == json.dumps(NAMES)
