"""Decide whether the control law of a bench can be replayed on recordings; `LawCheck` holds the result.

The law is set aside, and the plant judged alone, if recordings lack what a replay needs or if the motor rests away from
its set-points.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.control_section import without_law
from hil.diagnosis.preparation.added_command import added_in_words, added_windows, windows_told, without_added
from hil.diagnosis.result import EventWindow, Verdict
from hil.diagnosis.search.event_detection import Event
from hil.diagnosis.value import Correction
from hil.identification.law.replay import Settings
from hil.identification.measured import Measured
from hil.recording.recording import RESAMPLED, Recording

_AWAY, _AWAY_M = 0.01, 1e-3  # largest offset at rest, of the travel and absolute: a closed loop rests far below both
_SAME_PERIOD = 0.01  # relative: stamps are printed with few digits


@dataclass(frozen=True)
class LawCheck:
    """Bench whose control law may be used, corrections of its gains, and notes.

    `coarse`: the law is right to the noise that the recorded positions make in a replay, and cannot be tested further.
    `advice` is what the owner should check, empty if nothing; `mismatch`: the law was set aside because no gains
    reproduce the commands. `added_to`: the bench behind whose law a command is added in windows.
    """

    bench: Bench
    corrections: dict[str, Correction] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    coarse: bool = False
    advice: str = ""
    mismatch: bool = False
    resampled: bool = False  # the rows are not the ticks of the velocity loop
    added_to: Bench | None = None
    added: tuple[Event, ...] = ()  # in all recordings
    windows: tuple[EventWindow, ...] = ()  # the same as they are told

    def marked(self, recording: Recording) -> Recording:
        """The recording, marked if its rows are not the ticks of the velocity loop."""
        if not self.resampled:
            return recording
        return replace(recording, metadata={**recording.metadata, RESAMPLED: True})

    @property
    def channels(self) -> frozenset[str]:
        """Channels of the twin for which the law answers, and no term of the plant: its gains are told to be others."""
        return frozenset({"command"} if self.corrections else ())

    def verdict(self, of_plant: Verdict) -> Verdict:
        """Verdict on plant and control law, from that on the plant."""
        if self.mismatch and of_plant in (Verdict.NO_MISMATCH, Verdict.PARAMETER_ERROR):
            return Verdict.UNEXPLAINED
        if self.windows and of_plant in (Verdict.NO_MISMATCH, Verdict.PARAMETER_ERROR):
            return Verdict.MISSING_PHYSICS
        if self.corrections and of_plant is Verdict.NO_MISMATCH:
            return Verdict.PARAMETER_ERROR
        return of_plant

    def beside(self, runs: Sequence[Measured]) -> "LawCheck":
        """The law with the windows of an added command in all `runs`, in training and held-out ones, and in words."""
        if self.added_to is None:
            return self
        added = added_windows(runs, self.added_to, Settings(self.added_to.gains))
        windows = windows_told(added, runs, self.added_to.axis.drive_unit)
        told = added_in_words(windows)
        felt = "The axis does not move by it: it was taken off the recorded command and torque."
        if not self.bench.law_known:
            felt = "The axis moves by it."
        advice = " ".join(filter(None, (told, felt, self.advice)))
        return replace(self, added=added, windows=windows, advice=advice, notes=(f"{told} {felt}", *self.notes))

    def without_command(self, runs: Sequence[Measured]) -> list[Measured]:
        """The runs less an added command, and without that of the controller if they are too coarse to test it."""
        runs = [without_added(run, self.added) for run in runs] if self.bench.law_known else runs
        if not self.coarse:
            return list(runs)
        return [replace(run, observability=replace(run.observability, law_testable=False)) for run in runs]


def replayable(bench: Bench, recordings: Sequence[Recording]) -> LawCheck:
    """Set the control law of a bench aside if recordings lack what a replay needs."""
    if not bench.law_known:
        return LawCheck(bench)
    for recording in recordings:
        names, period_s = recording.axis, bench.period_s
        missing = [name for name in (names.position_command, names.velocity_command) if name not in recording.columns]
        if not {names.torque_command, names.torque} & set(recording.columns):
            missing.append(names.torque_command)
        if not {names.motor_position} <= set(recording.columns):
            missing.append(names.motor_position)
        if missing:
            return set_aside(bench, f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not recorded")
        if abs(recording.period_s - period_s) > _SAME_PERIOD * period_s:
            found = set_aside(
                bench,
                f"the rows are {1e3 * recording.period_s:.4g} ms apart, the ticks of the velocity loop "
                f"{1e3 * period_s:.4g} ms",
            )
            return replace(found, resampled=True)
        if recording.metadata.get(RESAMPLED):
            return set_aside(bench, "the rows were interpolated, so that the ticks of the controller are lost")
    return LawCheck(bench)


def at_set_points(runs: Sequence[Measured], bench: Bench) -> LawCheck:
    """Set the control law of a bench aside if a motor rests away from its set-points.

    Either the zeros of the recording differ, or the loop yields to a load: a twin from the set-points is elsewhere.
    """
    for run in runs if bench.law_known else ():
        travel, resting = float(np.ptp(run.position_command_m)), ~run.moving
        behind = (run.position_command_m - bench.axis.ratio_m_rad * run.motor)[resting]
        away = float(np.median(behind)) if behind.size else 0.0
        if travel and abs(away) > max(_AWAY * travel, _AWAY_M):
            where = "behind" if away > 0.0 else "beyond"
            law = set_aside(
                bench,
                f"in {run.name} the motor rests {100.0 * abs(away) / travel:.3g} % of the travel {where} its "
                "set-points: the loop yields to a load, or the zeros differ; an offset in the map corrects a zero",
            )
            return replace(law, advice=law.notes[0])
    return LawCheck(bench)


def set_aside(bench: Bench, why: str) -> LawCheck:
    """The bench without its control law, with a note on the reason."""
    bench = bench.model_copy(update={"control": without_law(bench.known_control)})
    return LawCheck(bench, notes=(f"The control law of the bench was not used: {why}.",))
