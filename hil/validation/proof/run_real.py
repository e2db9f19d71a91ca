"""Run a proof on real recordings: conceal, seal, diagnose blind, unseal, score."""

import shutil
from collections.abc import Callable, Sequence
from itertools import takewhile
from math import inf
from pathlib import Path

from hil.bench.bench_file import Bench
from hil.errors import InputError
from hil.recording.recording import Recording, write_parquet
from hil.report.console import Progress
from hil.validation.proof.answer.answers import read_answers
from hil.validation.proof.answer.blind import answered
from hil.validation.proof.conceal.cases import RealTruth, bench_yaml, check, draw_cases, ways
from hil.validation.proof.conceal.half import Half
from hil.validation.proof.draw.plan import Planned
from hil.validation.proof.run import ANSWERS, diagnose_blind, make_folder
from hil.validation.proof.score.real import RealScores, score_real
from hil.validation.proof.seal import CASES, SEAL, SEALED, read_seal, seal, unsealed, write_part


def prove_recordings(
    folder: Path,
    recordings: Sequence[Recording],
    bench: Bench | None,
    cases: int,
    seed: int,
    jobs: int,
    say: Callable[[str], None],
    progress: Progress,
    hours: float = inf,
    scheduler: str | None = None,
) -> RealScores:
    """Complete the proof of recordings in `folder` and score it; `bench` is that of their axis, default: drafted.

    Raises InputError if `folder` holds another proof or no recording gives cases, HilError if sealed files changed or
    the blind process failed.
    """
    known = [recording.name for recording in recordings]
    if len(set(known)) < len(known):
        raise InputError(f"--recording: given {', '.join(known)}, allowed files of different names; rename one")
    names = " ".join(f"--recording {recording.name}" for recording in recordings)
    given = f" --bench {bench.name}" if bench is not None else ""
    command = f"hil prove {names}{given} --cases {cases} --seed {seed} --out DIR"
    about = read_seal(folder)
    if about is None:
        make_folder(folder)
        progress("concealing effects", None)
        about = seal(folder, _conceal(folder, recordings, bench, cases, seed, say), command, seed)
    elif about["command"] != command:
        raise InputError(
            f"{folder / SEAL}: given {command}, allowed what was sealed, {about['command']}; or another --out"
        )
    say(f"sealed: SHA-256 {about['truths_sha256']}, {about['cases']} cases, {about['sealed_at']}")
    order = sorted(path.name for path in (folder / CASES).iterdir())
    code = about["code_sha256"]
    diagnose_blind(folder / CASES, folder / ANSWERS, order, code, jobs, progress, "diagnosing blind", hours, scheduler)
    sealed = unsealed(folder)
    first = list(takewhile(lambda name: answered(folder / ANSWERS / name), order))
    if len(first) < len(order):
        say(
            f"the first {len(first)} of {len(order)} cases have an answer; scored are those whose untouched halves "
            "have one too; the same command continues"
        )
    progress("scoring", None)
    truths = {name: RealTruth.from_json(sealed[name]) for name in first}
    return score_real(truths, read_answers(folder / ANSWERS, truths))


def _conceal(
    folder: Path,
    recordings: Sequence[Recording],
    bench: Bench | None,
    cases: int,
    seed: int,
    say: Callable[[str], None],
) -> list[Planned]:
    """Draw and write all cases; those of an interrupted drawing are written anew."""
    found: list[tuple[Half, Half]] = []
    for recording in recordings:
        try:
            for pair in ways(recording, bench):
                check(pair)
                found.append(pair)
        except InputError as error:
            say(f"left out: {error}")
    if not found:
        raise InputError("--recording: given recordings of which no half gives a bench; give longer ones, or --bench")
    for part in (CASES, SEALED):
        shutil.rmtree(folder / part, ignore_errors=True)
    drawn = draw_cases(found, cases, seed)
    for case in drawn:
        place = folder / CASES / case.truth.name
        place.mkdir(parents=True)
        write_parquet(case.recording, place / "train_1.parquet")
        (place / "bench.yaml").write_text(bench_yaml(case.bench), encoding="utf-8")
        write_part(folder, case.truth.name, case.truth.as_json())
    return [Planned(case.truth.name, "real", number) for number, case in enumerate(drawn)]
