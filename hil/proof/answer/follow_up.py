"""The motion that a diagnosis asked for: run on the concealed axis, recorded, and diagnosed with what was there before.

DIR/again/cases/NAME/      the recordings of DIR/cases/NAME with the new one beside them, still nothing of the truth
DIR/again/answers/NAME/    the second answer
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

from hil.diagnosis.diagnose import NEXT_EXPERIMENT
from hil.errors import HilError
from hil.motion.profile import load_profile
from hil.motion.trajectory import plan
from hil.proof.draw.generator import Truth, draw, rerun
from hil.proof.seal import CASES
from hil.recording.recording import write_parquet

AGAIN = "again"
_NEW = "train_3"


def record_again(
    folder: Path, answers: Path, truths: Mapping[str, Truth], jobs: int, told: Callable[[float], None]
) -> list[str]:
    """Run what answers propose for ambiguous cases; returns the names of these cases.

    Raises HilError where an axis cannot be drawn again as it was sealed.
    """
    names = [
        name
        for name, truth in truths.items()
        if truth.tier == "ambiguous" and (answers / name / NEXT_EXPERIMENT).exists()
    ]
    todo = [name for name in names if not (folder / AGAIN / CASES / name).exists()]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        runs = [pool.submit(_record, folder, answers / name / NEXT_EXPERIMENT, truths[name]) for name in todo]
        try:
            for done, run in enumerate(as_completed(runs), 1):
                run.result()
                told(done / len(todo))
        except BaseException:
            for run in runs:
                run.cancel()
            raise
    return names


def _record(folder: Path, profile: Path, truth: Truth) -> None:
    case = draw(truth.tier, truth.number, truth.seed)
    # as written: a file knows no tuples
    if json.dumps(replace(case.truth, name=truth.name).as_json()) != json.dumps(truth.as_json()):
        raise HilError(
            f"{truth.name}: is drawn otherwise here than it was sealed, and cannot be run again; score it "
            "on the machine and with the libraries that sealed it"
        )
    trajectory = plan(load_profile(profile), case.draft.axis.period_s)
    place = folder / AGAIN / CASES / truth.name
    part = place.with_suffix(".part")
    shutil.rmtree(part, ignore_errors=True)
    shutil.copytree(folder / CASES / truth.name, part)
    write_parquet(rerun(case.draft, trajectory, truth.number, _NEW), part / f"{_NEW}.parquet")
    part.rename(place)
