"""From files to a diagnosis in one step: maps, recordings, bench, diagnosis and page in one folder.

    FILE -> FOLDER/FILE-map.yaml -> recording -> FOLDER/bench.yaml -> diagnosis -> FOLDER/report/report.html

A map and a bench are drafted where the folder has none. From then on they are the user's: the next explanation takes
them as they are and writes the report anew. Only a drafted bench that nobody edited follows its map and data.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from hil.drafting.draft_mark import draft_state, marked
from hil.drafting.first_look import first_look
from hil.errors import InputError, PartOfAxis, RateNeeded
from hil.exchange.own_file import read_exported
from hil.files.input_file import is_file
from hil.files.output import rewritten_folder, write_text
from hil.files.yaml_model import yaml_text
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.joined_logs import join_logs
from hil.importing.map_text import asked_lines, map_text
from hil.importing.own_units import COUNT_AS, take_own_units
from hil.importing.readme import FileHints
from hil.importing.several_files import is_whole, set_points_alone
from hil.importing.still_open import still_open
from hil.recording.recording import Recording, read_recording

# Bench, draft and diagnosis load compiled kernels and more, for which the first look must not wait.
if TYPE_CHECKING:
    from hil.bench.bench_file import Bench
    from hil.diagnosis.diagnosis import Diagnosis
    from hil.drafting.drafted_bench import DraftedBench

BENCH, REPORT, PAGE = "bench.yaml", "report", "report.html"  # within the folder of an explanation
# Sizes that are found by a relation of two columns, and their relative error: what files state differs by more.
_FOUND_SIZES, _SIZE_ERROR = ("counts_per_rev", "counts_per_m", "scale"), 2e-4
_DRAFTED_WITH = "# Drafted with: "  # options, at the end of a map
OUTDATED = (
    "THE MAP OR THE DATA CHANGED since it was drafted. It was edited, so it is kept, with values of the former map; "
    "remove it to have it drafted anew"
)


@dataclass(frozen=True, eq=False)
class Basis:
    """What a diagnosis begins with: recordings, their bench, its draft if it is new, and what was assumed."""

    recordings: tuple[Recording, ...]
    bench: Bench
    draft: DraftedBench | None
    assumed: tuple[str, ...]

    @property
    def unsized(self) -> dict[str, list[str]]:
        """Channels of each map whose size nothing tells, or its lead, so that their values are multiples."""
        return _unsized(self.assumed)


@dataclass(frozen=True, eq=False)
class Explanation:
    """A diagnosis and what it rests on; `folder` has the maps, the bench and the report, whose page is `report`."""

    basis: Basis
    diagnosis: Diagnosis
    folder: Path

    @property
    def bench(self) -> Bench:
        """The bench that the recordings were compared with: that of the folder or of the recordings, or a draft."""
        return self.basis.bench

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The recordings, read by their maps."""
        return self.basis.recordings

    @property
    def assumed(self) -> tuple[str, ...]:
        """What was assumed of recordings and bench, with the file in which it can be corrected."""
        return self.basis.assumed

    @property
    def report(self) -> Path:
        """The page."""
        return self.folder / REPORT / PAGE

    def __repr__(self) -> str:
        return "\n".join([repr(self.diagnosis), "Assumed:", *(f"  - {one}" for one in self.assumed), str(self.report)])

    def _repr_html_(self) -> str:
        told = "".join(f"<li>{escape(one)}</li>" for one in self.assumed)
        return f"{self.diagnosis._repr_html_()}<p>Assumed:</p><ul>{told}</ul><p>Report: {escape(str(self.report))}</p>"


