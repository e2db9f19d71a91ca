"""The blind diagnosis of cases: a process of its own that is given the folder of recordings and nothing else.

    python -m hil.proof.blind CASES ANSWERS [--jobs N] [--hours H]

reads CASES/NAME/{train_*.parquet, holdout.parquet, bench.yaml} and writes ANSWERS/NAME/diagnosis.json, with the next
experiment as a profile where one is proposed, or error.json where the diagnosis failed. Cases with an answer are
left out, so that an interrupted run goes on. Nothing that draws or knows what is concealed is imported here; an
import contract holds that.
"""

from __future__ import annotations

import os
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from math import inf
from multiprocessing import get_context
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

import typer

from hil.report.output import write_json, write_profile

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

DIAGNOSIS, ERROR = "diagnosis.json", "error.json"


def diagnose_cases(cases: Annotated[Path, typer.Argument(help="Folder with a folder for each case")],
                   answers: Annotated[Path, typer.Argument(help="Folder for the answers")],
                   jobs: Annotated[int, typer.Option(min=1, help="Cases at once, each on its share of the cores")] = 1,
                   hours: Annotated[float, typer.Option(min=0.0, help="After which no case is begun")] = inf) -> None:
    """Diagnose every case that has no answer yet, in order of their names; prints each name when it is done."""
    end_s = monotonic() + 3600.0 * hours
    # each process spreads its work over its cores itself; threads of the linear algebra get into its way
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    todo = [place for place in sorted(cases.iterdir()) if not answered(answers / place.name)]
    context = get_context("spawn")
    shares: Queue[set[int]] = context.Queue()
    for share in _shares(jobs):
        shares.put(share)
    try:
        with ProcessPoolExecutor(jobs, context, _keep_to, (shares,)) as pool:
            waiting, running = iter(todo), dict[Future[None], str]()
            try:
                while True:
                    for place in islice(waiting, jobs - len(running) if monotonic() < end_s else 0):
                        running[pool.submit(diagnose_case, place, answers / place.name)] = place.name
                    if not running:
                        break
                    for done in wait(running, return_when=FIRST_COMPLETED).done:
                        done.result()
                        print(running.pop(done), flush=True)
            except BaseException:     # stopped, or nobody listens any more: no case is begun
                for case in running:
                    case.cancel()
                raise
    except BrokenProcessPool:
        typer.echo("a process that diagnosed was ended from outside, perhaps for want of memory; run the same again "
                   "to go on", err=True)
        raise typer.Exit(1) from None


def answered(answer: Path) -> bool:
    """Whether a case has an answer."""
    return (answer / DIAGNOSIS).exists() or (answer / ERROR).exists()


def diagnose_case(case: Path, answer: Path) -> None:
    """Diagnose one case and write the answer."""
    from hil.bench import load_bench
    from hil.diagnosis.diagnose import NEXT_EXPERIMENT, diagnose
    from hil.recording import read_recording

    answer.mkdir(parents=True, exist_ok=True)
    try:
        found = diagnose([read_recording(path) for path in sorted(case.glob("train_*.parquet"))],
                         [read_recording(case / "holdout.parquet")], load_bench(case / "bench.yaml"))
    except Exception as error:    # whatever it is: an answer is owed, and this is a wrong one
        write_json(answer / ERROR, {"kind": type(error).__name__, "error": str(error)})
        return
    if found.experiment and found.experiment.profile:
        write_profile(answer / NEXT_EXPERIMENT, found.experiment.profile)
    write_json(answer / DIAGNOSIS, found.result.as_json())


def _shares(jobs: int) -> list[set[int]]:
    """Cores of each process."""
    cores = sorted(os.sched_getaffinity(0))
    return [set(cores[job % len(cores)::jobs]) for job in range(jobs)]


def _keep_to(shares: Queue[set[int]]) -> None:
    """Keep this process to its share of the cores."""
    os.sched_setaffinity(0, shares.get())


if __name__ == "__main__":
    typer.run(diagnose_cases)
