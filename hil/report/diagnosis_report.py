"""Report of `hil diagnose`: page, pictures, numbers, and the bench with the corrected parameters and the findings."""

from collections.abc import Sequence
from pathlib import Path

from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.experiment import NEXT_EXPERIMENT
from hil.diagnosis.pictures.change import CAPTION
from hil.diagnosis.pictures.findings import finding_figure, term_of
from hil.diagnosis.pictures.location import residual_panels
from hil.diagnosis.pictures.structure import CAPTION as CAPTION_OF_STRUCTURE
from hil.diagnosis.pictures.structure import structure_figure
from hil.diagnosis.preparation.split import whole_name
from hil.diagnosis.result import Finding, FitFigures, Result, TorqueLeft, Value, Verdict
from hil.diagnosis.statement import explained
from hil.diagnosis.turning import of_load
from hil.diagnosis.wording import label, spoken, title, titles, where
from hil.figures.drawing import save
from hil.files.output import write_json
from hil.motion.profile import write_profile
from hil.quantities import digits, percent, quantity, reading_unit
from hil.report import plots
from hil.report.compare_report import fitted_cells, write_bench
from hil.report.ledger_report import ledger_section
from hil.report.page import Page
from hil.twin.library import BY_ID

_FIT_HEADERS = (
    "channel",
    "how",
    "recordings",
    "bench file",
    "before (refitted)",
    "after",
    "noise",
    "after / noise",
)


def write_diagnosis(diagnosis: Diagnosis, folder: Path, assumed: Sequence[str] = ()) -> None:
    """Write diagnosis.json, report.html with its PNGs, bench.diagnosed.yaml and, if one helps, next_experiment.yaml.

    `assumed` of recordings and bench is told on the page, so that a reader can correct it.
    """
    result = diagnosis.result
    names = ", ".join(dict.fromkeys(whole_name(run.name) for run in diagnosis.train.runs))
    page = Page(f"Diagnosis of {names}", _lead(diagnosis), result.statement, explained(result))
    for index in range(len(result.findings)):
        _finding(page, diagnosis, index, folder)
    _change(page, diagnosis, folder)
    if result.location is not None:
        page.heading("Where it is")
        page.items(
            [
                f"{what.capitalize()}: {text}."
                for what, text in where(result.location, diagnosis.given_bench.axis.turns).items()
            ]
        )
        page.picture(
            save(diagnosis.plot("location"), folder / "location.png"),
            "Energy of the mismatch above the noise: by channel, by phase of motion, and its mean "
            "per sample over position, speed and time.",
        )
    _fit(page, diagnosis, folder)
    _corrections(page, result)
    page.heading("What remains unexplained")
    page.text(result.unexplained.description)
    if result.unexplained.share > 0.0:
        page.text(f"Unexplained: {percent(result.unexplained.share)} of the energy above the noise.")
    page.items([f"{one.text[:1].upper()}{one.text[1:]}." for one in result.structure])
    _structure(page, diagnosis, folder)
    page.heading("What this motion cannot show")
    page.text(
        titles(result.not_testable)
        or "Every mechanism of the library would show in these recordings at a typical strength."
    )
    _next_experiment(page, diagnosis, folder)
    if assumed:
        page.heading("What was assumed")
        page.items(list(assumed))
    ledger_section(page, result)
    page.heading("How it was judged")
    repeated = diagnosis.experiment.note if diagnosis.experiment else ""
    page.items(
        [
            *(note for note in result.notes if note != repeated),
            f"The diagnosis took {digits(result.runtime_s)} s.",
            "bench.diagnosed.yaml is the bench with these parameters and findings, for every other command.",
        ]
    )
    write_json(folder / "diagnosis.json", result.as_json())
    write_bench(diagnosis.bench, folder / "bench.diagnosed.yaml")
    page.write(folder / "report.html")


