"""Diagnoses in processes and on a dask.distributed cluster: the same answers, and nothing lost with what is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from processes import DEADLINE_S, wait_for

from hil.errors import HilError, InputError
from hil.files.output import write_json
from hil.validation.proof.answer.blind import DIAGNOSIS, CaseFiles, diagnose_files, read_case
from hil.validation.proof.draw.plan import Planned
from hil.validation.proof.run import prove
from hil.validation.proof.seal import CASES, draw_cases, seal
from hil.workers.cluster import cluster

# Waits for a case that would take longer than anybody waits.
WAITING = """
import sys, time
from hil.errors import HilError
from hil.workers.cluster import cluster
from hil.workers.pool import completed

try:
    with cluster(sys.argv[1]) as workers:
        print("connected", flush=True)
        list(completed(workers, time.sleep, [300.0]))
except HilError as error:
    print(type(error).__name__, error)
"""
PLANNED = tuple(Planned(f"case_{number:04d}", "null", number) for number in range(3))
COMMAND = "hil prove --only null --cases 3 --seed 7 --out DIR"


def quiet(*what: object) -> None:
    """Nobody listens."""


class Cluster:
    """A scheduler and workers on the loopback, each a process of its own."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._stack, self._folder = stack, folder
        self.file = folder / "scheduler.json"
        self.scheduler = self._start(
            "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
            "--scheduler-file", str(self.file))  # fmt: skip
        wait_for(lambda: self.file.exists() and self.file.read_text().endswith("}"))
        self.address: str = json.loads(self.file.read_text())["address"]

    def worker(self) -> subprocess.Popen[bytes]:
        """Start a worker with a nanny in a folder of its own."""
        place = self._folder / f"worker_{len(list(self._folder.glob('worker_*')))}"
        place.mkdir()
        return self._start(
            "distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-dashboard",
            "--local-directory", str(place), folder=place)  # fmt: skip

    def _start(self, module: str, *arguments: str, folder: Path | None = None) -> subprocess.Popen[bytes]:
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[4]), "PYTHONWARNINGS": "ignore"}
        process = self._stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                cwd=folder or self._folder,
                env=environment,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        )
        self._stack.callback(end, process)
        return process


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and all that it started."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[], Cluster]]:
    with ExitStack() as stack:
        yield lambda: Cluster(tmp_path, stack)


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sealed")
    draw_cases(folder, PLANNED, 7, 2, quiet)
    seal(folder, PLANNED, COMMAND, 7)
    return folder


