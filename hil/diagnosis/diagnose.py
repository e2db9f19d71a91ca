"""Diagnose recordings: detect, locate and classify a mismatch, name the missing physics, and validate it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.experiment import Experiment, separating, showing
from hil.diagnosis.location.locate import locate, shown_in
from hil.diagnosis.notes import at_bound, ended, notes_on, on_torque, stopped
from hil.diagnosis.preparation.prepare import prepare_diagnosis
from hil.diagnosis.preparation.untold import untold
from hil.diagnosis.result import AT_FLOOR, Location, Mode, NextExperiment, Result, TimeBudget, Unexplained, Verdict
from hil.diagnosis.search.events import with_events_of
from hil.diagnosis.search.forward_selection import Explanation, explain
from hil.diagnosis.statement import statement
from hil.diagnosis.time_left import with_time_left
from hil.diagnosis.turning import labelled
from hil.diagnosis.verdict.cross_validation import CrossValidation, cross_validate
from hil.diagnosis.verdict.each_alone import Change, changed
from hil.diagnosis.verdict.findings import corrections, diagnosed_bench, findings, form_of, renamed
from hil.diagnosis.verdict.fit_table import channel_residuals, closed_loop_held, fit_table
from hil.diagnosis.verdict.judge import explains_most, judge, not_testable, unexplained_share
from hil.diagnosis.verdict.refit import reported_refit, torque_left
from hil.diagnosis.wording import channel_names, title, titles, where_in_short
from hil.errors import InputError
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.noise_floor import FLOOR
from hil.identification.parallel import one_blas_thread
from hil.quantities import digits
from hil.recording.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Progress = Callable[[str], None]

SEARCH_SHARE = 0.7  # of a time budget for the search; the rest for held-out recordings, location and report
NEXT_EXPERIMENT = "next_experiment.yaml"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Result of a diagnosis, with the fits and data sets that figures are drawn from.

    `final` is the hypothesis of the verdict: `proof.final`, or the nominal twin if there is no finding.
    """

    result: Result
    bench: Bench  # with corrected parameters and the new terms
    owner: Bench
    train: Dataset
    held_out: Dataset  # without runs if nothing was held out
    explanation: Explanation
    proof: CrossValidation
    final: Fit
    experiment: Experiment | None = None  # next motion; None if no question is open
    change: Change | None = None  # of the axis, between or during the recordings

    def plot(
        self, what: Literal["residuals", "location", "finding", "change"] = "residuals", number: int = 1
    ) -> Figure:
        """Draw the residuals before and after, the location of the mismatch, the evidence for finding `number`, or that
        for a change of the axis.

        Residuals are those of the first held-out recording. Raises InputError if there is no such finding or change.
        """
        from hil.diagnosis.pictures import findings, location
        from hil.figures.drawing import over_time

        if what == "change":
            from hil.diagnosis.pictures.change import change_figure

            return labelled(change_figure(self), self.owner.axis.turns)
        if what == "location":
            return labelled(location.location_figure(self), self.owner.axis.turns)
        if what == "finding":
            if not 1 <= number <= len(self.result.findings):
                raise InputError(f"number: given {number}, allowed 1 to {len(self.result.findings)} findings")
            return findings.finding_figure(self, findings.term_of(self, number - 1)).figure
        run = (*self.held_out.runs, *self.train.runs)[0]
        title = f"{run.name}: measured - twin, noise floor in grey"
        return over_time(title, run.time_s, location.residual_panels(self, run))

    def __repr__(self) -> str:
        lines = [f"Diagnosis: {self.result.verdict}", f"  {self.result.statement}"]
        for finding in self.result.findings:
            lines.append(f"  {title(finding.effect)}, confidence {finding.confidence:.2f}")
            lines += [
                f"    {name} = {digits(entry.value)} ± {digits(entry.std)} {entry.unit}"
                for name, entry in finding.parameters.items()
            ]
            if finding.equivalents:
                lines.append(f"    not distinguishable from {titles(finding.equivalents)} by this motion")
        lines += [
            f"  {name} = {digits(entry.value)} ± {digits(entry.std)} {entry.unit} (bench file {digits(entry.nominal)})"
            for name, entry in self.result.parameter_corrections.items()
        ]
        return "\n".join(lines)

    def residuals(self, fit: Fit, run: Measured, mode: Mode = Mode.BLOCKS) -> dict[str, FloatArray]:
        """Residuals (n,) of a fit on one of the recordings, by channel."""
        data = self.train if run in self.train.runs else self.held_out
        return channel_residuals(fit.hypothesis, data, mode)[data.runs.index(run)]


