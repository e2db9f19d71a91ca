"""What a worker does for one recording: look at it, fit what is constant of its axis, tell its condition, diagnose it.

Imports of the twin stand within the functions: the kernels of a worker are compiled into the folder of their sources.
"""

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from hil.errors import InputError
from hil.fleet.engine import WorkItem
from hil.fleet.reading import BENCH, MAP, SERVICE, moment_of, read
from hil.fleet.store import Row, Store

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench
    from hil.recording.recording import Recording

FLEET_BENCH = BENCH  # beside the folders of the axes: one bench for all of them


def look_at(fleet: Store, item: WorkItem) -> Row:
    """Read a recording: its moment, period, duration and channels."""
    recording = _read(fleet, item)
    moment = moment_of(recording, item.file)
    return {
        "moment": moment.timestamp(),
        "period_s": recording.period_s,
        "duration_s": len(recording) * recording.period_s,
        "channels": ",".join(recording.columns),
    }


def fit_axis(fleet: Store, item: WorkItem) -> Row:
    """Fit what is constant of an axis to the files in `item.given`."""
    _prepare()
    from hil.fleet.constants import fit_constants
    from hil.identification.derived_channels import reduced
    from hil.identification.measured import bench_of, take

    recordings = [_read(fleet, item._replace(file=file)) for file in json.loads(item.given)]
    bench = _bench(fleet, item.axis) or bench_of(recordings[0])
    runs = []
    for recording in recordings:
        try:
            runs.append(take(recording, reduced(bench, [recording])))
        except InputError:  # of another kind or another sampling; it is told where its condition is asked for
            continue
    if not runs:
        raise InputError(f"{item.axis}: none of its first recordings fits its bench file; check {BENCH}")
    found = fit_constants(runs, bench)
    return {
        "inertia": found.inertia,
        "inertia_error": found.inertia_error,
        "period_s": found.period_s,
        "fitted": ",".join(found.fitted),
        "bench": found.bench.model_dump_json(),
    }


def tell_condition(fleet: Store, item: WorkItem) -> Row:
    """Tell the condition of the axis by one recording; `item.given` are the constants of the axis."""
    _prepare()
    from hil.bench.bench_file import Bench
    from hil.fleet.condition import condition
    from hil.fleet.constants import Constants
    from hil.identification.derived_channels import reduced
    from hil.identification.measured import take

    given = json.loads(item.given)
    bench = Bench.model_validate_json(given["bench"])
    constants = Constants(bench, given["inertia"], given["inertia_error"], given["period_s"], ())
    recording = _read(fleet, item)
    if abs(recording.period_s - constants.period_s) > 0.01 * constants.period_s:
        raise InputError(
            f"{item.file}: has a row every {recording.period_s:g} s, the others of its axis every "
            f"{constants.period_s:g} s; put recordings of another sampling into a folder of their own"
        )
    run = take(recording, reduced(bench, [recording]))
    row: Row = {}
    for name, told in condition(run, constants, recording.axis.position_command in recording.columns).items():
        row |= {name: told.value, f"{name}_error": told.error, f"{name}_reason": told.reason}
    return row


def diagnose_one(fleet: Store, results: Store, item: WorkItem) -> Row:
    """Diagnose a recording with the bench of its axis in full, and write its report."""
    _prepare()
    from hil.bench.bench_file import Bench
    from hil.diagnosis.diagnose import diagnose
    from hil.report.diagnosis_report import write_diagnosis

    bench = Bench.model_validate_json(json.loads(item.given)["bench"])
    found = diagnose([_read(fleet, item)], (), bench)
    place = f"diagnoses/{item.axis}/{Path(item.file).stem}"
    with TemporaryDirectory() as folder:
        write_diagnosis(found, Path(folder), ())
        results.put(Path(folder), place)
    return {"verdict": str(found.result.verdict), "statement": found.result.statement, "page": f"{place}/report.html"}


def watch_axis(fleet: Store, results: Store, item: WorkItem) -> Row:
    """Find the trend of an axis by the conditions in the dataset, and write its page and its JSON."""
    from hil.channels import AxisKind
    from hil.files.optional_library import missing_of
    from hil.fleet.axis_page import axis_page
    from hil.fleet.curves import small_curve
    from hil.fleet.trend import as_json, date_of, read_services, trend
    from hil.fleet.words import by_test, why

    index = {row["file"]: row for row in results.rows("index", item.axis)}
    told = [row | {"moment": index[row["file"]]["moment"]} for row in results.rows("condition", item.axis)]
    known = {row["file"] for row in told}
    text = fleet.read(f"{item.axis}/{SERVICE}") or b""
    services = read_services(text.decode("utf-8-sig", "replace"), f"{item.axis}/{SERVICE}")
    channels = next((row["channels"] for row in index.values() if row["channels"]), "").split(",")
    refused = [row for row in index.values() if row["file"] not in known]
    found = trend(item.axis, [*told, *refused], services, AxisKind.of(channels) is AxisKind.LINEAR)
    results.write(f"axes/{item.axis}.json", as_json(found).encode())
    if not missing_of("report"):
        results.write(f"axes/{item.axis}.html", axis_page(found, json.loads(item.given)))
    shown = found.shown
    last = services[-1:]
    return {
        "need": found.need,
        "why": why(found),
        "curve": str(small_curve(shown)) if shown else "",
        "tests": json.dumps(by_test(found)),
        "good": found.good,
        "bad": len(found.bad),
        "service": f"{date_of(last[0].day)} {last[0].what}" if last else "",
        "newest": found.newest,
        "changed": bool(found.changed),
    }


@cache
def _prepare() -> None:
    from hil.compiled.kernel_cache import provide_kernel_cache

    provide_kernel_cache()


def _read(fleet: Store, item: WorkItem) -> "Recording":
    with fleet.fetched([item.file, f"{item.axis}/{MAP}"]) as (path, map_path):
        return read(path, map_path)


def _bench(fleet: Store, axis: str) -> "Bench | None":
    from hil.bench.bench_file import load_bench
    from hil.files.input_file import is_file

    with fleet.fetched([f"{axis}/{BENCH}", FLEET_BENCH]) as paths:
        found: Any = next((load_bench(path) for path in paths if is_file(path)), None)
        return found  # type: ignore[no-any-return]
