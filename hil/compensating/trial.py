"""Try a compensation on the bench: errors of motions before, as predicted, and after; what does not help is left out.

Each motion is run twice without any compensation: the difference of the two is what a repetition changes. An entry is
kept if the error that it is for is larger without it by more than that. So a wrong or an old table costs runs, and no
accuracy.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.compensating.compensate import (
    DRAWS,
    Plan,
    plan_compensation,
    section_of,
    taken_by_drive,
    with_tables,
)
from hil.compensating.loop_tuning import LoopMargins, margins_of
from hil.compensating.prediction import Errors, Gain, drawn_benches, gain_of
from hil.control.compensation_tables import Adds, CompensationTable
from hil.diagnosis.result import Result
from hil.errors import HilError
from hil.motion.profile import Profile
from hil.motion.trajectory import SegmentRun, plan
from hil.quantities import quantity
from hil.recording.recording import Recording, read_recording

if TYPE_CHECKING:
    from hil.loop.run import RunResult

RunBench = Callable[[Bench, Profile, Path, str], "RunResult"]  # bench, profile, folder, name of the recording
_KINDS = {Adds.TORQUE: "following", Adds.POSITION: "positioning"}


@dataclass(frozen=True, eq=False)
class TriedMotion:
    """One motion: errors [m] before (twice), by prediction, and after; `recordings`: before and after."""

    name: str
    before: tuple[Errors, Errors]
    predicted: Gain
    after: Errors
    recordings: tuple[Recording, Recording]

    def noise_m(self, adds: Adds) -> float:
        """Difference of an error between the two runs without compensation [m]."""
        return _repetition_m(self.before, adds)


@dataclass(frozen=True, eq=False)
class Trial:
    """Result of a trial: the plan with the tables that are kept, and the section `compensation` that holds them.

    `section` is None where none is kept. `left_out`: name of a table or effect and why. `fade_in_s`: rows before are in
    no error. `unit`: of positions.
    """

    section: dict[str, Any] | None
    plan: Plan
    motions: tuple[TriedMotion, ...]
    left_out: tuple[tuple[str, str], ...]
    fade_in_s: float
    unit: str = "m"
    margins: LoopMargins | None = None  # of the diagnosed axis, the same with and without tables

    @property
    def statement(self) -> str:
        """The result as one sentence."""
        if self.plan.harms:
            return f"Nothing was run: by the twin {'; '.join(self.plan.harms)}."
        if self.section is None:
            return (
                "Nothing is kept: no table could be tried and improved its error by more than a repetition changes it."
            )
        parts = []
        for adds in dict.fromkeys(table.adds for table in self.plan.compensation.tables):
            before, after = (rms([pair[index] for pair in self.pairs(adds)]) for index in (0, 1))
            told = (quantity(one, self.unit) for one in (before, after, *(before * one for one in self.interval(adds))))
            parts.append("the {} error from {} to {} rms (predicted {} to {})".format(_KINDS[adds], *told))
        return f"On motions that it was not learnt from, the compensation takes {' and '.join(parts)}."

    def pairs(self, adds: Adds) -> list[tuple[float, float]]:
        """Error of each motion before, mean of both runs, and after."""
        return [(rms([one.of(adds) for one in motion.before]), motion.after.of(adds)) for motion in self.motions]

    def interval(self, adds: Adds) -> tuple[float, float]:
        """Smallest and largest predicted share of an error that is left, over motions and draws."""
        shares = [motion.predicted.interval(adds) for motion in self.motions]
        return min(low for low, _ in shares), max(high for _, high in shares)


def _repetition_m(before: tuple[Errors, Errors], adds: Adds) -> float:
    return abs(before[0].of(adds) - before[1].of(adds))


def rms(values: Sequence[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def error_series(recording: Recording, bench: Bench, fade_in_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time [s], following error and positioning error without its mean [m], (n,) each, after approach and fade-in.

    As `prediction.in_closed_loop` has those of the twin; without a linear encoder the table is where the motor is.
    """
    segments = [SegmentRun(**one) for one in recording.metadata.get("segments", ())]
    approached_s = sum(one.end_s for one in segments if one.kind == "approach")
    ratio, first = bench.axis.ratio_m_rad, round((approached_s + fade_in_s) / bench.period_s)
    command, motor = recording["position_command_m"], ratio * recording[recording.axis.motor_position]
    table = recording.columns.get("table_position_m", motor)
    added = recording.columns.get("compensation_position_m", np.zeros(len(recording)))
    fed_back = table if bench.gains.position_from_table else motor - motor[0] + command[0]
    following, place = (command + added - fed_back)[first:], (table - command)[first:]
    return recording["time_s"][first:], following, place - place.mean()


