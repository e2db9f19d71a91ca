"""The trend of an axis in words: values, changes, and why it needs a look."""

from hil.fleet.changes import FEWEST, ChangePoint
from hil.fleet.quantities import ConditionQuantity
from hil.fleet.trend import AHEAD_DAYS, COUNTS, AxisTrend, Course, date_of
from hil.quantities import digits, known_quantity, reading_unit

MONTH_DAYS = 30.0
NEED = (
    f"Need: largest change of a quantity as it will be in {AHEAD_DAYS:g} days, over the change that calls for a look."
)


def value_of(course: Course, linear: bool) -> str:
    """The level now with its unit; the mean without a history, a dash without a value."""
    unit = course.quantity.unit_of(linear)
    if course.history is not None:
        now = course.history.now
        return known_quantity(now.end, 0.1 * max(now.level_error, 0.01 * abs(now.end)), unit)
    if course.values.size:
        return known_quantity(float(course.values.mean()), 0.01 * abs(float(course.values.mean())), unit)
    return "–"


def amount(change: float, course: Course, linear: bool, against: float | None = None) -> str:
    """A change with its sign: in percent of the reference, or of the level `against`, or in its unit."""
    quantity = course.quantity
    against = course.reference if against is None else against
    if quantity.relative and against:
        return f"{100.0 * change / abs(against):+.1f} %"
    factor, unit = reading_unit(quantity.unit_of(linear), change)
    return f"{'+' if change >= 0 else '−'}{digits(abs(change) * factor)} {unit}"


def change_told(change: ChangePoint, course: Course, linear: bool) -> str:
    """A change point: what, how much, when."""
    when = f"between {date_of(change.earliest)} and {date_of(change.latest)}"
    if change.kind == "step":
        told = f"step of {amount(change.step, course, linear, change.before)} {when}"
    else:
        told = f"{rate(change.slope, course, linear)} more than before, from {when}"
    at = course.history.changes.index(change) if course.history else -1
    service = (course.explained or {}).get(at)
    return f"{told} ({service.what})" if service else told


def rate(slope: float, course: Course, linear: bool) -> str:
    """A slope a day as a change a month."""
    return f"{amount(MONTH_DAYS * slope, course, linear)} a month"


def told_changes(course: Course, linear: bool) -> str:
    """All changes of a quantity, and its slope now."""
    found = course.history
    if found is None:
        return course.reason
    told = [change_told(one, course, linear) for one in found.changes]
    if found.changes and (slope := found.stretches[0].slope):
        told.insert(0, f"first {rate(slope, course, linear)}")
    if found.now.slope and not (found.changes and found.changes[-1].kind == "slope" and len(found.changes) == 1):
        told.append(f"{rate(found.now.slope, course, linear)} now")
    return "; ".join(told) or "steady"


def why(trend: AxisTrend) -> str:
    """Why an axis needs a look, in one sentence; "steady" if it does not."""
    course = trend.leading
    opened = trend.changed
    if not any(one.history for one in trend.courses):
        return f"too few recordings to tell changes: {trend.good}, allowed {FEWEST} or more"
    serviced = [(one, at) for one in sorted(trend.courses, key=lambda one: one.size) for at in one.explained or {}]
    if (course is None or course.history is None) and not opened and serviced:
        one, at = serviced[-1]
        service = (one.explained or {})[at]
        change = one.history.changes[at] if one.history else None
        told = f"{one.quantity.label} {amount(change.step, one, trend.linear, change.before) if change else ''}"
        return f"steady since it was serviced: {service.what}, {date_of(service.day)} ({told})"
    if course is None or course.history is None or course.need < COUNTS:
        better = ", ".join(one.quantity.label for one in opened[:3])
        return f"changes for the better only: {better}" if better else "steady"
    now, linear = course.history.now, trend.linear
    told = f"{course.quantity.label}: {amount(now.end - course.reference, course, linear)} against "
    told += "its level after the last service" if course.explained else "its first level"
    if now.slope:
        told += f", {rate(now.slope, course, linear)}"
    last = course.open_changes[-1:]
    if last:
        begun = "stepped" if last[0].kind == "step" else "began"
        told += f"; {begun} between {date_of(last[0].earliest)} and {date_of(last[0].latest)}"
    others = [one.quantity.label for one in opened if one is not course]
    if others:
        more = f" and {len(others) - 2} more" if len(others) > 2 else ""
        told += f". Also: {', '.join(others[:2])}{more}"
    return told


def need_told(need: float) -> str:
    """How much a quantity or an axis needs a look; a dash if not at all."""
    return digits(need, 2) if need else "–"


def limit_of(quantity: ConditionQuantity, linear: bool) -> str:
    """The change that calls for a look."""
    if quantity.relative:
        return f"{100.0 * quantity.limit:g} %"
    return known_quantity(quantity.limit, 0.1 * quantity.limit, quantity.unit_of(linear))


def by_test(trend: AxisTrend) -> dict[str, str]:
    """Level and change under the names of the vendors' tests, by the first quantity of each test that is told."""
    found: dict[str, str] = {}
    for course in trend.courses:
        if not course.quantity.test or course.quantity.test in found or not course.values.size:
            continue
        level = value_of(course, trend.linear)
        if course.history is None:
            found[course.quantity.test] = level
            continue
        changed = course.history.changes or course.history.now.slope
        change = amount(course.history.now.end - course.reference, course, trend.linear)
        found[course.quantity.test] = f"{level} ({change})" if changed else level
    return found
