"""The stages of a fleet: index, constants of each axis, conditions, diagnoses, trends. Each goes on from what is there.

A result has an id made of all that it depends on: the file with its size and stamp, then bench and map of the axis.
What has changed is done again, and nothing else.
"""

import hashlib
import json
from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial

import pyarrow as pa

from hil.errors import InputError
from hil.files.optional_library import missing_of
from hil.fleet.constants import FITTED, LOOKED_AT
from hil.fleet.engine import BAD, GOOD, Engine, StageOfWork, WorkItem, columns
from hil.fleet.quantities import QUANTITIES
from hil.fleet.reading import BENCH, MAP, SERVICE, is_recording
from hil.fleet.store import Row, Store, StoredFile
from hil.fleet.work import diagnose_one, fit_axis, look_at, tell_condition, watch_axis

METHOD = "1"  # of the quantities; another one makes them anew
PAGES = "2"  # of the trends and their pages; another one makes them anew
INDEX, CONSTANTS, CONDITION, DIAGNOSES, TRENDS = "index", "constants", "condition", "diagnosed", "trends"
PAGE = "fleet.html"
_NUMBER, _TEXT = pa.float64(), pa.string()
INDEX_COLUMNS = columns(moment=_NUMBER, period_s=_NUMBER, duration_s=_NUMBER, channels=_TEXT, size=pa.int64())
_CONSTANTS = columns(inertia=_NUMBER, inertia_error=_NUMBER, period_s=_NUMBER, fitted=_TEXT, bench=_TEXT)
_OF_QUANTITIES = {
    f"{one.name}{part}": kind
    for one in QUANTITIES
    for part, kind in (("", _NUMBER), ("_error", _NUMBER), ("_reason", _TEXT))
}
CONDITION_COLUMNS = columns(moment=_NUMBER, **_OF_QUANTITIES)
_DIAGNOSES = columns(verdict=_TEXT, statement=_TEXT, page=_TEXT)
_TRENDS = columns(
    need=_NUMBER, why=_TEXT, curve=_TEXT, tests=_TEXT, good=pa.int64(), bad=pa.int64(), service=_TEXT, newest=_TEXT,
    changed=pa.bool_(),
)  # fmt: skip