def measured_errors(recording: Recording, bench: Bench, fade_in_s: float) -> Errors:
    """Root mean squares of the error series of a recording."""
    _, following, place = error_series(recording, bench, fade_in_s)
    return Errors(float(np.sqrt(np.mean(following**2))), float(np.std(place)))


def try_compensation(
    given: Bench,
    diagnosed: Bench,
    result: Result,
    profiles: Mapping[str, Profile],
    folder: Path,
    run: RunBench,
    fade_in_s: float = 1.0,
) -> Trial:
    """Derive the compensation of a diagnosed bench, try it on the `given` one, and keep the tables that help.

    `profiles` by name are motions that the diagnosis was not learnt from. Raises HilError if a run stops early or
    nothing can be compensated.
    """
    bench = diagnosed.model_copy(update={"compensation": None})
    motions = {name: plan(profile, bench.period_s) for name, profile in profiles.items()}
    for name, motion in motions.items():
        if motion.duration_s <= 2.0 * fade_in_s:
            raise HilError(
                f"{name}: given {motion.duration_s:.3g} s of motion, allowed more than {2.0 * fade_in_s:g} s"
            )
    widest = max(motions.values(), key=lambda one: float(np.abs(one.velocity_m_s).max()))
    made = plan_compensation(bench, widest, result, fade_in_s)
    unit = "rad" if bench.axis.turns else "m"
    made, untried = _that_can_be_judged(given, made)
    if given.tables().tables:
        untried.append(("compensation of the bench", "off in all these runs; what is kept takes its place"))
    if made.harms or not made.compensation.tables:
        return Trial(None, made, (), (*made.derived.left_out, *untried), fade_in_s, unit)

    def errors(tried: Bench, label: str) -> dict[str, tuple[Errors, Recording]]:
        found = {}
        for name, profile in profiles.items():
            ran = run(tried, profile, folder, f"{name}_{label}")
            if not ran.complete or ran.recording is None:
                raise HilError(f"{name}_{label} stopped: {ran.outcome.ending}: {ran.outcome.reason}")
            recording = read_recording(ran.recording)
            found[name] = measured_errors(recording, tried, fade_in_s), recording
        return found

    plain = given.model_copy(update={"compensation": None})
    before = errors(plain, "before"), errors(plain, "before_again")
    tables, dropped = list(made.compensation.tables), list(untried)
    after = errors(_with(plain, made, tables), "after")
    for table in made.compensation.tables:
        rest = [one for one in tables if one is not table]
        without = errors(_with(plain, made, rest), f"without_{table.name.replace(' ', '_')}") if rest else before[0]
        worse = rms([one.of(table.adds) for one, _ in without.values()])
        noise = max(_repetition_m((before[0][name][0], before[1][name][0]), table.adds) for name in profiles)
        own = rms([one.of(table.adds) for one, _ in after.values()])
        if not worse - own > noise:
            tables, after = rest, without
            kind = _KINDS[table.adds]
            dropped.append((table.name, f"{kind} error {quantity(own, unit)} with it, {quantity(worse, unit)} without"))
    kept = with_tables(made, tables)
    drawn = tuple(drawn_benches(bench, result, DRAWS))
    tried = [
        TriedMotion(
            name,
            (before[0][name][0], before[1][name][0]),
            gain_of(bench, motions[name], kept.compensation, drawn, fade_in_s),
            after[name][0],
            (before[0][name][1], after[name][1]),
        )
        for name in profiles
    ]
    section = _section(plain, kept) if tables else None
    margins = margins_of(bench, drawn, bench.gains)
    return Trial(section, kept, tuple(tried), (*made.derived.left_out, *dropped), fade_in_s, unit, margins)


def _that_can_be_judged(given: Bench, made: Plan) -> tuple[Plan, list[tuple[str, str]]]:
    """The plan with the tables that the drive takes and a run can judge, and why not the others."""
    taken, untried = taken_by_drive(given, made)
    if given.encoders.table is None:
        reason = "without a linear encoder no run tells where the table is"
        tables = taken.compensation.tables
        untried += [(table.name, reason) for table in tables if table.adds is Adds.POSITION]
        taken = with_tables(taken, [table for table in tables if table.adds is not Adds.POSITION])
    return taken, untried


def _with(bench: Bench, made: Plan, tables: Sequence[CompensationTable]) -> Bench:
    """The bench with some of the tables of a plan."""
    if not tables:
        return bench
    section = _section(bench, with_tables(made, tables))
    return Bench.model_validate(bench.model_dump(mode="json") | {"compensation": section})


def _section(bench: Bench, made: Plan) -> dict[str, Any]:
    return section_of(made, Path(bench.name), date.today().isoformat())
