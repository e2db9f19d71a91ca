"""Diagnose cases blind: a separate process that only gets the folder of recordings.

    python -m hil.validation.proof.answer.blind CASES ANSWERS [--jobs N | --scheduler ADDRESS] [--hours H]

reads CASES/NAME/{train_*.parquet, holdout.parquet, bench.yaml} and writes ANSWERS/NAME/diagnosis.json, with the next
experiment as a profile if one is proposed, or error.json if the diagnosis failed. Without holdout.parquet a third of
each recording is held out. Cases with an answer are skipped, so an interrupted run continues. An import contract keeps
everything that draws or knows the truth out of this process.

A worker gets the content of a case's files and returns the content of the answer's. It needs no folder in common with
this process, only the same code and libraries.
"""

import os
import sys
from functools import cache, partial
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Annotated, NamedTuple

import typer

from hil.errors import HilError
from hil.files.output import write_json, write_text
from hil.motion.profile import write_profile
from hil.validation.proof.case_folder import cases_in
from hil.validation.proof.code import code_sha256
from hil.workers.cluster import cluster
from hil.workers.code import versions
from hil.workers.pool import completed, local

DIAGNOSIS, ERROR = "diagnosis.json", "error.json"
_ONE_AT_A_TIME = Lock()  # a diagnosis uses all threads that its process has


class CaseFiles(NamedTuple):
    """A case as a worker gets it: the content of its files, and the code that must diagnose it."""

    name: str
    files: dict[str, bytes]
    code: dict[str, str]


def diagnose_cases(
    cases: Annotated[Path, typer.Argument(help="Folder with a folder for each case")],
    answers: Annotated[Path, typer.Argument(help="Folder for the answers")],
    jobs: Annotated[int, typer.Option(min=1, help="Cases at once, each on its share of the cores")] = 1,
    hours: Annotated[float, typer.Option(min=0.0, help="After which no case is begun")] = inf,
    scheduler: Annotated[str | None, typer.Option(help="Address of a dask.distributed scheduler")] = None,
) -> None:
    """Diagnose every case that has no answer yet, in order of their names; prints each name when it is done."""
    todo = [place for place in cases_in(cases, answers) if not answered(answers / place.name)]
    # a worker of a cluster does not know how many others share its machine
    work = diagnose_files if scheduler is None else partial(diagnose_files, threads=1)
    with local(jobs) if scheduler is None else cluster(scheduler) as workers:
        for case, files in completed(workers, work, map(read_case, todo), hours):
            (answers / case.name).mkdir(exist_ok=True)
            for name in sorted(files, key=lambda name: name in (DIAGNOSIS, ERROR)):  # which make it an answer, last
                write_text(answers / case.name / name, files[name])
            print(case.name, flush=True)


def answered(answer: Path) -> bool:
    """Return whether a case has an answer."""
    return (answer / DIAGNOSIS).exists() or (answer / ERROR).exists()


def read_case(case: Path) -> CaseFiles:
    """Read the recordings and the bench of a case, and nothing else that may lie beside them."""
    paths = [*sorted(case.glob("train_*.parquet")), case / "holdout.parquet", case / "bench.yaml"]
    return CaseFiles(case.name, {path.name: path.read_bytes() for path in paths if path.exists()}, _code())


def diagnose_files(case: CaseFiles, threads: int | None = None) -> dict[str, str]:
    """Diagnose a case in this process, a worker's; returns the text of each file of the answer by its name.

    threads: of the diagnosis, if the first one of this process; default: HIL_THREADS, else the cores of the process.

    Raises HilError if the code or the libraries here are not those of the process that read the case.
    """
    if _code() != case.code:
        other = [name for name, value in case.code.items() if _code()[name] != value]
        raise HilError(
            f"{os.uname().nodename}: the worker has other code or libraries ({', '.join(other)}); answers of two would "
            "mix: install the same there and run the same again to go on"
        )
    if threads is not None:
        os.environ.setdefault("HIL_THREADS", str(threads))
    with _ONE_AT_A_TIME, TemporaryDirectory() as folder:
        place, answers = Path(folder, case.name), Path(folder, "answers")
        place.mkdir()
        for name, content in case.files.items():
            (place / name).write_bytes(content)
        diagnose_case(place, answers)
        return {path.name: path.read_text(encoding="utf-8") for path in (answers / case.name).iterdir()}


@cache
def _code() -> dict[str, str]:
    return {"code_sha256": code_sha256(), **versions()}


def diagnose_case(case: Path, answers: Path) -> None:
    """Diagnose one case and write the answer to a folder of its name."""
    from hil.bench.bench_file import load_bench
    from hil.diagnosis.diagnose import diagnose
    from hil.diagnosis.experiment import NEXT_EXPERIMENT
    from hil.recording.recording import read_recording

    answer = answers / case.name
    answer.mkdir(parents=True, exist_ok=True)
    try:
        train = [read_recording(path) for path in sorted(case.glob("train_*.parquet"))]
        held_out = [case / "holdout.parquet"] if not train or (case / "holdout.parquet").exists() else []
        found = diagnose(train, [read_recording(path) for path in held_out], load_bench(case / "bench.yaml"))
    except Exception as error:  # any failure counts as a wrong answer
        message = str(error).replace(f"{case.parent}{os.sep}", "")  # a folder of the worker's
        write_json(answer / ERROR, {"kind": type(error).__name__, "error": message})
        return
    if found.experiment and found.experiment.profile:
        write_profile(answer / NEXT_EXPERIMENT, found.experiment.profile)
    write_json(answer / DIAGNOSIS, found.result.as_json())


if __name__ == "__main__":
    from hil.validation.proof.answer import blind  # by the name under which a worker imports it

    try:
        typer.run(blind.diagnose_cases)
    except HilError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