def _structure(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
    """What is left depends on something: where, and the map of it that has no name."""
    result = diagnosis.result
    if result.structure and (figure := structure_figure(diagnosis)):
        page.picture(save(figure, folder / "structure.png"), CAPTION_OF_STRUCTURE)
    for one in result.unnamed:
        page.text(
            f"{one.effect.replace('_', ' ').capitalize()}: bench.diagnosed.yaml has it. What is left on held-out "
            f"recordings falls from {digits(one.held_out_before)} to {digits(one.held_out_after)} rms. "
            f"Nearest mechanism of the library: {one.nearest or 'none was fitted'}."
        )


def _lead(diagnosis: Diagnosis) -> str:
    seconds = sum(run.motor.size * run.period_s for run in diagnosis.train.runs)
    whole = {whole_name(run.name) for run in diagnosis.train.runs}
    held_out = ", ".join(
        "its last part" if whole == {whole_name(run.name)} else run.name for run in diagnosis.held_out.runs
    )
    held_out = held_out or "nothing"
    bench = f"bench {diagnosis.given_bench.name} ({diagnosis.given_bench.axis.model})"
    ended = " · ended by its time budget, see How it was judged" if diagnosis.result.time_budget else ""
    return f"{seconds:.1f} s of training, held out: {held_out} · {bench}{ended}"


def _finding(page: Page, diagnosis: Diagnosis, index: int, folder: Path) -> None:
    finding, term = diagnosis.result.findings[index], term_of(diagnosis, index)
    mechanism = BY_ID[finding.effect]
    name = title(finding.effect)
    name = f"Explains a part: {name}" if diagnosis.result.partial else name.capitalize()
    turns = diagnosis.given_bench.axis.turns
    page.heading(f"{index + 1}. {name}: {of_load(mechanism.element_of(term.variant), turns)}")
    figure, caption = finding_figure(diagnosis, term)
    again = f"_{term.slot + 1}" if term.slot else ""
    page.picture(save(figure, folder / f"{term.effect}{again}.png"), of_load(caption, turns))
    sure = f"{100.0 * finding.confidence:.0f} %" if finding.confidence < 0.99 else "above 99 %"
    page.text(f"{finding.sentence} Confidence {sure}: {finding.needed}.")
    page.text(f"{mechanism.equation} ({mechanism.source})")
    if finding.form:
        page.text(f"Reported as part of this curve, because it corrects the curve's form only slightly: {finding.form}")
    page.table(
        ("parameter", "value", "standard error", "unit"),
        [(name, *_value(entry, scaled=not finding.windows)) for name, entry in finding.parameters.items()],
        left=(0, 3),
    )
    if len(finding.windows) > 1:
        unit = finding.windows[0].strength.unit
        page.table(("recording", "from [s]", "to [s]", f"strength [{unit}]"), _windows(finding), left=range(4))
    if finding.equivalents:
        page.text(f"This motion cannot distinguish it from: {titles(finding.equivalents)}.")
    if finding.rivals:
        page.table(
            ("alternative", "compared with this finding"),
            [(title(rival.effect), rival.evidence) for rival in finding.rivals],
            left=(0, 1),
        )


def _change(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
    result, change = diagnosis.result, diagnosis.result.change
    if change is None:
        return
    page.heading("What changed" if result.verdict is Verdict.AXIS_CHANGED else "Explains a part: a change of the axis")
    page.picture(save(diagnosis.plot("change"), folder / "change.png"), CAPTION)
    rows = []
    for one in change.parameters:
        factor, unit = reading_unit(one.values[0].unit, max(abs(entry.value) for entry in one.values))
        cells = (f"{digits(entry.value * factor, 4)} ± {digits(entry.std * factor, 2)}" for entry in one.values)
        rows.append((one.name, *cells, unit))
    page.table(("parameter", *change.parts, "unit"), rows, left=(0, 1 + len(change.parts)))
    page.text(
        "The tables below are of one set of parameters for all recordings. No parameter of the axis is corrected."
    )


def _windows(finding: Finding) -> list[tuple[str, ...]]:
    """Windows of an event, with standard errors."""
    return [
        (one.recording, *(f"{digits(e.value)} ± {digits(e.std)}" for e in (one.start, one.end, one.strength)))
        for one in finding.windows
    ]


def _fit(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
    result = diagnosis.result
    page.heading("Does modelling it help?")
    page.table(
        _FIT_HEADERS,
        [
            (spoken(name), title(entry.mode), what, *_figures(found, entry.unit))
            for name, entry in result.fit.items()
            for what, found in (("training", entry.train), ("held out", entry.validate_))
            if found is not None
        ],
        left=(0, 1, 2),
    )
    run = (*diagnosis.held_out.runs, *diagnosis.train.runs)[0]
    save(diagnosis.plot("residuals"), folder / "residuals.png")
    page.text(f"Measured - twin on {run.name}, before and after; the band is the noise floor (residuals.png).")
    page.plot(plots.over_time(run.time_s, residual_panels(diagnosis, run)))
    if result.torque_left:
        page.text(torque_line(result.torque_left))
    proof = diagnosis.reported.judged.tested.proof
    kept, dropped = proof.ablations, proof.dropped
    if not dropped and not (result.findings and len(kept) > 1):
        return
    page.text("Growth of the residual energy if one term is left out and everything else is refitted.")
    page.table(
        ("without", "training", "held out", "kept"),
        [
            (
                label(ablation.term, diagnosis.given_bench),
                f"{digits(ablation.train)} ×",
                f"{digits(ablation.held_out)} ×" if ablation.held_out is not None else "–",
                answer,
            )
            for answer, found in (("yes", kept), ("no", dropped))
            for ablation in found
        ],
        mark=3,
    )


def torque_line(left: TorqueLeft) -> str:
    """One line: the torque left on held-out motion by each twin, and by the plain model."""
    shares = {
        "bench file": left.owner,
        "refitted": left.refitted,
        "after": left.final,
        "plain least squares": left.plain,
    }
    given = ", ".join(f"{name} {percent(share)}" for name, share in shares.items() if share is not None)
    return f"Torque left on held-out motion, of the torque's standard deviation: {given}."


def _corrections(page: Page, result: Result) -> None:
    rows = [
        (name, one.unit, *fitted_cells(one.nominal, one.value, one.std))
        for name, one in result.parameter_corrections.items()
    ]
    if not rows and not result.not_identifiable:
        return
    page.heading("Parameters of the bench")
    if result.not_identifiable:
        page.text(f"Not identifiable from this motion: {', '.join(result.not_identifiable)}.")
    if rows:
        page.table(("parameter", "unit", "bench file", "fitted", "standard error", "change"), rows, left=(0, 1))


def _next_experiment(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
    experiment, result = diagnosis.experiment, diagnosis.result
    page.heading("Next experiment")
    page.text(experiment.note if experiment else _no_experiment(result))
    if experiment and experiment.profile:
        page.text(
            f"{NEXT_EXPERIMENT} is its profile: run it and diagnose all recordings together; hil investigate does both."
        )
        write_profile(folder / NEXT_EXPERIMENT, experiment.profile)


def _no_experiment(result: Result) -> str:
    if result.verdict is Verdict.UNEXPLAINED:
        return "None was designed: that needs a known control law, and a twin that holds its closed loop."
    return "No question is open that another motion could answer."


def _value(entry: Value, scaled: bool = True) -> tuple[str, ...]:
    """Cells of a value, its standard error, and the unit in which both are shown: the SI unit if not `scaled`."""
    factor, unit = reading_unit(entry.unit, entry.value) if scaled else (1.0, entry.unit)
    return digits(entry.value * factor, 4), digits(entry.std * factor, 2), unit


def _figures(found: FitFigures, unit: str) -> list[str]:
    """Cells of a channel's rms values, and the last over the noise floor."""
    values = (found.owner_rms, found.before_rms, found.after_rms, found.noise_floor_rms)
    over_floor = digits(found.after_rms / found.noise_floor_rms) if found.noise_floor_rms > 0.0 else "–"
    return [*("unstable" if value is None else quantity(value, unit) for value in values), over_floor]
