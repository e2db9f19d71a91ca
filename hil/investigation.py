"""Alternate runs and diagnoses, each run designed by the last diagnosis, until no question is open."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.experiment import NEXT_EXPERIMENT
from hil.diagnosis.open_questions import no_experiment
from hil.diagnosis.wording import titles
from hil.errors import HilError, InputError
from hil.files.output import write_json
from hil.loop.run import RunResult
from hil.motion.profile import Profile, write_profile
from hil.recording.recording import Recording, read_recording
from hil.report.console import Progress

Run = Callable[[Profile, Path, str], RunResult]  # profile, folder, name of the recording


@dataclass(frozen=True, eq=False)
class Round:
    """Motions of a round, and the diagnosis of all recordings up to it."""

    motions: tuple[str, ...]
    diagnosis: Diagnosis

    @property
    def open(self) -> tuple[str, ...]:
        """Mechanisms that another motion could distinguish or show."""
        following = self.diagnosis.result.next_experiment
        return following.separates if following else ()


@dataclass(frozen=True, eq=False)
class Investigation:
    """The rounds in order, and the reason why it ended."""

    rounds: tuple[Round, ...]
    ended: str

    @property
    def diagnosis(self) -> Diagnosis:
        """Diagnosis of all recordings."""
        return self.rounds[-1].diagnosis


def investigate(
    profiles: Mapping[str, Profile],
    held_out: Mapping[str, Profile],
    bench: Bench,
    folder: Path,
    run: Run,
    allowed: Callable[[Profile], bool],
    progress: Callable[[], AbstractContextManager[Progress]],
    rounds: int = 3,
) -> Investigation:
    """Investigate a bench, starting with `profiles` by name; `held_out` are run in the first round for validation.

    Writes recordings, designed profiles and each round's diagnosis.json to `folder`/round_1 and so on. `run` runs a
    profile on the bench; `allowed` decides whether a designed one may be run. Raises HilError if a run stops early,
    InputError for recordings that cannot be diagnosed.
    """
    if rounds < 1:
        raise InputError(f"rounds: given {rounds}, allowed 1 or more")
    train: list[Recording] = []
    proving: list[Recording] = []
    found: list[Round] = []
    while True:
        place = folder / f"round_{len(found) + 1}"
        train += [_recorded(run, profile, place, name) for name, profile in profiles.items()]
        if not found:
            proving = [_recorded(run, profile, place, name) for name, profile in held_out.items()]
        with progress() as tell:
            diagnosis = diagnose(train, proving, bench, tell)
        write_json(place / "diagnosis.json", diagnosis.result.as_json())
        found.append(Round(tuple(profiles), diagnosis))
        following = diagnosis.experiment.profile if diagnosis.experiment else None
        if following is None:
            return Investigation(tuple(found), _settled(diagnosis))
        if len(found) > 1 and set(found[-1].open) >= set(found[-2].open):
            return Investigation(tuple(found), f"The last round answered no question. Open: {titles(found[-1].open)}.")
        if len(found) == rounds:
            return Investigation(tuple(found), f"All {rounds} rounds are done. Open: {titles(found[-1].open)}.")
        if not allowed(following):
            return Investigation(tuple(found), f"{NEXT_EXPERIMENT} was not run: it was not confirmed.")
        name = f"{Path(NEXT_EXPERIMENT).stem}_{len(found)}"
        (folder / f"round_{len(found) + 1}").mkdir()
        write_profile(folder / f"round_{len(found) + 1}" / f"{name}.yaml", following)
        profiles = {name: following}


def _recorded(run: Run, profile: Profile, folder: Path, name: str) -> Recording:
    ran = run(profile, folder, name)
    if not ran.complete or ran.recording is None:
        raise HilError(f"{name} stopped: {ran.outcome.ending}: {ran.outcome.reason}; the recording is in {folder}")
    return read_recording(ran.recording)


def _settled(diagnosis: Diagnosis) -> str:
    if diagnosis.experiment:
        return diagnosis.experiment.note
    return no_experiment(diagnosis.result)
