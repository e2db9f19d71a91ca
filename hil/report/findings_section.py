"""Section of a report: each finding with its picture, its values and its alternatives."""

from pathlib import Path

from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.pictures.findings import finding_figure
from hil.diagnosis.result import Finding
from hil.diagnosis.turning import of_load
from hil.diagnosis.value import Value
from hil.diagnosis.wording import label, parameter_of, title, titles
from hil.figures.drawing import save
from hil.identification.terms import Term
from hil.quantities import digits, reading_unit, with_error
from hil.report.page import Page
from hil.twin.library import BY_ID


def findings_section(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
    """Add the findings with their pictures."""
    for index in range(len(diagnosis.result.findings)):
        _finding(page, diagnosis, index, folder)


def _finding(page: Page, diagnosis: Diagnosis, index: int, folder: Path) -> None:
    finding, term = diagnosis.result.findings[index], diagnosis.term_of(index)
    mechanism = BY_ID[finding.effect]
    name = label(term, diagnosis.given_bench)
    name += "".join(f" or {title(one)}" for one in finding.equivalents)
    name = f"Explains a part: {name}" if diagnosis.result.partial else f"{name[:1].upper()}{name[1:]}"
    turns = diagnosis.given_bench.axis.turns
    page.heading(of_load(f"{index + 1}. {name}: {mechanism.element_of(term.variant)}", turns))
    figure, caption = finding_figure(diagnosis, term)
    again = f"_{term.slot + 1}" if term.slot else ""
    page.picture(save(figure, folder / f"{term.effect}{again}.png"), of_load(caption, turns))
    sure = f"{100.0 * finding.confidence:.0f} %" if finding.confidence < 0.99 else "above 99 %"
    of_set = " (that one of them is there)" if finding.equivalents else ""
    page.text(f"{finding.sentence} Confidence {sure}{of_set}: {finding.needed}.")
    page.text(f"{mechanism.equation} ({mechanism.source})")
    if finding.form:
        page.text(f"Reported as part of this curve, because it corrects the curve's form only slightly: {finding.form}")
    page.table(
        ("parameter", "value", "standard error", "unit"),
        [
            (
                parameter_of(finding.effect, name).spoken,
                *_cells(entry, not finding.windows, name in _at_bound(diagnosis, term)),
            )
            for name, entry in finding.parameters.items()
        ],
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


def _windows(finding: Finding) -> list[tuple[str, ...]]:
    """Windows of an event, with standard errors."""
    return [
        (one.recording, *(" ± ".join(with_error(e.value, e.std)) for e in (one.start, one.end, one.strength)))
        for one in finding.windows
    ]


def _at_bound(diagnosis: Diagnosis, term: Term) -> set[str]:
    """Parameters of a term that ended at the bound of their range."""
    final = diagnosis.final
    at = next(index for index, one in enumerate(final.terms) if one is term)
    return {name.partition(".")[2] for name in final.at_bound if name.startswith(f"{at}.")}


def _cells(entry: Value, scaled: bool = True, at_bound: bool = False) -> tuple[str, ...]:
    """Cells of a value, its standard error, and the unit in which both are shown: the SI unit if not `scaled`."""
    factor, unit = reading_unit(entry.unit, entry.value) if scaled else (1.0, entry.unit)
    if at_bound:
        return digits(entry.value * factor), "at its bound", unit
    return *with_error(entry.value * factor, entry.std * factor), unit
