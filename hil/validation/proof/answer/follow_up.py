"""Record the motion that a diagnosis proposed on the same axis, for a second diagnosis with all recordings.

DIR/again/cases/NAME/      the recordings of DIR/cases/NAME and the new one, without the truth
DIR/again/answers/NAME/    the second answer
"""

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from hil.diagnosis.experiment import NEXT_EXPERIMENT
from hil.errors import HilError
from hil.motion.profile import load_profile
from hil.motion.trajectory import plan
from hil.recording.recording import write_parquet
from hil.report.console import Progress
from hil.validation.proof.draw.generator import Truth, draw, rerun
from hil.validation.proof.seal import CASES
from hil.workers.pool import side_by_side

AGAIN = "again"
_NEW = "train_3"


def record_again(folder: Path, answers: Path, truths: Mapping[str, Truth], jobs: int, progress: Progress) -> list[str]:
    """Record the motions that answers propose for ambiguous cases; returns the names of these cases.

    Raises HilError if an axis cannot be drawn again as it was sealed.
    """
    names = [
        name
        for name, truth in truths.items()
        if truth.tier == "ambiguous" and (answers / name / NEXT_EXPERIMENT).exists()
    ]
    todo = [truths[name] for name in names if not (folder / AGAIN / CASES / name).exists()]
    for done, _ in enumerate(side_by_side(partial(_record, folder, answers), todo, jobs), 1):
        progress("running proposed motions", done / len(todo))
    return names


def _record(folder: Path, answers: Path, truth: Truth) -> None:
    case = draw(truth.tier, truth.number, truth.seed)
    # compared as JSON, which has no tuples
    if json.dumps(replace(case.truth, name=truth.name).as_json()) != json.dumps(truth.as_json()):
        raise HilError(
            f"{truth.name}: is drawn otherwise here than it was sealed, and cannot be run again; score it "
            "on the machine and with the libraries that sealed it"
        )
    trajectory = plan(load_profile(answers / truth.name / NEXT_EXPERIMENT), case.draft.axis.period_s)
    place = folder / AGAIN / CASES / truth.name
    part = place.with_suffix(".part")
    shutil.rmtree(part, ignore_errors=True)
    shutil.copytree(folder / CASES / truth.name, part)
    write_parquet(rerun(case.draft, trajectory, truth.number, _NEW), part / f"{_NEW}.parquet")
    part.rename(place)
