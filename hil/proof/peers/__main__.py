"""python -m hil.proof.peers CASES OUT --method NAME

reads CASES/CASE/{train_1, train_2, holdout}.parquet and bench.yaml, writes OUT/CASE/diagnosis.json, or error.json where
the method failed. Cases with an answer are left out. What lies in DIR/peers/NAME is scored by `hil prove --out DIR`.
"""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from time import monotonic
from typing import Annotated

import typer

from hil.errors import HilError, InputError
from hil.proof.blind import DIAGNOSIS, ERROR, answered
from hil.proof.peers import METHODS
from hil.report.output import write_json

Name = StrEnum("Name", {name: name for name in METHODS})    # type: ignore[misc]   # choices of the command line


def answer_cases(cases: Annotated[Path, typer.Argument(help="Folder with a folder for each case")],
                 out: Annotated[Path, typer.Argument(help="Folder for the answers")],
                 method: Annotated[Name, typer.Option(help="Who answers")]) -> None:
    """Have every case that has no answer yet answered by another method; prints the name of each when it is done."""
    for place in sorted(cases.iterdir()):
        answer = out / place.name
        if answered(answer):
            continue
        answer.mkdir(parents=True, exist_ok=True)
        begin = monotonic()
        try:
            found = METHODS[method](place)
        except (InputError, ValueError, ArithmeticError) as error:     # a wrong answer, but an answer
            write_json(answer / ERROR, {"kind": type(error).__name__, "error": str(error)})
        else:
            write_json(answer / DIAGNOSIS, found | {"runtime_s": monotonic() - begin})
        print(place.name, flush=True)


if __name__ == "__main__":
    try:
        typer.run(answer_cases)
    except HilError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
