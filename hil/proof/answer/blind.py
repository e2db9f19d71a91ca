"""Diagnose cases blind: a separate process that only gets the folder of recordings.

    python -m hil.proof.answer.blind CASES ANSWERS [--jobs N] [--hours H]

reads CASES/NAME/{train_*.parquet, holdout.parquet, bench.yaml} and writes ANSWERS/NAME/diagnosis.json, with the next
experiment as a profile if one is proposed, or error.json if the diagnosis failed. Cases with an answer are skipped, so
an interrupted run continues. An import contract keeps everything that draws or knows the truth out of this process.
"""

import sys
from functools import partial
from math import inf
from pathlib import Path
from typing import Annotated

import typer

from hil.errors import HilError
from hil.files.output import write_json
from hil.motion.profile import write_profile
from hil.proof.answer.worker_pool import cases_in, side_by_side

DIAGNOSIS, ERROR = "diagnosis.json", "error.json"


def diagnose_cases(
    cases: Annotated[Path, typer.Argument(help="Folder with a folder for each case")],
    answers: Annotated[Path, typer.Argument(help="Folder for the answers")],
    jobs: Annotated[int, typer.Option(min=1, help="Cases at once, each on its share of the cores")] = 1,
    hours: Annotated[float, typer.Option(min=0.0, help="After which no case is begun")] = inf,
) -> None:
    """Diagnose every case that has no answer yet, in order of their names; prints each name when it is done."""
    todo = [place for place in cases_in(cases, answers) if not answered(answers / place.name)]
    for name in side_by_side(partial(diagnose_case, answers=answers), todo, jobs, hours):
        print(name, flush=True)


def answered(answer: Path) -> bool:
    """Return whether a case has an answer."""
    return (answer / DIAGNOSIS).exists() or (answer / ERROR).exists()


def diagnose_case(case: Path, answers: Path) -> None:
    """Diagnose one case and write the answer to a folder of its name."""
    from hil.bench.bench_file import load_bench
    from hil.diagnosis.diagnose import NEXT_EXPERIMENT, diagnose
    from hil.recording.recording import read_recording

    answer = answers / case.name
    answer.mkdir(parents=True, exist_ok=True)
    try:
        found = diagnose(
            [read_recording(path) for path in sorted(case.glob("train_*.parquet"))],
            [read_recording(case / "holdout.parquet")],
            load_bench(case / "bench.yaml"),
        )
    except Exception as error:  # any failure counts as a wrong answer
        write_json(answer / ERROR, {"kind": type(error).__name__, "error": str(error)})
        return
    if found.experiment and found.experiment.profile:
        write_profile(answer / NEXT_EXPERIMENT, found.experiment.profile)
    write_json(answer / DIAGNOSIS, found.result.as_json())


if __name__ == "__main__":
    try:
        typer.run(diagnose_cases)
    except HilError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
