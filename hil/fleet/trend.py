"""Trend of one axis: the history of each quantity, what was serviced, and how soon the axis needs a look.

The need is the largest change of a quantity, as it will be in 30 days, over the change that calls for a look
(`quantities`). The change is against the first level, or against that after the last change that a service explains:
a sensor that was exchanged is no wear. Only what the change points show counts; a quantity without any needs nothing.
"""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.fleet.changes import FEWEST, ChangePoint, History, history
from hil.fleet.quantities import QUANTITIES, ConditionQuantity
from hil.fleet.store import Row

DAY_S = 86400.0
AHEAD_DAYS = 30.0
COUNTS = 0.1  # of the change that calls for a look: a smaller one is measured, and told on the page of the axis alone


@dataclass(frozen=True)
class Service:
    """What was serviced, and the day since 1970."""

    day: float
    what: str


@dataclass(frozen=True, eq=False)
class Course:
    """A quantity of an axis over its recordings: days since 1970 (n,), values and errors (n,), their history.

    `explained` are the changes that a service explains, by their index. `reason` says why there is no history.
    """

    quantity: ConditionQuantity
    day: FloatArray
    values: FloatArray
    errors: FloatArray
    history: History | None = None
    explained: dict[int, Service] | None = None
    reason: str = ""

    @property
    def open_changes(self) -> list[ChangePoint]:
        """Changes after the last one that a service explains."""
        return list(self.history.changes[self._serviced :]) if self.history else []

    @property
    def _serviced(self) -> int:
        """Stretches until the last change that a service explains."""
        return max(self.explained or {}, default=-1) + 1

    @property
    def slopes(self) -> bool:
        """True if it changes all the time now."""
        return self.history is not None and self.history.now.slope != 0.0

    @property
    def reference(self) -> float:
        """Level against which wear counts."""
        assert self.history is not None
        return self.history.stretches[self._serviced].begin

    @property
    def change_ahead(self) -> float:
        """Change against the reference in `AHEAD_DAYS`."""
        assert self.history is not None
        now = self.history.now
        return now.end + AHEAD_DAYS * now.slope - self.reference

    @property
    def size(self) -> float:
        """Largest difference of levels over the change that calls for a look; 0 without a history."""
        if self.history is None:
            return 0.0
        levels = [level for one in self.history.stretches for level in (one.begin, one.end)]
        return (max(levels) - min(levels)) / self._limit

    @property
    def _limit(self) -> float:
        """Change that calls for a look, in the unit of the quantity."""
        return max(self.quantity.limit * (abs(self.reference) if self.quantity.relative else 1.0), 1e-300)

    @property
    def need(self) -> float:
        """Change in `AHEAD_DAYS` over the one that calls for a look; 0 without changes, or for the better."""
        if self.history is None:
            return 0.0
        if self._serviced == len(self.history.stretches) - 1 and not self.history.now.slope:
            return 0.0
        change = self.change_ahead
        worse = abs(change) if self.quantity.worse == 0 else self.quantity.worse * change
        return max(worse, 0.0) / self._limit


@dataclass(frozen=True, eq=False)
class AxisTrend:
    """All courses of an axis, its services, and how many of its recordings are good and bad."""

    axis: str
    linear: bool
    courses: tuple[Course, ...]
    services: tuple[Service, ...]
    good: int
    bad: Sequence[Row] = ()
    newest: str = ""  # its newest good recording

    @property
    def leading(self) -> Course | None:
        """The course that needs a look first; None where none does."""
        best = max(self.courses, key=lambda one: one.need, default=None)
        return best if best is not None and best.need > 0.0 else None

    @property
    def shown(self) -> Course | None:
        """The course that tells most of the axis: the leading one, else the one that changed most."""
        return self.leading or max(
            (one for one in self.courses if one.values.size), key=lambda one: one.size, default=None
        )

    @property
    def changed(self) -> list[Course]:
        """Courses with a change that no service explains and that counts, those that changed most first."""
        found = [one for one in self.courses if one.size >= COUNTS and (one.open_changes or one.slopes)]
        return sorted(found, key=lambda one: -one.size)

    @property
    def need(self) -> float:
        """How much the axis needs a look: 1 is a change that calls for one within 30 days."""
        return self.leading.need if self.leading else 0.0


