"""From files to a diagnosis in one step: maps, recordings, bench, diagnosis and page in one folder.

    FILE -> FOLDER/FILE-map.yaml -> recording -> FOLDER/bench.yaml -> diagnosis -> FOLDER/report/report.html

A map and a bench are drafted where the folder has none. From then on they are the user's: the next explanation takes
them as they are and writes the report anew.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.time_left import BUDGET_S
from hil.drafting.bench_text import bench_text
from hil.drafting.draft_bench import BenchDraft, draft_bench
from hil.errors import InputError
from hil.exchange.own_file import read_exported
from hil.files.input_file import is_file
from hil.files.output import rewritten_folder, write_text
from hil.identification.measured import bench_of
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_text import asked_lines, map_text
from hil.importing.own_units import take_own_units
from hil.loop.simulated_bench import load_simulated
from hil.recording.recording import Recording, read_recording
from hil.report.diagnosis_report import write_diagnosis

BENCH, REPORT, PAGE = "bench.yaml", "report", "report.html"  # within the folder of an explanation


@dataclass(frozen=True, eq=False)
class Basis:
    """What a diagnosis begins with: recordings, their bench, its draft if it is new, and what was assumed."""

    recordings: tuple[Recording, ...]
    bench: Bench
    draft: BenchDraft | None
    assumed: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Explanation:
    """A diagnosis and what it rests on; `report` is its page."""

    basis: Basis
    diagnosis: Diagnosis
    report: Path


def explain(
    sources: Sequence[Path],
    folder: Path,
    *,
    rate_hz: float | None = None,
    axis: str | None = None,
    progress: Callable[[str], None] = lambda text: None,
    first: Callable[[Basis], None] = lambda basis: None,
    answer: Callable[[Diagnosis], None] = lambda diagnosis: None,
    budget_s: float = BUDGET_S,
) -> Explanation:
    """Read the recordings of one axis, draft what the folder lacks, diagnose, and write the page.

    `rate_hz`: rows per second of files without time stamps, `axis`: that of files with several. `progress` gets each
    step, `first` what is known before the search, `answer` the diagnosis before its page is drawn.

    Raises InputError for a file that cannot be read, with the lines of its map that the user must complete, and for
    recordings that cannot be diagnosed.
    """
    read = list[Recording]()
    assumed = list[str]()
    for source in sources:
        progress(f"reading {source.name}")
        recording, notes = _recording(source, folder, rate_hz, axis)
        read.append(recording)
        assumed += notes
    progress("taking the bench, or drafting it")
    bench, draft, notes = _bench(read, folder / BENCH)
    basis = Basis(tuple(read), bench, draft, (*assumed, *notes))
    first(basis)
    with rewritten_folder(folder / REPORT, PAGE) as part:
        diagnosis = diagnose(read, (), bench, progress, budget_s)
        answer(diagnosis)
        progress("writing the report")
        path = folder / BENCH
        write_diagnosis(diagnosis, part, basis.assumed, path if is_file(path) else None)
    return Explanation(basis, diagnosis, folder / REPORT / PAGE)


def _recording(source: Path, folder: Path, rate_hz: float | None, axis: str | None) -> tuple[Recording, list[str]]:
    """A recording of this project as it is, any other file by its map; and what was assumed."""
    path = folder / f"{source.stem}-map.yaml"
    if not is_file(path):
        if (exported := read_exported(source)) is not None:
            return exported, []
        with suppress(InputError):  # a foreign file
            return read_recording(source), []
    notes = [f"{path}: used as it is"]
    if not is_file(path):
        draft = draft_map(source, rate_hz, axis)
        take_own_units(draft)
        folder.mkdir(parents=True, exist_ok=True)
        write_text(path, map_text(draft))
        notes = [f"{path}: which column is what, units and signs; drafted from the file"]
        notes += [f"{path}: {note}" for note in draft.unsure]
        notes += [f"{path}: column {name!r} is not used: {why}" for name, why in draft.left_out.items()]
    if asked := asked_lines(path.read_text(encoding="utf-8")):
        command = shlex.join(["hil", "explain", str(source), "--out", str(folder)])
        told = f"{source}: the file does not tell what follows; write it into the map, then: {command}"
        raise InputError("\n".join([told, *(f"{path}:{line}: {question}" for line, question in asked)]))
    return import_recording(source, path), notes


def _bench(recordings: Sequence[Recording], path: Path) -> tuple[Bench, BenchDraft | None, list[str]]:
    """The bench file at `path`, else the bench of the first recording, else a draft; and what was assumed."""
    if is_file(path):
        return load_bench(path), None, [f"{path}: used as it is"]
    if "bench" in recordings[0].metadata:
        return bench_of(recordings[0]), None, [f"{recordings[0].name}: the bench with which it was recorded"]
    draft = draft_bench(*recordings)
    text = valid_bench_text(draft, path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)
    notes = [f"{path}: masses, friction, lead, gains, encoders; drafted from the recordings alone"]
    return load_bench(path), draft, [*notes, *(f"{path}: {note}" for note in draft.unsure)]


def valid_bench_text(draft: BenchDraft, path: Path) -> str:
    """The text of a drafted bench file, checked as `hil validate` does. Raises InputError where it is not valid."""
    text = bench_text(draft)
    with TemporaryDirectory() as folder:
        written = Path(folder) / path.name
        written.write_text(text, encoding="utf-8")
        try:
            load_simulated(written)
        except InputError as error:
            told = str(error).replace(f"{folder}/", "")
            raise InputError(f"the draft is no valid bench, and is not written: {told}") from None
    return text
