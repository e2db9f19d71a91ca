"""Check that the control law of a bench reproduces the torque commands of recordings, before the plant is judged.

Each block is judged on measured inputs, so a wrong law says nothing about the machine. The law is

    kept       where it replays the commands to their noise, or with a mechanism of the library that acts on its inputs
    learnt     where other gains do
    set aside  where it cannot be replayed (no set-points, another sampling period), or no gains reproduce the commands

If the recorded positions are coarser than those that the loop saw, the noise of the replay counts as noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.control_section import without_law
from hil.diagnosis.result import Correction, Verdict
from hil.diagnosis.search.initial_values import axis_facts
from hil.identification.control_law import LawFit, counting_noise, fit_law
from hil.identification.measured import Measured
from hil.identification.noise_floor import FLOOR
from hil.identification.terms import Term
from hil.quantities import digits, unit_of
from hil.recording.recording import RESAMPLED, Recording
from hil.twin.library import LIBRARY
from hil.twin.mechanism import Stage

# Share of the torque command (rms) up to which a law that is not at the noise floor is that of the recording: gains
# and structure leave tens of per cent if they are wrong, mechanisms on the controller's inputs a few.
REPLAYED = 0.05
_COARSE = (
    "The control law reproduces the commands to the noise that the steps of the recorded positions make in a replay. "
    "It was not tested further, because the control loop may have seen finer positions."
)
_SAME_PERIOD = 0.01  # relative: stamps are printed with few digits
_SURE = 3.0  # standard errors from which a gain differs from that of the bench
_MATERIAL = 1e-3  # relative change of a gain that is worth a correction: settings have three digits


@dataclass(frozen=True)
class LawCheck:
    """Bench whose control law may be used, corrections of its gains, and notes.

    `coarse`: the law is right to the noise that the recorded positions make in a replay, and cannot be tested further.
    `advice` is what the
    owner should check, empty if nothing; `mismatch`: the law was set aside because no gains reproduce the commands.
    """

    bench: Bench
    corrections: dict[str, Correction] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    coarse: bool = False
    advice: str = ""
    mismatch: bool = False
    resampled: bool = False  # the rows are not the ticks of the velocity loop

    def marked(self, recording: Recording) -> Recording:
        """The recording, marked if its rows are not the ticks of the velocity loop."""
        if not self.resampled:
            return recording
        return replace(recording, metadata={**recording.metadata, RESAMPLED: True})

    def verdict(self, of_plant: Verdict) -> Verdict:
        """Verdict on plant and control law, from that on the plant."""
        if self.mismatch and of_plant in (Verdict.NO_MISMATCH, Verdict.PARAMETER_ERROR):
            return Verdict.UNEXPLAINED
        if self.corrections and of_plant is Verdict.NO_MISMATCH:
            return Verdict.PARAMETER_ERROR
        return of_plant

    def judged(self, runs: Sequence[Measured]) -> list[Measured]:
        """The runs, without the command of the controller if they are too coarse to test it."""
        if not self.coarse:
            return list(runs)
        return [replace(run, unseen=run.unseen | {"command"}) for run in runs]


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
            return _set_aside(bench, f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not recorded")
        if abs(recording.period_s - period_s) > _SAME_PERIOD * period_s:
            found = _set_aside(
                bench,
                f"the rows are {1e3 * recording.period_s:.4g} ms apart, the ticks of the velocity loop "
                f"{1e3 * period_s:.4g} ms",
            )
            return replace(found, resampled=True)
        if recording.metadata.get(RESAMPLED):
            return _set_aside(bench, "the rows were interpolated, so that the ticks of the controller are lost")
    return LawCheck(bench)


def check_law(runs: Sequence[Measured], bench: Bench) -> LawCheck:
    """Check the control law of a bench on prepared recordings."""
    if not bench.law_known:
        return LawCheck(bench)
    given = fit_law(runs, bench, free=False)
    if given.ratio <= FLOOR:
        return LawCheck(bench)
    tried: list[LawFit] = []
    for terms, free in _candidates(runs, bench):
        tried.append(fit_law(runs, bench, terms, free=free))
        if tried[-1].ratio <= FLOOR:
            return _accepted(bench, tried[-1])
    tried.insert(0, given)
    for found in tried:
        noise = tuple(counting_noise(run, found.gains) for run in runs)
        relative = [np.hypot(1.0, more / run.noise.torque) ** 2 for more, run in zip(noise, runs, strict=True)]
        parts = zip(found.parts, relative, strict=True)
        if max(float(part @ part) / part.size / allowed for part, allowed in parts) <= FLOOR:
            law = _accepted(bench, found)
            return replace(law, coarse=True, notes=(*law.notes, _COARSE))
    rows = min(one.independent_rows for one in tried)
    best = min(tried, key=lambda one: one.bic(rows))
    if best.left <= REPLAYED:
        return _accepted(bench, best)
    why = (
        f"it leaves {100.0 * given.left:.0f} % of the torque command (rms), with the best gains "
        f"({_gains(bench, best)}) {100.0 * best.left:.0f} %"
    )
    advice = f"Check the controller's settings: the control law of the bench is not that of the recording, {why}."
    return replace(_set_aside(bench, why), advice=advice, mismatch=True)


def _candidates(runs: Sequence[Measured], bench: Bench) -> list[tuple[tuple[Term, ...], bool]]:
    """Mechanisms on the inputs of the controller and free gains, in the order of the number of parameters."""
    facts = axis_facts(bench, runs)
    table = bench.gains.position_from_table
    single = [
        Term(mechanism.id, index, mechanism.typical_values(facts))
        for mechanism in LIBRARY
        for index, variant in enumerate(mechanism.variants)
        if variant.stage in (Stage.VELOCITY_FILTER, Stage.CHANNEL)
        and variant.name != "torque"
        and (table or not variant.needs_table)
        and mechanism.id not in {entry.effect for entry in bench.mechanisms}
    ]
    sets = [(), *((one,) for one in single), *combinations(single, 2)]
    # two variants of one mechanism shift the same channels
    sets = [terms for terms in sets if len({term.effect for term in terms}) == len(terms)]
    fixed = [(terms, False) for terms in sets if terms]
    return [*fixed, *((terms, True) for terms in sets)]


def _accepted(bench: Bench, found: LawFit) -> LawCheck:
    """The bench with the gains found, if they differ from its own."""
    control = bench.known_control
    learnt = control.with_gains(found.gains)
    corrections = {}
    for name, error in zip(control.gain_names, found.errors, strict=True):
        nominal, value = getattr(control, name), getattr(learnt, name)
        if nominal is None:
            continue
        std = error * (1.0 if name == "velocity_feedforward" else abs(value))
        if abs(value - nominal) > max(_SURE * std, _MATERIAL * max(abs(nominal), _MATERIAL)):
            corrections[name] = Correction(nominal=nominal, value=value, std=std, unit=unit_of(name))
    if not corrections:
        return LawCheck(bench)
    text = ", ".join(
        f"{name} {digits(entry.value, 4)} instead of {digits(entry.nominal, 4)}" for name, entry in corrections.items()
    )
    advice = f"Check the controller's settings: the torque commands follow the control law with {text}."
    return LawCheck(
        bench.model_copy(update={"control": learnt}),
        corrections,
        (f"{advice} The twin uses these gains.",),
        advice=advice,
    )


def _set_aside(bench: Bench, why: str) -> LawCheck:
    bench = bench.model_copy(update={"control": without_law(bench.known_control)})
    return LawCheck(bench, notes=(f"The control law of the bench was not used: {why}.",))


def _gains(bench: Bench, found: LawFit) -> str:
    control = bench.known_control.with_gains(found.gains)
    return ", ".join(
        f"{name} {digits(getattr(control, name), 4)}" for name in control.gain_names if getattr(control, name)
    )
