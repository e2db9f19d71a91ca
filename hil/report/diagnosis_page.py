"""Page of `hil diagnose` with its pictures. Matplotlib and Bokeh are loaded when this module is."""

from collections.abc import Sequence
from pathlib import Path

from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.experiment import NEXT_EXPERIMENT
from hil.diagnosis.open_questions import no_experiment
from hil.diagnosis.pictures.change import CAPTION
from hil.diagnosis.pictures.structure import CAPTION as CAPTION_OF_STRUCTURE
from hil.diagnosis.pictures.structure import structure_figure
from hil.diagnosis.result import AT_FLOOR, Verdict
from hil.diagnosis.statement import explained
from hil.diagnosis.wording import part_of, titles, where, whole_name
from hil.figures.drawing import save
from hil.importing.own_units import COUNT_AS
from hil.quantities import digits, percent, reading_unit
from hil.report.findings_section import findings_section
from hil.report.fit_section import corrections_section, fit_section
from hil.report.ledger_report import ledger_section
from hil.report.page import Page

UNSIZED = "The size of a channel is not known (see What was assumed): values are multiples of the true ones."
LEGEND = (
    "Colour of the bar: green, all of the mismatch is explained; orange, something is left, doubtful or not searched."
)


def write_page(diagnosis: Diagnosis, folder: Path, assumed: Sequence[str]) -> None:
    """Write report.html with its PNGs."""
    result = diagnosis.result
    names = ", ".join(dict.fromkeys(whole_name(run.name) for run in diagnosis.train.runs))
    sized = not any(COUNT_AS in one for one in assumed)
    verdict = result.statement if sized else f"{UNSIZED} {result.statement}"
    page = Page(f"Diagnosis of {names}", _lead(diagnosis), verdict, explained(result) and sized, LEGEND)
    findings_section(page, diagnosis, folder)
    _change(page, diagnosis, folder)
    # below the noise of a row no row tells where: the structure does
    nameless = result.verdict is Verdict.UNEXPLAINED and not result.findings
    if result.location is not None and not (nameless and result.unexplained.description == AT_FLOOR):
        page.heading("Where it is")
        page.items(
            [
                f"{what.capitalize()}: {text}."
                for what, text in where(result.location, diagnosis.given_bench.axis.turns).items()
            ]
        )
        page.picture(
            save(diagnosis.plot("location"), folder / "location.png"),
            "Energy of the mismatch above the noise: by channel, by phase of motion, and its mean per sample over "
            "position, speed and time.",
        )
    fit_section(page, diagnosis, folder)
    corrections_section(page, diagnosis)
    page.heading("What remains unexplained")
    page.text(result.unexplained.description)
    if result.unexplained.share > 0.0 and result.unexplained.description != AT_FLOOR:
        page.text(f"Unexplained: {percent(result.unexplained.share)} of the energy above the noise.")
    page.items([f"{one.text[:1].upper()}{one.text[1:]}." for one in result.structure])
    _structure(page, diagnosis, folder)
    page.heading("What this motion cannot show")
    page.text(
        titles(result.not_testable)
        or "Every mechanism of the library would show in these recordings at a typical strength."
    )
    _next_experiment(page, diagnosis)
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
            "bench.diagnosed.yaml is the bench with these parameters and findings, for every other command; what is "
            "doubtful is in its comments.",
        ]
    )
    page.write(folder / "report.html")


def _structure(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
    """The residual depends on something: where, and the map of it that has no name."""
    result = diagnosis.result
    if result.structure and (figure := structure_figure(diagnosis)):
        page.picture(save(figure, folder / "structure.png"), CAPTION_OF_STRUCTURE)
    for one in result.unnamed:
        page.text(
            f"{one.effect.replace('_', ' ').capitalize()}: bench.diagnosed.yaml has it. The residual on held-out "
            f"recordings falls from {digits(one.held_out_before)} to {digits(one.held_out_after)} rms. "
            f"Nearest mechanism of the library: {one.nearest or 'none was fitted'}."
        )


def _lead(diagnosis: Diagnosis) -> str:
    seconds = sum(run.motor.size * run.period_s for run in diagnosis.train.runs)
    whole = {whole_name(run.name) for run in diagnosis.train.runs}
    held_out = ", ".join(
        f"its {part}" if whole == {whole_name(run.name)} and (part := part_of(run.name)) else run.name
        for run in diagnosis.held_out.runs
    )
    held_out = held_out or "nothing"
    bench = f"bench {diagnosis.given_bench.name} ({diagnosis.given_bench.axis.model})"
    ended = " · ended by its time budget, see How it was judged" if diagnosis.result.time_budget else ""
    return f"{seconds:.1f} s of training, held out: {held_out} · {bench}{ended}"


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


def _next_experiment(page: Page, diagnosis: Diagnosis) -> None:
    experiment, result = diagnosis.experiment, diagnosis.result
    page.heading("Next experiment")
    page.text(experiment.note if experiment else no_experiment(result))
    if experiment and experiment.profile:
        page.text(
            f"{NEXT_EXPERIMENT} is its profile: run it and diagnose all recordings together; hil investigate does both."
        )
