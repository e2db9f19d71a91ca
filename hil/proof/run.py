"""A proof from the draw to the scores: conceal, seal, diagnose blind, unseal, run what was asked for, score."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from itertools import takewhile
from math import inf
from pathlib import Path

from hil.errors import HilError, InputError
from hil.proof.answer.answers import read_replies
from hil.proof.answer.blind import answered
from hil.proof.answer.follow_up import AGAIN, record_again
from hil.proof.draw.plan import PLANTS, Planned
from hil.proof.score.scores import Scores, score
from hil.proof.seal import CASES, SEAL, SEALED, code_sha256, draw_cases, read_seal, seal, unseal

ANSWERS, PEERS = "answers", "peers"
# Processes that are stopped by ctrl-C leave semaphores, which are then cleared away: nothing that a user can act on.
_UNCLEAN = "ignore::UserWarning:multiprocessing.resource_tracker"

Say = Callable[[str], None]  # what is to be kept
Tell = Callable[[str, float | None], None]  # what is going on, and the share that is done


def prove(
    folder: Path,
    planned: Sequence[Planned],
    seed: int,
    jobs: int,
    say: Say,
    tell: Tell,
    plant: str = "simulated",
    only: Sequence[str] = (),
    hours: float = inf,
) -> Scores:
    """Do what is still to be done of a proof in `folder`, on a plant of `plan.PLANTS`, and score it; `only` are the
    tiers that it was planned of, where not of all.

    After `hours` of diagnosing no case is begun, and the first ones, up to one without an answer, are scored: cases lie
    in mixed order, so that they are a fair sample, where all that were quick would not be.

    Raises InputError where `folder` holds another proof, HilError where what was sealed has changed or the blind
    process failed.
    """
    full = not only and len(planned) == sum(PLANTS[plant].values())
    cases = "--full" if full else f"--cases {len(planned)}"
    which = "".join(f"--only {tier} " for tier in only) + ("" if plant == "simulated" else f"--plant {plant} ")
    command = f"hil prove {which}{cases} --seed {seed} --out DIR"
    about = read_seal(folder)
    if about is None:
        if folder.is_file():
            raise InputError(f"{folder}: is a file, allowed a folder; give another --out")
        if folder.exists() and {path.name for path in folder.iterdir()} - {CASES, SEALED}:
            raise InputError(f"{folder}: holds other things than a proof; give another --out")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be made ({error.strerror}); give another --out") from None
        tell("drawing cases", 0.0)
        draw_cases(folder, planned, seed, jobs, lambda share: tell("drawing cases", share), plant)
        about = seal(folder, planned, command, seed)
    elif about["command"] != command:
        raise InputError(
            f"{folder / SEAL}: given {command}, allowed what was sealed, {about['command']}; or another --out"
        )
    say(f"sealed: SHA-256 {about['truths_sha256']}, {about['cases']} cases, {about['sealed_at']}")
    names = [case.name for case in planned]
    diagnose_blind(
        folder / CASES,
        folder / ANSWERS,
        names,
        about["code_sha256"],
        jobs,
        lambda share: tell("diagnosing blind", share),
        hours,
    )
    sealed = unseal(folder)
    truths = {name: sealed[name] for name in takewhile(lambda name: answered(folder / ANSWERS / name), names)}
    if len(truths) < len(names):
        say(f"the first {len(truths)} of {len(names)} cases have an answer and are scored; the same again goes on")
    tell("running proposed motions", 0.0)
    again = record_again(folder, folder / ANSWERS, truths, jobs, lambda share: tell("running proposed motions", share))
    diagnose_blind(
        folder / AGAIN / CASES,
        folder / AGAIN / ANSWERS,
        again,
        about["code_sha256"],
        jobs,
        lambda share: tell("diagnosing again", share),
    )
    tell("scoring", None)
    return score(truths, read_replies(folder / ANSWERS, truths), read_replies(folder / AGAIN / ANSWERS, again))


def score_others(folder: Path, scores: Scores) -> dict[str, Scores]:
    """Scores of other methods by name, of those cases of `scores` whose answers lie in DIR/peers/METHOD/NAME."""
    truths = {case.truth.name: case.truth for case in scores.cases}
    answers = {place.name: read_replies(place, truths) for place in sorted((folder / PEERS).glob("*/"))}
    return {
        method: score({name: truths[name] for name in replies}, replies)
        for method, replies in answers.items()
        if replies
    }


def diagnose_blind(
    cases: Path,
    answers: Path,
    names: Sequence[str],
    code: str,
    jobs: int,
    told: Callable[[float], None],
    hours: float = inf,
) -> None:
    """Have all cases without an answer diagnosed by another process, by the code that was sealed; none is begun after
    `hours`."""
    done = sum(answered(answers / name) for name in names)
    if done == len(names) or hours <= 0.0:
        return
    if code_sha256() != code:
        raise InputError(
            f"{cases.parent}: was sealed for a diagnosis by other code than this (SHA-256 {code}); "
            "answers of two would mix: give another --out"
        )
    told(done / len(names))
    blind = [
        sys.executable,
        "-W",
        _UNCLEAN,
        "-m",
        "hil.proof.answer.blind",
        str(cases.resolve()),
        str(answers.resolve()),
        "--jobs",
        str(jobs),
        "--hours",
        str(hours),
    ]
    with subprocess.Popen(blind, stdout=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            for _ in process.stdout or ():
                done += 1
                told(done / len(names))
            ended = process.wait()
        except BaseException:
            os.killpg(process.pid, signal.SIGTERM)  # with the processes that it started
            raise
    if ended:
        raise HilError(
            f"{cases}: the blind diagnosis ended with code {ended} before all cases had an answer; run "
            "the same again to go on"
        )
