"""Write what the public API gives to files: the ending of the name says the form."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnosis import Diagnosis
from hil.drafting.drafted_bench import DraftedBench
from hil.errors import InputError
from hil.exchange.csv_file import metadata_path
from hil.exchange.export import WRITERS, export_recording
from hil.files.input_file import is_file
from hil.files.output import write_json, write_text
from hil.identification.compare import Comparison
from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text
from hil.motion.profile import Profile, write_profile
from hil.recording.recording import Recording, write_parquet
from hil.report.compare_report import write_bench, write_comparison
from hil.report.diagnosis_report import write_diagnosis

Saved = Recording | Profile | Bench | DraftedBench | MapDraft | Comparison | Diagnosis

_YAML = (".yaml", ".yml")
_RESULTS = (".html", ".json")


def save(what: Saved, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write a recording, bench, profile, drafted map, comparison or diagnosis to a file, whole or not at all.

    path: its ending says the form. A recording: .parquet, or .csv, .mat, .h5, .mf4, .mcap for other tools. A bench
    or its draft, a profile, a drafted map: .yaml, as `load_bench`, `load_profile` and `import_recording` read them.
    A comparison or diagnosis: .html, a page that opens offline, or .json, its numbers. overwrite: replace a file that
    exists.

    Returns the path. Raises InputError for another ending, a file that exists, and a folder that is not there or
    cannot be written; TypeError for any other object.
    """
    path = Path(path)
    endings, write = _writer(what)
    if path.suffix.lower() not in endings:
        raise InputError(f"{path}: given the ending {path.suffix!r}, allowed {', '.join(endings)}; correct it")
    beside = [metadata_path(path)] if isinstance(what, Recording) and path.suffix.lower() == ".csv" else []
    old = [one for one in (path, *beside) if is_file(one)]
    if old and not overwrite:
        raise InputError(
            f"{old[0]}: the file exists and is not overwritten; give another name, remove it, or say overwrite=True"
        )
    with _aside(old):
        write(path)
    return path


@contextmanager
def _aside(old: Sequence[Path]) -> Iterator[None]:
    """Give files another name while those that take their place are written, and their own back if that fails."""
    moved = [(path, path.with_name(f".{path.name}.{os.getpid()}.old")) for path in old]
    for path, kept in moved:
        path.rename(kept)
    try:
        yield
    except BaseException:
        for path, kept in moved:
            kept.replace(path)
        raise
    for _, kept in moved:
        kept.unlink()


def _writer(what: Saved) -> tuple[tuple[str, ...], Callable[[Path], None]]:
    """The endings that an object has, and what writes it."""
    match what:
        case Recording():
            return (".parquet", *WRITERS), lambda path: _recording(what, path)
        case Profile():
            return _YAML, lambda path: write_profile(path, what)
        case Bench():
            return _YAML, lambda path: write_bench(what, path)
        case DraftedBench():
            return _YAML, lambda path: write_text(path, what.text)
        case MapDraft():
            return _YAML, lambda path: write_text(path, map_text(what))
        case Comparison():
            page = "compare.html"
            return _RESULTS, lambda path: _result(path, what.as_json, page, lambda part: write_comparison(what, part))
        case Diagnosis():
            page = "report.html"
            return _RESULTS, lambda path: _result(
                path, what.result.as_json, page, lambda part: write_diagnosis(what, part)
            )
    raise TypeError(f"what: given {type(what).__name__}, allowed a recording, bench, profile, map or result")


def _recording(recording: Recording, path: Path) -> None:
    if path.suffix.lower() == ".parquet":
        write_parquet(recording, path)
    else:
        export_recording(recording, path)


def _result(path: Path, numbers: Callable[[], object], page: str, report: Callable[[Path], None]) -> None:
    """Write the numbers, or the page of a report, whose pictures are within it."""
    if path.suffix.lower() == ".json":
        write_json(path, numbers())
        return
    with TemporaryDirectory() as folder:
        report(Path(folder))
        write_text(path, (Path(folder) / page).read_text(encoding="utf-8"))
