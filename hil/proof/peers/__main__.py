"""python -m hil.proof.peers CASES OUT [--method NAME]... [--jobs N] [--first N]

reads CASES/CASE/{train_1, train_2, holdout}.parquet and bench.yaml, writes OUT/NAME/CASE/diagnosis.json, or error.json
if the method failed. Cases with an answer are skipped. `hil prove --out DIR` scores the answers in DIR/peers.
"""

import sys
from collections.abc import Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Annotated

import typer

from hil.errors import HilError, InputError
from hil.files.output import write_json
from hil.proof.answer.blind import DIAGNOSIS, ERROR, answered
from hil.proof.answer.worker_pool import cases_in, side_by_side
from hil.proof.peers import METHODS, SLOW
from hil.proof.peers.case import read_case

Name = StrEnum("Name", {name: name for name in METHODS})  # type: ignore[misc]   # choices of the command line
_QUICK = [Name(name) for name in METHODS if name not in SLOW]


def answer_cases(
    cases: Annotated[Path, typer.Argument(help="Folder with a folder for each case")],
    out: Annotated[Path, typer.Argument(help="Folder for the answers, a folder for each method")],
    method: Annotated[list[Name], typer.Option(help="Method; may be repeated")] = _QUICK,
    jobs: Annotated[int, typer.Option(min=1, help="Cases at once, each on its share of the cores")] = 1,
    first: Annotated[int | None, typer.Option(min=1, help="Only the first cases, which lie in mixed order")] = None,
) -> None:
    """Run other methods on every case without an answer; prints the name of each case that is done."""
    names = [str(name) for name in method]
    todo = [
        place for place in cases_in(cases, out)[:first] if not all(answered(out / name / place.name) for name in names)
    ]
    for done in side_by_side(partial(answer_case, out=out, methods=names), todo, jobs):
        print(done, flush=True)


def answer_case(case: Path, out: Path, methods: Sequence[str]) -> None:
    """Answer a case with the methods that lack an answer; preparing it once counts as time of each."""
    begin = monotonic()
    todo = [out / name / case.name for name in methods if not answered(out / name / case.name)]
    for answer in todo:
        answer.mkdir(parents=True, exist_ok=True)
    try:
        prepared = read_case(case)
    except Exception as error:
        for answer in todo:
            _fail(answer, error)
        return
    prepared_s = monotonic() - begin
    for answer in todo:
        begin = monotonic()
        try:
            found = METHODS[answer.parent.name](prepared)
        except Exception as error:
            _fail(answer, error)
        else:
            write_json(answer / DIAGNOSIS, found | {"runtime_s": prepared_s + monotonic() - begin})


def _fail(answer: Path, error: Exception) -> None:
    """Write a failure as a wrong answer; raise it if the method is not installed."""
    if isinstance(error, HilError) and not isinstance(error, InputError):
        raise error
    write_json(answer / ERROR, {"kind": type(error).__name__, "error": str(error)})


if __name__ == "__main__":
    try:
        typer.run(answer_cases)
    except HilError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
