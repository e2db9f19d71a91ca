"""python -m hil.validation.proof.peers CASES OUT [--method NAME]... [--jobs N] [--first N]

reads CASES/CASE/{train_1, train_2, holdout}.parquet and bench.yaml, writes OUT/NAME/CASE/diagnosis.json, or error.json
if the method failed. Cases with an answer are skipped. `hil prove --out DIR` scores the answers in DIR/peers.
"""

import sys
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from hil.errors import HilError
from hil.validation.proof.answer.blind import answered
from hil.validation.proof.case_folder import cases_in
from hil.validation.proof.peers import METHODS, SLOW, answer_case
from hil.workers.pool import side_by_side

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
        print(done.name, flush=True)


if __name__ == "__main__":
    try:
        typer.run(answer_cases)
    except HilError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