def blind(sealed: Path, answers: Path, *options: str) -> subprocess.Popen[str]:
    """The blind diagnosis of the cases, in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "hil.validation.proof.answer.blind", str(sealed / CASES), str(answers), *options],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[4])},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def answered(answers: Path) -> list[str]:
    return sorted(path.parent.name for path in answers.rglob(DIAGNOSIS))


def content(answers: Path) -> dict[str, str]:
    """All files of the answers, without the time that a diagnosis took."""
    files = {str(path.relative_to(answers)): path.read_text() for path in answers.rglob("*") if path.is_file()}
    for name, text in files.items():
        if name.endswith(DIAGNOSIS):
            files[name] = json.dumps({key: value for key, value in json.loads(text).items() if key != "runtime_s"})
    return files


@pytest.mark.long
def test_answers_do_not_depend_on_the_workers(sealed: Path, tmp_path: Path, start: Callable[[], Cluster]) -> None:
    """One process on all cores, two on a core each, and a cluster, of which a worker and the client are killed."""
    for name, jobs in (("one", "1"), ("two", "2")):
        ran = blind(sealed, tmp_path / name, "--jobs", jobs)
        said, errors = ran.communicate()
        assert (ran.returncode, sorted(said.split())) == (0, [case.name for case in PLANNED]), errors
    assert len(answered(tmp_path / "one")) == len(PLANNED)
    assert content(tmp_path / "one") == content(tmp_path / "two")

    running, answers = start(), tmp_path / "cluster"
    running.worker()
    client = blind(sealed, answers, "--scheduler", running.address)
    wait_for(lambda: len(answered(answers)) == 1, 10 * DEADLINE_S)
    os.killpg(client.pid, signal.SIGKILL)
    client.communicate()
    (first,) = answered(answers)
    before = (answers / first / DIAGNOSIS).stat().st_mtime_ns

    lost = running.worker()
    client = blind(sealed, answers, "--scheduler", running.address)
    wait_for(lambda: len(answered(answers)) == 2 or client.poll() is not None, 10 * DEADLINE_S)
    end(lost)
    said, errors = client.communicate()
    assert client.returncode == 0, errors
    assert len(said.split()) == len(PLANNED) - 1  # the answer of the killed client was kept
    assert (answers / first / DIAGNOSIS).stat().st_mtime_ns == before
    assert content(answers) == content(tmp_path / "one")


@pytest.mark.long
def test_a_case_goes_on_elsewhere_when_its_worker_is_killed(
    sealed: Path, tmp_path: Path, start: Callable[[], Cluster]
) -> None:
    running = start()
    lost = running.worker()
    client = blind(sealed, tmp_path / "answers", "--scheduler", running.address)
    wait_for(lambda: len(answered(tmp_path / "answers")) == 1, 10 * DEADLINE_S)  # and the next one is at work
    end(lost)
    running.worker()
    said, errors = client.communicate()
    assert (client.returncode, sorted(said.split())) == (0, [case.name for case in PLANNED]), errors


@pytest.mark.long
def test_the_same_again_goes_on_when_a_process_is_killed(sealed: Path, tmp_path: Path) -> None:
    answers = tmp_path / "answers"
    client = blind(sealed, answers, "--jobs", "1")
    wait_for(lambda: len(answered(answers)) == 1, 10 * DEADLINE_S)  # and the next one is at work
    children = [int(pid) for pid in Path(f"/proc/{client.pid}/task/{client.pid}/children").read_text().split()]
    (worker,) = [pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    os.kill(worker, signal.SIGKILL)
    said, errors = client.communicate()
    assert (client.returncode, len(said.split())) == (1, 1)
    assert "a process was ended from outside, perhaps for want of memory; run the same again to go on" in errors
    client = blind(sealed, answers, "--jobs", "1")
    again, errors = client.communicate()
    assert client.returncode == 0, errors
    assert sorted(said.split() + again.split()) == [case.name for case in PLANNED]


@pytest.mark.long
def test_failures_are_answers_on_a_cluster_too(sealed: Path, tmp_path: Path, start: Callable[[], Cluster]) -> None:
    """Cases that cannot be diagnosed, so that the way there and back is quick."""
    for name in ("one", "two"):
        (tmp_path / CASES / name).mkdir(parents=True)
        (tmp_path / CASES / name / "bench.yaml").touch()
    running = start()
    running.worker()
    ran = blind(tmp_path, tmp_path / "cluster", "--scheduler", running.address)
    said, errors = ran.communicate()
    assert (ran.returncode, sorted(said.split())) == (0, ["one", "two"]), errors
    here = blind(tmp_path, tmp_path / "here", "--jobs", "2").communicate()[0]
    assert sorted(here.split()) == ["one", "two"]
    assert content(tmp_path / "cluster") == content(tmp_path / "here")
    assert len(content(tmp_path / "here")) == 2


def test_a_worker_gets_recordings_and_bench_alone(sealed: Path) -> None:
    place = sealed / CASES / PLANNED[0].name
    (place / "truth.json").write_text("{}")
    try:
        assert set(read_case(place).files) == {"train_1.parquet", "train_2.parquet", "holdout.parquet", "bench.yaml"}
    finally:
        (place / "truth.json").unlink()


def test_a_worker_with_other_code_is_refused() -> None:
    case = read_case(Path("nowhere"))
    other = CaseFiles(case.name, case.files, case.code | {"code_sha256": "0"})
    with pytest.raises(HilError, match=r"the worker has other code or libraries \(code_sha256\)"):
        diagnose_files(other)


def test_no_scheduler_and_a_lost_scheduler_are_told(start: Callable[[], Cluster]) -> None:
    with (
        pytest.raises(InputError, match=r"--scheduler: given nonsense://x, allowed the address"),
        cluster("nonsense://x"),
    ):
        pass
    running = start()
    with subprocess.Popen(
        [sys.executable, "-c", WAITING, running.address], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as client:
        assert client.stdout is not None
        assert client.stdout.readline() == "connected\n"
        end(running.scheduler)
        said, errors = client.communicate(timeout=2 * DEADLINE_S)
    assert said.startswith(f"HilError {running.address}: the scheduler is lost, or a worker cannot write ("), errors


def test_a_proof_with_all_answers_needs_no_cluster(sealed: Path, tmp_path: Path) -> None:
    for case in PLANNED:
        (sealed / "answers" / case.name).mkdir(parents=True)
        write_json(sealed / "answers" / case.name / DIAGNOSIS, {"verdict": "no_mismatch", "missing": []})
    found = prove(sealed, PLANNED, 7, 1, quiet, quiet, only=("null",), scheduler="tcp://127.0.0.1:1")
    assert [case.right for case in found.cases] == [True] * len(PLANNED)