def explain(
    sources: str | Path | Sequence[str | Path],
    folder: str | Path | None = None,
    *,
    rate_hz: float | None = None,
    axis: str | None = None,
    readme: str | Path | None = None,
    progress: Callable[[str], None] = lambda text: None,
    look: Callable[[list[str]], None] = lambda lines: None,
    first: Callable[[Basis], None] = lambda basis: None,
    answer: Callable[[Diagnosis], None] = lambda diagnosis: None,
    budget_s: float | None = None,
) -> Explanation:
    """Read the recordings of one axis, draft what the folder lacks, diagnose, and write the page.

    sources: a file or several, any that `hil import` reads; where one has the position and another the torque, they are
    joined by their stamps. folder: None takes explained-NAME of the first file; maps and bench that are there are used,
    so correct them and call again. rate_hz: rows per second of files without time stamps. axis: that of files with
    several. readme: a text of their owner, which tells what they do not: lead, counts, torque constant. progress:
    called with each step. look: called with what the recordings show without a twin, as soon as they are read. first:
    called with what is known before the search. answer: called with the diagnosis before its page is drawn. budget_s:
    processor time of the search [s].

    Returns `diagnosis`, `bench`, `recordings`, `assumed`, `folder` and `report`. Raises InputError for a file that
    cannot be read, with the lines of its map that the user must complete, and for recordings that cannot be diagnosed.
    """
    paths = [Path(one) for one in ((sources,) if isinstance(sources, str | Path) else sources)]
    if not paths:
        raise InputError("sources: given none, allowed one or more; give the recordings to explain")
    folder = Path(f"explained-{paths[0].stem}") if folder is None else Path(folder)
    told = FileHints(rate_hz, axis, None if readme is None else Path(readme))
    alone = set_points_alone(paths)
    try:
        read, assumed = _recordings([one for one in paths if one not in alone], folder, told, progress)
        assumed = [*(f"{one}: left out: it has set-points alone" for one in alone), *assumed]
    except PartOfAxis:
        if len(paths) == 1:
            raise
        joined = folder / f"{paths[0].stem}-joined.csv"
        how = join_logs(paths, joined, any(is_whole(one, told) for one in paths), told)
        read, assumed = _recordings([joined], folder, told._replace(rate_hz=None), progress)
        assumed = [how, *assumed]
    unsized = [channel for channels in _unsized(assumed).values() for channel in channels]
    look(first_look(read, turns_told=not any(one.startswith(("lead", "motor")) for one in unsized)))
    progress("taking the bench, or drafting it")
    bench, draft, notes = _bench(read, folder / BENCH)
    warnings = [one for one in notes if OUTDATED in one]
    basis = Basis(tuple(read), bench, draft, (*warnings, *assumed, *(one for one in notes if one not in warnings)))
    first(basis)
    from hil.diagnosis.diagnose import diagnose
    from hil.report.diagnosis_report import write_diagnosis

    with rewritten_folder(folder / REPORT, PAGE) as part:
        diagnosis = diagnose(read, (), bench, progress, budget_s)
        answer(diagnosis)
        progress("writing the report")
        path = folder / BENCH
        write_diagnosis(diagnosis, part, basis.assumed, path if is_file(path) else None)
    return Explanation(basis, diagnosis, folder)


