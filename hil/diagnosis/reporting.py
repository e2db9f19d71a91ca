"""Report a verdict: location, findings, figures, the next experiment, notes, and the statement."""

import time
from collections.abc import Sequence

import numpy as np

from hil.bench.bench_file import Bench
from hil.diagnosis.experiment import NEXT_EXPERIMENT, Experiment, separating, showing
from hil.diagnosis.ledger import refusal
from hil.diagnosis.location.locate import locate, shown_in
from hil.diagnosis.notes import at_bound, notes_on
from hil.diagnosis.result import (
    AT_FLOOR,
    NO_STRUCTURE,
    Location,
    NextExperiment,
    Result,
    StructureLeft,
    TimeBudget,
    Unexplained,
    Unnamed,
    Verdict,
)
from hil.diagnosis.stages import Judged, Prepared, Progress, Reported
from hil.diagnosis.statement import statement
from hil.diagnosis.structure_left import Dependence, like_noise
from hil.diagnosis.verdict.corrections import corrections, diagnosed_bench
from hil.diagnosis.verdict.findings import findings, form_of
from hil.diagnosis.verdict.fit_table import closed_loop_held, fit_table
from hil.diagnosis.verdict.in_bench import in_bench
from hil.diagnosis.verdict.judge import unexplained_share
from hil.diagnosis.verdict.ledgers import ledgers
from hil.diagnosis.verdict.refit import torque_left
from hil.diagnosis.verdict.testability import not_testable
from hil.diagnosis.verdict.unnamed import UnnamedTerm, with_maps
from hil.diagnosis.wording import channel_names, spoken, title, where_in_short
from hil.identification.estimator import Fit
from hil.identification.following import following
from hil.identification.noise_floor import FLOOR
from hil.quantities import digits
from hil.twin.library import BY_ID


def report(judged: Judged, progress: Progress, begin_s: float, budget_s: float) -> Reported:
    """Report a verdict; `begin_s` is the begin of the diagnosis on the monotonic clock, `budget_s` its time budget."""
    searched, proof = judged.tested.searched, judged.tested.proof
    prepared, nominal, final = searched.prepared, judged.nominal, judged.final
    bench, held_out, law = prepared.bench, prepared.held_out, prepared.law

    progress("locating")
    location = _location(judged)
    progress("comparing the fits with the noise floor")
    table = fit_table(searched.given, nominal, final, held_out)
    forms = form_of(searched, proof.ablations)
    found = findings(searched, proof.final, proof.ablations, forms, held_out) if judged.has_findings else ()
    progress("testing which mechanisms this motion can show")
    hidden = not_testable(final if judged.has_findings else nominal)
    progress("designing the next experiment")
    experiment = _experiment(judged, hidden)
    left = torque_left(searched.given, nominal, final, held_out)
    result = Result(
        verdict=judged.verdict,
        statement="",
        location=location,
        missing=() if judged.is_part else found,
        partial=found if judged.is_part else (),
        change=judged.change.summary if judged.change else None,
        parameter_corrections=law.corrections | ({} if judged.keeps_bench else corrections(bench, final)),
        added_command=law.windows,
        not_identifiable=() if judged.keeps_bench else at_bound(final),
        fit=table,
        not_testable=hidden,
        unexplained=_unexplained(judged, location),
        torque_left=left,
        structure=tuple(_structure(one, bench.axis.drive_unit) for one in judged.structure),
        unnamed=tuple(_unnamed(one, judged) for one in judged.unnamed),
        next_experiment=NextExperiment(profile=NEXT_EXPERIMENT, separates=experiment.separates)
        if experiment and experiment.profile
        else None,
        time_budget=TimeBudget(budget_s=budget_s, stopped_before=searched.stopped_at, not_tried=searched.not_tried)
        if searched.stopped_at
        else None,
        considered=ledgers(judged, forms),
        notes=tuple(notes_on(judged, table, forms, left, experiment.note if experiment else "", budget_s)),
        runtime_s=time.monotonic() - begin_s,
    )
    of_plant = statement(result.model_copy(update={"verdict": judged.of_plant}))
    # settings of the controller come after what is found on the machine
    sentences = [of_plant, law.advice] if found or judged.change else [law.advice, of_plant]
    of_bench = nominal if judged.of_plant is Verdict.AXIS_CHANGED else final
    changes = {one.name for one in judged.change.summary.parameters} if judged.change else set[str]()
    sentences += [in_bench(of_bench, held_out, changes, prepared.told), _following(prepared)]
    result = result.model_copy(update={"statement": " ".join(filter(None, sentences))})
    return Reported(judged, result, _bench(judged), experiment)


def _following(prepared: Prepared) -> str:
    """How the motion follows its set-points where no control law says why; empty without set-points or lateness."""
    if prepared.bench.law_known:
        return ""
    run, axis = prepared.train.runs[0], prepared.bench.axis
    found = following(run.position_command_m, run.motor, run.period_s)
    return found.in_words("rad" if axis.turns else "m") if found else ""