@one_blas_thread
def diagnose(
    train: Sequence[Recording],
    validate: Sequence[Recording],
    bench: Bench,
    progress: Progress = lambda text: None,
    budget_s: float = math.inf,
) -> Diagnosis:
    """Diagnose recordings of one axis against its bench, and validate the result on recordings of another motion.

    Without `validate` a third of each recording is held out. `progress` gets the name of each step and the time
    left. After `budget_s` the search ends with the best explanation so far; the rest takes some seconds more. Raises
    InputError with all reasons if the recordings cannot be diagnosed.
    """
    if not budget_s > 0.0:
        raise InputError(f"budget: given {budget_s:g} s, allowed above 0 s")
    begin = time.monotonic()
    progress = with_time_left(progress, begin, budget_s)
    progress("checking the recordings")
    prepared = prepare_diagnosis(train, validate, bench)
    believed, bench, law = bench, prepared.bench, prepared.law
    data, held_out, notes = prepared.train, prepared.held_out, list(prepared.notes)

    explanation = explain(data, progress, begin + SEARCH_SHARE * budget_s)
    owner, nominal = explanation.owner, explanation.nominal
    progress("testing on held-out recordings")
    proof = cross_validate(nominal, with_events_of(held_out, renamed(explanation.final)), held_out)
    of_plant = judge(owner, nominal, proof.final, held_out)
    refit, change = reported_refit(nominal), None
    if of_plant is Verdict.UNEXPLAINED and not explanation.stopped_at:
        change = changed(refit.fit, held_out)
        if change and proof.final.terms and unexplained_share(nominal, proof.final, held_out) < change.left:
            change = None
    of_plant = Verdict.AXIS_CHANGED if change and change.explains_all else of_plant
    verdict = law.verdict(of_plant)
    named = verdict is Verdict.MISSING_PHYSICS
    # what explains most of a mismatch is told, though it is not the name of all of it
    partly = verdict is Verdict.UNEXPLAINED and not change and explains_most(nominal, proof.final, held_out)
    nominal = refit.fit
    explanation = replace(explanation, nominal=nominal)
    if partly:
        final = proof.final
    else:
        final = {Verdict.MISSING_PHYSICS: proof.final, Verdict.NO_MISMATCH: owner}.get(of_plant, nominal)
    as_given = of_plant is Verdict.NO_MISMATCH or change is not None  # no correction of the bench holds throughout
    # a parameter error is located and measured against the parameters of the bench file
    before = owner if of_plant is Verdict.PARAMETER_ERROR else nominal

    progress("locating")
    seen, goal = shown_in(before, held_out), nominal if partly else final
    location = None if verdict is Verdict.NO_MISMATCH else locate(seen, seen if goal is before else goal)
    if verdict is not of_plant:  # the plant is as the bench describes it, the law is not
        location = Location(block="controller", element="settings of the control law", channels=())
    progress("comparing the fits with the noise floor")
    table = fit_table(owner, nominal, final, held_out)
    forms = form_of(explanation, proof.ablations)
    found = findings(explanation, proof.final, proof.ablations, forms, held_out) if named or partly else ()
    progress("testing which mechanisms this motion can show")
    hidden = not_testable(final if named or partly else nominal)
    progress("designing the next experiment")
    # with findings only their rivals are in question; without, the cause may be a mechanism that the motion cannot show
    experiment = None
    if closed_loop_held(nominal, final, held_out) and not explanation.stopped_at and not change:
        experiment = separating(explanation, proof.final, held_out) if named else showing(nominal, hidden, held_out)
    left = torque_left(owner, nominal, final, held_out)
    notes += [*notes_on(table, proof, forms, verdict, explanation, final), *ended(final), *on_torque(left)]
    notes += [note for note in (refit.note, experiment.note if experiment else "") if note]
    notes += [] if data.observability.closed_loop else untold(data)
    notes += [stopped(explanation, budget_s)] if explanation.stopped_at else []
    result = Result(
        verdict=verdict,
        statement="",
        location=location,
        missing=found if named else (),
        partial=found if partly else (),
        change=change.told if change else None,
        parameter_corrections=law.corrections | ({} if as_given else corrections(bench, final)),
        not_identifiable=() if as_given else at_bound(final),
        fit=table,
        not_testable=hidden,
        unexplained=_unexplained(before, final, held_out, location, of_plant, change),
        torque_left=left,
        next_experiment=NextExperiment(profile=NEXT_EXPERIMENT, separates=experiment.separates)
        if experiment and experiment.profile
        else None,
        time_budget=TimeBudget(
            budget_s=budget_s, stopped_before=explanation.stopped_at, not_tried=explanation.not_tried
        )
        if explanation.stopped_at
        else None,
        notes=tuple(notes),
        runtime_s=time.monotonic() - begin,
    )
    told = statement(result.model_copy(update={"verdict": of_plant}))
    # settings of the controller come after what is found on the machine
    said = " ".join(text for text in ((told, law.advice) if found or change else (law.advice, told)) if text)
    result = result.model_copy(update={"statement": said})
    after = bench if as_given else diagnosed_bench(bench, final)
    if not data.observability.closed_loop:  # what was set aside stays in the file
        after = after.model_copy(update={"control": believed.control})
    after = after.model_copy(update={"encoders": believed.encoders})
    return Diagnosis(result, after, bench, data, held_out, explanation, proof, final, experiment, change)


def _unexplained(
    before: Fit, final: Fit, held_out: Dataset, location: Location | None, verdict: Verdict, change: Change | None
) -> Unexplained:
    """Unexplained share of the energy above the floor, and the channels above their noise."""
    share = 0.0 if verdict is Verdict.NO_MISMATCH else unexplained_share(before, final, held_out)
    fits: tuple[Fit, ...] = final.on(final.data), final.on(held_out)
    if change:
        share, fits = change.left, change.parts
    worst: dict[str, float] = {}
    names = channel_names(final.bench, final.data.runs[0])
    for fit in fits:
        for ratios in fit.noise_ratios:
            for name, ratio in ratios.items():
                worst[names[name]] = max(worst.get(names[name], 0.0), ratio)
    above = {name: float(np.sqrt(ratio)) for name, ratio in worst.items() if ratio > FLOOR}
    if not above:
        return Unexplained(share=share, description=AT_FLOOR)
    text = ", ".join(f"{name} at {digits(above[name])} × noise rms" for name in sorted(above, key=lambda n: -above[n]))
    if verdict is Verdict.UNEXPLAINED and not final.terms and location is not None:
        text += f"; {where_in_short(location, final.bench.axis.turns)}"
    return Unexplained(share=share, description=f"Residuals above the noise, block by block: {text}.")