def _unsized(assumed: Sequence[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for note, mark, _ in (one.partition(f": {COUNT_AS}") for one in assumed):
        path, _, channel = note.rpartition(": ")
        if mark:
            found.setdefault(path, []).append(channel)
    return found


def _recordings(
    paths: Sequence[Path], folder: Path, told: FileHints, progress: Callable[[str], None]
) -> tuple[list[Recording], list[str]]:
    """The recordings of files, and what was assumed. One map is for all files whose drafts say the same."""
    read, assumed = list[Recording](), list[str]()
    first = _map_path(paths[0], paths, folder)
    for source in paths:
        progress(f"reading {source.name}")
        path = _map_path(source, paths, folder)
        shared = not is_file(path) and is_file(first) and _alike(source, paths[0], told)
        recording, notes = _recording(source, first if shared else path, told)
        read.append(recording)
        assumed += notes
    return read, list(dict.fromkeys(assumed))


def _alike(source: Path, first: Path, told: FileHints) -> bool:
    """True if the drafts of the maps of two files say the same, so that one map is right for both."""
    with suppress(InputError):
        drafts = [yaml.safe_load(map_text(draft_map(one, *told))) for one in (source, first)]
        return _same(drafts[0] | {"about": ""}, drafts[1] | {"about": ""})
    return False


def _same(one: object, other: object) -> bool:
    """True of drafts that are the same but for the errors with which the sizes of counts and units are found."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(
            isclose(value, other[key], rel_tol=_SIZE_ERROR)
            if key in _FOUND_SIZES and isinstance(value, int | float) and isinstance(other[key], int | float)
            else _same(value, other[key])
            for key, value in one.items()
        )
    return one == other


def _map_path(source: Path, sources: Sequence[Path], folder: Path) -> Path:
    """The map of a source; those of one name have their folder in it. Raises InputError for one given twice."""
    alike = [one for one in sources if one.stem == source.stem]
    name = source.stem if len(alike) == 1 else f"{source.resolve().parent.name}-{source.name}"
    if len({(one.resolve().parent.name, one.name) for one in alike}) < len(alike):
        raise InputError(f"{source}: given twice, or beside a file of the same name and folder name; give each once")
    return folder / f"{name}-map.yaml"


def _recording(source: Path, path: Path, given: FileHints) -> tuple[Recording, list[str]]:
    """A recording of this project as it is, any other file by its map at `path`; and what was assumed."""
    if not is_file(path):
        if (exported := read_exported(source)) is not None:
            return exported, []
        with suppress(InputError):  # a foreign file
            return read_recording(source), []
    options = given.options
    mark = f"{_DRAFTED_WITH}{shlex.join(options)}\n"
    command = shlex.join(["hil", "explain", str(source), "--out", str(path.parent), *options])
    notes = list[str]()
    if is_file(path):
        text = yaml_text(path)
        notes = [f"{path}: used as it is for {source.name}", *_still_open(source, path, text)]
    else:
        try:
            draft = draft_map(source, *given)
        except RateNeeded as error:
            raise RateNeeded(error.problem, command) from None
        take_own_units(draft)
        path.parent.mkdir(parents=True, exist_ok=True)
        text = map_text(draft) + (mark if options else "")
        write_text(path, text)
        notes = [f"{path}: which column is what, units and signs; drafted from the file"]
        notes += [f"{path}: {note}" for note in draft.unsure]
        notes += [f"{path}: column {name!r} is not used: {why}" for name, why in draft.left_out.items()]
    if options and mark not in text:
        raise InputError(
            f"{path}: it is there already and was not drafted with {shlex.join(options)}; edit it and leave the option "
            "out, remove it to have it drafted anew, or give another --out"
        )
    if asked := asked_lines(text):
        told = f"{source}: the file does not tell what follows; write it into the map, then: {command}"
        lines = [f"{path}:{line}: {question}" for line, question in asked]
        more = ["Check in it also:", *notes[1:]] if len(notes) > 1 else []
        raise InputError("\n".join([told, *lines, *more]))
    return import_recording(source, path), notes


def _still_open(source: Path, path: Path, text: str) -> list[str]:
    """Doubts of the draft of a map that its user has not settled; none where it cannot be drafted again."""
    with suppress(InputError, ValueError, yaml.YAMLError):  # of what a user wrote
        words = shlex.split("".join(text.partition(_DRAFTED_WITH)[2].splitlines()[:1]))
        draft = draft_map(source, *FileHints.of(dict(zip(words[::2], words[1::2], strict=True))))
        take_own_units(draft)
        return [f"{path}: {note}" for note in still_open(draft, text)]
    return []


def _bench(recordings: Sequence[Recording], path: Path) -> tuple[Bench, DraftedBench | None, list[str]]:
    """The bench file at `path`, else the bench of the first recording, else a draft; and what was assumed.

    A draft that nobody edited is made anew where the map or the data changed.
    """
    from hil.bench.bench_file import load_bench

    state, notes = None, list[str]()
    if is_file(path):
        state = draft_state(yaml_text(path), recordings)
        if state is None or state.edited or not state.outdated:
            changed = [f"{path}: {OUTDATED}"] if state and state.outdated else []
            return load_bench(path), None, [*changed, f"{path}: used as it is"]
        notes = [f"{path}: drafted anew, as the map or the data changed, and nobody had edited it"]
    elif "bench" in recordings[0].metadata:
        from hil.identification.measured import bench_of

        return bench_of(recordings[0]), None, [f"{recordings[0].name}: the bench with which it was recorded"]
    from hil.drafting.drafted_bench import drafted

    draft = drafted(recordings)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, marked(draft.text, recordings))
    notes.append(f"{path}: masses, friction, lead, gains, encoders; drafted from the recordings alone")
    return draft.bench, draft, [*notes, *(f"{path}: {note}" for note in draft.unsure)]