def _location(judged: Judged) -> Location | None:
    """Where the mismatch is: that of the plant, or the control law if only this differs from the bench."""
    held_out, law = judged.tested.searched.prepared.held_out, judged.tested.searched.prepared.law
    if judged.verdict is not judged.of_plant:
        element = "command behind the control law" if law.windows else "settings of the control law"
        return Location(block="controller", element=element, channels=())
    if judged.verdict is Verdict.NO_MISMATCH:
        return None
    seen, goal = shown_in(judged.before, held_out), judged.nominal if judged.is_part else judged.final
    return locate(seen, seen if goal is judged.before else goal)


def _experiment(judged: Judged, hidden: tuple[str, ...]) -> Experiment | None:
    """The next motion.

    With findings only their rivals are in question; without, the cause may be a mechanism that the motion cannot show.
    """
    searched = judged.tested.searched
    held_out = searched.prepared.held_out
    if not closed_loop_held(judged.nominal, judged.final, held_out) or searched.stopped_at or judged.change:
        return None
    if judged.of_plant is Verdict.MISSING_PHYSICS:
        return separating(searched, judged.tested.proof.final, held_out)
    return showing(judged.nominal, hidden, held_out)


def _bench(judged: Judged) -> Bench:
    """The bench with what was found; a control law that was set aside, and encoders, stay as they were in the file."""
    prepared = judged.tested.searched.prepared
    bench = prepared.bench
    if not judged.keeps_bench or judged.unnamed:
        bench = diagnosed_bench(bench, with_maps(judged.final, judged.unnamed))
    if not prepared.bench.law_known:
        bench = bench.model_copy(update={"control": prepared.bench_file.control})
    return bench.model_copy(update={"encoders": prepared.bench_file.encoders})


def _structure(one: Dependence, drive_unit: str) -> StructureLeft:
    return StructureLeft(
        channel=one.channel,
        over=one.question.name,
        share=min(max(one.explained, 0.0), 1.0),
        by_chance=one.found.p,
        text=one.in_words(drive_unit),
    )


def _unnamed(one: UnnamedTerm, judged: Judged) -> Unnamed:
    """A map, and the nearest mechanism of the library with the rule that refutes it."""
    mapped, tried = BY_ID[one.term.effect], judged.tested.searched.considered
    near = next((other for other in reversed(tried) if not other.accepted), None)
    return Unnamed(
        effect=mapped.id,
        parameters={name: value for name, value in zip(mapped.names, one.term.values, strict=True)},
        held_out_before=one.before,
        held_out_after=one.after,
        nearest=f"{title(near.key[0])}: {refusal(near.ledger)}" if near else "",
    )


def _times(ratios: Sequence[float]) -> str:
    """Largest rms over the noise of a channel, and in how many of the recordings it is above, if not in all."""
    above = sum(ratio > FLOOR for ratio in ratios)
    where = f" in {above} of {len(ratios)} recordings or parts" if above < len(ratios) else ""
    return f"{digits(max(ratios) ** 0.5)} times{where}"


def _unexplained(judged: Judged, location: Location | None) -> Unexplained:
    """Unexplained share of the energy above the floor, and the channels above their noise."""
    final, held_out, change = judged.final, judged.tested.searched.prepared.held_out, judged.change
    none = judged.of_plant is Verdict.NO_MISMATCH
    alike = like_noise(final, judged.structure)
    # beside terms a channel whose remainder is like noise does not count, as for the rule on the explanation
    share = 0.0 if none else unexplained_share(judged.before, final, held_out, alike if final.terms else ())
    fits: tuple[Fit, ...] = final.on(final.data), final.on(held_out)
    if change:
        share, fits = change.left, change.parts
    found: dict[str, list[float]] = {}
    names = channel_names(final.bench, final.data.runs[0])
    for fit in fits:
        for ratios in fit.noise_ratios:
            for name, ratio in ratios.items():
                found.setdefault(names[name], []).append(ratio)
    above = {name: float(np.sqrt(max(ratios))) for name, ratios in found.items() if max(ratios) > FLOOR}
    if not above:
        return Unexplained(share=share, description=AT_FLOOR)
    quiet = {names[name] for name in alike}
    text = ", ".join(
        f"{spoken(name)} {_times(found[name])}" + (f" {NO_STRUCTURE}" if name in quiet else "")
        for name in sorted(above, key=lambda n: -above[n])
    )
    if judged.of_plant is Verdict.UNEXPLAINED and not final.terms and location is not None:
        text += f"; {where_in_short(location, final.bench.axis.turns)}"
    return Unexplained(share=share, description=f"Residuals above the noise (rms): {text}.")
