"""Run a proof: draw, seal, diagnose blind, unseal, record the proposed motions, score."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from itertools import takewhile
from math import inf
from pathlib import Path

from hil.errors import HilError, InputError
from hil.report.console import Progress
from hil.validation.proof.answer.answers import read_answers
from hil.validation.proof.answer.blind import answered
from hil.validation.proof.answer.follow_up import AGAIN, record_again
from hil.validation.proof.code import code_sha256
from hil.validation.proof.draw.plan import PLANTS, Planned
from hil.validation.proof.score.scores import Scores, score
from hil.validation.proof.seal import CASES, SEAL, SEALED, draw_cases, read_seal, seal, unseal

ANSWERS, PEERS = "answers", "peers"
# Processes that are stopped by ctrl-C leave semaphores, which Python removes with a warning that a user cannot act on.
_UNCLEAN = "ignore::UserWarning:multiprocessing.resource_tracker"


def prove(
    folder: Path,
    planned: Sequence[Planned],
    seed: int,
    jobs: int,
    say: Callable[[str], None],
    progress: Progress,
    plant: str = "simulated",
    only: Sequence[str] = (),
    hours: float = inf,
    scheduler: str | None = None,
) -> Scores:
    """Complete the proof in `folder` on a plant of `plan.PLANTS` and score it; `only`: the tiers it was planned for.

    Diagnoses run in `jobs` processes, or on the dask.distributed cluster of a `scheduler`; what knows the truth runs on
    this machine. No diagnosis is begun after `hours`; then the cases up to the first without an answer are scored.
    Cases lie in mixed order, so these are a fair sample, unlike all cases that were quick.

    Raises InputError if `folder` holds another proof, HilError if sealed files changed or the blind process failed.
    """
    full = not only and len(planned) == sum(PLANTS[plant].values())
    cases = "--full" if full else f"--cases {len(planned)}"
    which = "".join(f"--only {tier} " for tier in only) + ("" if plant == "simulated" else f"--plant {plant} ")
    command = f"hil prove {which}{cases} --seed {seed} --out DIR"
    about = read_seal(folder)
    if about is None:
        make_folder(folder)
        progress("drawing cases", 0.0)
        draw_cases(folder, planned, seed, jobs, progress, plant)
        about = seal(folder, planned, command, seed)
    elif about["command"] != command:
        raise InputError(
            f"{folder / SEAL}: given {command}, allowed what was sealed, {about['command']}; or another --out"
        )
    say(f"sealed: SHA-256 {about['truths_sha256']}, {about['cases']} cases, {about['sealed_at']}")
    names, code = [case.name for case in planned], about["code_sha256"]
    diagnose_blind(folder / CASES, folder / ANSWERS, names, code, jobs, progress, "diagnosing blind", hours, scheduler)
    sealed = unseal(folder)
    truths = {name: sealed[name] for name in takewhile(lambda name: answered(folder / ANSWERS / name), names)}
    if len(truths) < len(names):
        say(f"the first {len(truths)} of {len(names)} cases have an answer and are scored; the same command continues")
    progress("running proposed motions", 0.0)
    again = record_again(folder, folder / ANSWERS, truths, jobs, progress)
    later = folder / AGAIN
    diagnose_blind(later / CASES, later / ANSWERS, again, code, jobs, progress, "diagnosing again", inf, scheduler)
    progress("scoring", None)
    return score(truths, read_answers(folder / ANSWERS, truths), read_answers(later / ANSWERS, again))


def score_others(folder: Path, scores: Scores) -> dict[str, Scores]:
    """Score the answers of other methods in DIR/peers/METHOD/NAME to the cases of `scores`, by method."""
    truths = {case.truth.name: case.truth for case in scores.cases}
    answers = {place.name: read_answers(place, truths) for place in sorted((folder / PEERS).glob("*/"))}
    return {method: score({name: truths[name] for name in found}, found) for method, found in answers.items() if found}


def diagnose_blind(
    cases: Path,
    answers: Path,
    names: Sequence[str],
    code: str,
    jobs: int,
    progress: Progress,
    task: str = "diagnosing blind",
    hours: float = inf,
    scheduler: str | None = None,
) -> None:
    """Diagnose all cases without an answer in another process, with the code that was sealed; none begins after
    `hours`."""
    done = sum(answered(answers / name) for name in names)
    if done == len(names) or hours <= 0.0:
        return
    if code_sha256() != code:
        raise InputError(
            f"{cases.parent}: was sealed for a diagnosis by other code than this (SHA-256 {code}); "
            "answers of two would mix: give another --out"
        )
    progress(task, done / len(names))
    blind = [sys.executable, "-W", _UNCLEAN, "-m", "hil.validation.proof.answer.blind", str(cases.resolve())]
    options = [str(answers.resolve()), "--jobs", str(jobs), "--hours", str(hours)]
    if scheduler is not None:
        options += ["--scheduler", scheduler]
    with subprocess.Popen([*blind, *options], stdout=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            for _ in process.stdout or ():
                done += 1
                progress(task, done / len(names))
            ended = process.wait()
        except BaseException:
            os.killpg(process.pid, signal.SIGTERM)  # with the processes that it started
            raise
    if ended:
        raise HilError(
            f"{cases}: the blind diagnosis ended with code {ended} before all cases had an answer; run "
            "the same command again to continue"
        )


def make_folder(folder: Path) -> None:
    """Make the folder of a new proof, or accept one whose drawing was interrupted."""
    if folder.is_file():
        raise InputError(f"{folder}: is a file, allowed a folder; give another --out")
    if folder.exists() and {path.name for path in folder.iterdir()} - {CASES, SEALED}:
        raise InputError(f"{folder}: holds other things than a proof; give another --out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}); give another --out") from None