def trend(axis: str, rows: Sequence[Row], services: Sequence[Service], linear: bool) -> AxisTrend:
    """Find the history of each quantity by the rows of the conditions of an axis."""
    good = sorted((row for row in rows if row["status"] == "good"), key=lambda row: row["moment"])
    day = np.array([row["moment"] / DAY_S for row in good])
    watched = [one for one in QUANTITIES if sum(row[one.name] is not None for row in good) >= FEWEST]
    courses = []
    for quantity in QUANTITIES:
        told = np.array([row[quantity.name] is not None for row in good], dtype=bool)
        values, errors = (
            np.array([row[f"{quantity.name}{part}"] for row, one in zip(good, told, strict=True) if one], dtype=float)
            for part in ("", "_error")
        )
        of = day[told] if told.size else day
        reason = next((row[f"{quantity.name}_reason"] for row in good[::-1] if row[quantity.name] is None), "")
        if quantity not in watched:
            few = f"{values.size} recordings tell it, allowed {FEWEST} or more"
            courses.append(Course(quantity, of, values, errors, reason=few if values.size else reason or few))
            continue
        found = history(of, values, errors, len(watched))
        assert found is not None  # there are enough
        courses.append(Course(quantity, of, values, errors, found, _explained(of, found, services)))
    bad = [row for row in rows if row["status"] != "good"]
    return AxisTrend(axis, linear, tuple(courses), tuple(services), len(good), bad, good[-1]["file"] if good else "")


def read_services(text: str, name: str) -> list[Service]:
    """Services of a service.csv: a row `date,what` for each. Raises InputError with the line of a date that is none."""
    found = []
    for line, row in enumerate(csv.reader(io.StringIO(text)), 1):
        if not row or (line == 1 and row[0].strip().lower() == "date"):
            continue
        try:
            moment = datetime.fromisoformat(row[0].strip())
        except ValueError:
            raise InputError(
                f"{name}:{line}: given {row[0]!r}, allowed a date as 2025-03-01; rows are date,what"
            ) from None
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        found.append(Service(moment.timestamp() / DAY_S, ",".join(row[1:]).strip()))
    return sorted(found, key=lambda one: one.day)


def date_of(day: float) -> str:
    """Date of a day since 1970."""
    return f"{datetime.fromtimestamp(day * DAY_S, UTC):%Y-%m-%d}"


def as_json(found: AxisTrend) -> str:
    """The changes of an axis as JSON: for other programs, and for scores."""
    courses = [
        {
            "quantity": one.quantity.name,
            "unit": one.quantity.unit_of(found.linear),
            "recordings": int(one.values.size),
            "reason": one.reason,
            "need": one.need,
            **_of_history(one),
        }
        for one in found.courses
    ]
    data = {
        "axis": found.axis,
        "need": found.need,
        "leading": found.leading.quantity.name if found.leading else "",
        "good": found.good,
        "bad": [{"file": row["file"], "reason": row["reason"]} for row in found.bad],
        "services": [{"date": date_of(one.day), "what": one.what} for one in found.services],
        "quantities": courses,
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)


def _of_history(course: Course) -> dict[str, object]:
    if course.history is None:
        return {}
    changes = [
        asdict(one)
        | {
            "kind": one.kind,
            "date": date_of(one.day),
            "earliest": date_of(one.earliest),
            "latest": date_of(one.latest),
            "service": course.explained[at].what if course.explained and at in course.explained else "",
        }
        for at, one in enumerate(course.history.changes)
    ]
    now = course.history.now
    return {
        "reference": course.reference,
        "level": now.end,
        "level_error": now.level_error,
        "slope_per_day": now.slope,
        "slope_error": now.slope_error,
        "scatter": course.history.scatter,
        "changes": changes,
    }


def _explained(day: FloatArray, found: History, services: Sequence[Service]) -> dict[int, Service]:
    """Steps within whose interval, or a recording about it, something was serviced."""
    near = float(np.median(np.diff(day)))
    explained = {}
    for at, change in enumerate(found.changes):
        inside = [one for one in services if change.earliest - near <= one.day <= change.latest + near]
        if inside and change.kind == "step":
            explained[at] = min(inside, key=lambda one: abs(one.day - change.day))
    return explained
