"""A compensation of a diagnosed bench: its tables, the gain that each promises, and the section of the bench file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode
from hil.compensating.derive import Derived, derive, limits_of, reach_of, size
from hil.compensating.law_lag import with_lag_of_law
from hil.compensating.prediction import Errors, Gain, drawn_benches, gain_of, predict
from hil.compensating.shapes import PULSE, shapes
from hil.control.compensation_tables import Adds, Compensation, CompensationLimits, CompensationTable
from hil.diagnosis.result import Result
from hil.errors import HilError
from hil.motion.trajectory import Trajectory

PULSE_IS_SMALL = "its pulse after a reversal changes the errors of this motion by nothing that counts"
DRAWS = 12  # of the parameters: the largest of 12 is passed by one draw in 13


@dataclass(frozen=True, eq=False)
class Plan:
    """A compensation with its gain on a motion; `alone`: errors with each table alone; `errors`: standard errors."""

    derived: Derived
    gain: Gain
    alone: dict[str, Errors]
    errors: dict[str, float]

    @property
    def compensation(self) -> Compensation:
        """The tables."""
        return self.derived.compensation

    @property
    def harms(self) -> list[str]:
        """What the compensation may make worse, in words; empty: nothing."""
        names = {Adds.TORQUE: "following error", Adds.POSITION: "positioning error"}
        told = []
        for adds in dict.fromkeys(table.adds for table in self.compensation.tables):
            low, high = self.gain.interval(adds)
            if high >= 1.0:
                told.append(f"the {names[adds]} becomes {low:.2f} to {high:.2f} of what it is")
        return told


def plan_compensation(bench: Bench, motion: Trajectory, result: Result | None, fade_in_s: float) -> Plan:
    """Derive the compensation of a bench and predict its gain; `result`: of the diagnosis, for the standard errors.

    Raises HilError where nothing is to be compensated or the motion is shorter than the fade-in.
    """
    if motion.duration_s <= 2.0 * fade_in_s:
        raise HilError(
            f"given a motion of {motion.duration_s:g} s, allowed more than {2.0 * fade_in_s:g} s: the compensation "
            "takes half of that to fade in; give a longer --profile or a shorter --fade-in"
        )
    bench = bench.model_copy(update={"compensation": None})
    reach = reach_of(bench, motion)
    derived = derive(bench, reach, fade_in_s)
    if not derived.compensation.tables:
        raise HilError("nothing of this bench can be compensated by a table")

    def limits(tables: Sequence[CompensationTable]) -> CompensationLimits:
        return limits_of(tables, reach, bench.gains.torque_limit_n_m, fade_in_s)

    tables = with_lag_of_law(bench, motion, derived.compensation, fade_in_s, limits)
    compensation = replace(derived.compensation, tables=tables, limits=limits(tables))
    derived = replace(
        derived, compensation=compensation, left_out=(*derived.left_out, *_without_pulse(derived, tables))
    )
    drawn = tuple(drawn_benches(bench, result, DRAWS)) if result is not None else ()
    gain = gain_of(bench, motion, compensation, drawn, fade_in_s)
    alone = {
        table.name: predict(bench, motion, replace(compensation, tables=(table,)), fade_in_s)
        for table in compensation.tables
    }
    return Plan(derived, gain, alone, _errors(bench, drawn, derived, motion))


def _without_pulse(derived: Derived, tables: Sequence[CompensationTable]) -> list[tuple[str, str]]:
    """Effects of which no table is left."""
    kept = {effect for table in tables for effect in derived.sources[table.name]}
    lost = {effect for effects in derived.sources.values() for effect in effects} - kept
    return [(effect, PULSE_IS_SMALL) for effect in sorted(lost)]


def with_tables(plan: Plan, tables: Sequence[CompensationTable]) -> Plan:
    """The plan with some of its tables; the gain stays that of all."""
    derived = plan.derived
    return replace(plan, derived=replace(derived, compensation=replace(derived.compensation, tables=tuple(tables))))


def taken_by_drive(bench: Bench, plan: Plan) -> tuple[Plan, list[tuple[str, str]]]:
    """The plan with the tables that the drive of a bench takes from its bench file, and why not the others."""
    in_drive = bench.drive is not None and bench.drive.mode is not DriveMode.CST
    left = [table.name for table in plan.compensation.tables if in_drive and table.adds is Adds.TORQUE]
    rest = [table for table in plan.compensation.tables if table.name not in left]
    return with_tables(plan, rest), [(name, "a torque is added to the command of a drive in cst only") for name in left]


def _errors(bench: Bench, drawn: tuple[Bench, ...], derived: Derived, motion: Trajectory) -> dict[str, float]:
    """Largest standard error of a value of each table, from the draws."""
    if not drawn:
        return {}
    reach, from_table = reach_of(bench, motion), bench.gains.position_from_table
    found = [shapes(one.twin(), reach, from_table) for one in drawn]

    whole = size(shapes(bench.twin(), reach, from_table)[PULSE])

    def error(table: CompensationTable) -> float:
        columns = np.array([(one[table.name].forward, one[table.name].backward) for one in found])
        share = size(table) / whole if table.name == PULSE else 1.0
        return float(share * np.std(columns, axis=0, ddof=1).max())

    return {table.name: error(table) for table in derived.compensation.tables}


def section_of(plan: Plan, source: Path, date: str) -> dict[str, Any]:
    """The section `compensation` of the bench file; `date`: the day on which it is made."""
    limits = plan.compensation.limits

    def entry(table: CompensationTable) -> dict[str, Any]:
        finding = ", ".join(plan.derived.sources[table.name])
        origin = {"recording": str(source.parent.name or source.name), "finding": finding, "date": date}
        backward = {} if np.array_equal(table.forward, table.backward) else {"backward": _rounded(table.backward)}
        error = {"standard_error": plan.errors[table.name]} if plan.errors else {}
        return {
            "name": table.name, "enabled": True, "adds": table.adds.value, "over": table.over.value,
            "at": _rounded(table.at), "forward": _rounded(table.forward), **backward, "origin": origin | error,
        }  # fmt: skip

    return {
        "enabled": True,
        "fade_in_s": limits.fade_in_s,
        "torque_limit": limits.torque,
        "torque_slope": limits.torque_slope,
        "position_limit_m": limits.position_m,
        "speed_limit_m_s": limits.speed_m_s,
        "direction_m_s": limits.direction_m_s,
        "entries": [entry(table) for table in plan.compensation.tables],
    }


def _rounded(values: Any) -> list[float]:
    return [float(f"{value:.7g}") for value in values]