@dataclass(frozen=True)
class Fleet:
    """Recordings of many axes, the place of their results, and what does the work."""

    recordings: Store
    engine: Engine

    @property
    def results(self) -> Store:
        """Where results are."""
        return self.engine.results

    def index(self) -> list[Row]:
        """Look at every recording that is new or was changed; returns a row for each there is."""
        entries = {one.file: one for one in self.recordings.entries()}
        files = [one for one in entries.values() if is_recording(one.file)]
        if not files:
            raise InputError(
                f"{self.recordings.url}: holds no recordings, allowed a folder for each axis with its recordings: "
                "FLEET/AXIS/2025-03-01.parquet"
            )
        items = [WorkItem(_id(INDEX, _stamp(one), _of(entries, one, MAP)), _axis(one.file), one.file) for one in files]
        rows = self._run(StageOfWork(INDEX, INDEX_COLUMNS, partial(look_at, self.recordings)), items)
        for row in rows:
            row["size"] = entries[row["file"]].size
        return rows

    def constants(self, index: Sequence[Row]) -> dict[str, Row]:
        """Fit what is constant of each axis that has no values yet; returns a row for each axis."""
        entries = {one.file: one for one in self.recordings.entries()}
        by_axis = defaultdict[str, list[Row]](list)
        for row in index:
            if row["status"] == GOOD and row["axis"]:
                by_axis[row["axis"]].append(row)
        items = []
        for axis, rows in by_axis.items():
            first = [row["file"] for row in sorted(rows, key=lambda row: row["moment"])[:LOOKED_AT]]
            # until there are enough recordings the values are fitted anew with each one
            few = first if len(rows) < FITTED else []
            given = [_stamp(entries[name]) for name in (f"{axis}/{BENCH}", BENCH, f"{axis}/{MAP}") if name in entries]
            items.append(WorkItem(_id(CONSTANTS, METHOD, axis, *given, *few), axis, "", json.dumps(first)))
        done = [row for row in self.results.rows(CONSTANTS) if row["status"] == GOOD]
        stage = StageOfWork(CONSTANTS, _CONSTANTS, partial(fit_axis, self.recordings), alone=True)
        return {row["axis"]: row for row in self.engine.run(stage, items, done)}

    def compare(self) -> list[Row]:
        """Tell the condition by every recording that has none yet; returns a row for each there is."""
        index = self.index()
        constants = self.constants(index)
        items, bad = list[WorkItem](), dict[str, str]()
        for row in index:
            if row["status"] != GOOD:
                continue
            of_axis = constants.get(row["axis"])
            if of_axis is None or of_axis["status"] != GOOD:
                bad[row["id"]] = of_axis["reason"] if of_axis else "lies in no folder of an axis: FLEET/AXIS/FILE"
                continue
            given = json.dumps({name: of_axis[name] for name in ("bench", "inertia", "inertia_error", "period_s")})
            items.append(WorkItem(_id(CONDITION, row["id"], of_axis["id"]), row["axis"], row["file"], given))
        rows = self._run(StageOfWork(CONDITION, CONDITION_COLUMNS, partial(tell_condition, self.recordings)), items)
        moments = {row["file"]: row["moment"] for row in index}
        told = [row | {"moment": moments[row["file"]]} for row in rows]
        refused = [
            row | {"status": BAD, "reason": bad.get(row["id"], row["reason"])}
            for row in index
            if row["status"] != GOOD or row["id"] in bad
        ]
        return [*told, *refused]

    def pointed_at(self) -> list[str]:
        """The newest recordings of the axes that changed without a service, by the trends."""
        return [row["newest"] for row in self.results.rows(TRENDS) if row["changed"]]

    def diagnose(self, files: Collection[str]) -> list[Row]:
        """Diagnose recordings in full, those that have no diagnosis yet; returns a row for each."""
        conditions = {row["file"]: row for row in self.results.rows(CONDITION) if row["status"] == GOOD}
        constants = {row["axis"]: row for row in self.results.rows(CONSTANTS)}
        known = {row["file"]: row for row in self.results.rows(DIAGNOSES)}
        items = []
        for file in sorted({*files, *known}):
            if (row := conditions.get(file)) is None:
                continue
            given = json.dumps({"bench": constants[row["axis"]]["bench"]})
            items.append(WorkItem(_id(DIAGNOSES, row["id"]), row["axis"], file, given))
        stage = StageOfWork(DIAGNOSES, _DIAGNOSES, partial(diagnose_one, self.recordings, self.results), alone=True)
        return self._run(stage, items)

    def trend(self) -> list[Row]:
        """Find the trend of each axis by what is compared, and write all pages; returns a row for each axis."""
        index, conditions = self.results.rows(INDEX), self.results.rows(CONDITION)
        if not conditions:
            raise InputError(f"{self.recordings.url}: nothing is compared yet; call first: hil fleet compare")
        diagnosed = defaultdict[str, list[Row]](list)
        for row in self.results.rows(DIAGNOSES):
            diagnosed[row["axis"]].append(row)
        by_axis = defaultdict[str, list[str]](list)
        for row in (*index, *conditions):
            if row["axis"]:
                by_axis[row["axis"]].append(row["id"])
        stamps = {one.file: _stamp(one) for one in self.recordings.entries() if one.file.endswith(SERVICE)}
        items = []
        for axis, ids in by_axis.items():
            given = json.dumps(diagnosed[axis])
            items.append(
                WorkItem(
                    _id(TRENDS, PAGES, axis, *sorted(ids), stamps.get(f"{axis}/{SERVICE}", ""), given), axis, "", given
                )
            )
        rows = self._run(StageOfWork(TRENDS, _TRENDS, partial(watch_axis, self.recordings, self.results)), items)
        if not missing_of("report"):
            from hil.fleet.fleet_page import fleet_page

            bad = [row for row in (*index, *conditions) if row["status"] != GOOD]
            name = self.recordings.url.rstrip("/").rpartition("/")[2] or "fleet"
            told = [row for row in rows if row["status"] == GOOD]
            self.results.write(PAGE, fleet_page(name, told, bad))
        return rows

    def _run(self, stage: StageOfWork, items: Sequence[WorkItem]) -> list[Row]:
        return self.engine.run(stage, items, self.results.rows(stage.name))


def _axis(file: str) -> str:
    first, rest = file.partition("/")[::2]
    return first if rest else ""


def _stamp(entry: StoredFile) -> str:
    return f"{entry.file}\0{entry.size}\0{entry.stamp}"


def _of(entries: dict[str, StoredFile], one: StoredFile, name: str) -> str:
    """Stamp of a file of the axis of an entry; empty without one."""
    found = entries.get(f"{_axis(one.file)}/{name}")
    return _stamp(found) if found else ""


def _id(*parts: str) -> str:
    return hashlib.sha256("\1".join(parts).encode()).hexdigest()[:20]
