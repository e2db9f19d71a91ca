"""The report of `hil diagnose`: page, pictures, numbers, and the bench that now explains the recordings."""

from __future__ import annotations

from pathlib import Path

from hil.diagnosis.diagnose import NEXT_EXPERIMENT, Diagnosis
from hil.diagnosis.result import FitFigures, Location, Verdict
from hil.diagnosis.wording import label, number, title
from hil.files.output import write_json
from hil.identification.terms import Term
from hil.motion.profile import write_profile
from hil.report import figures, plots
from hil.report.compare_report import write_bench
from hil.report.diagnosis.figures import convincing
from hil.report.diagnosis.location import location_figure, residual_panels
from hil.report.page import Number, Page
from hil.report.style import digits, percent, quantity
from hil.twin.library import BY_ID


def write_diagnosis(diagnosis: Diagnosis, folder: Path) -> None:
    """Write diagnosis.json, report.html with its PNGs, bench.diagnosed.yaml and, if one helps, next_experiment.yaml."""
    result = diagnosis.result
    good = result.verdict is not Verdict.UNEXPLAINED
    names = ", ".join(run.name for run in diagnosis.train.runs)
    page = Page(f"Diagnosis of {names}", _lead(diagnosis), result.statement, good)
    for index, term in enumerate(_terms(diagnosis)):
        _finding(page, diagnosis, index, term, folder / f"{term.effect}{f'_{term.slot + 1}' if term.slot else ''}.png")
    if result.location is not None:
        page.heading("Where it is")
        page.items(_where(result.location))
        page.picture(
            figures.save(location_figure(diagnosis), folder / "location.png"),
            "Energy of the mismatch above the noise. Each block is fed with measured inputs, so that a "
            "mismatch shows only in the block it lives in; energy over position and speed is per time spent.",
        )
    _fit(page, diagnosis, folder)
    if result.parameter_corrections:
        page.heading("Parameters of the bench")
        page.table(
            ("parameter", "unit", "bench file", "fitted", "standard error", "change"),
            [
                (
                    name,
                    entry.unit,
                    Number(digits(entry.nominal, 4)),
                    Number(digits(entry.value, 5)),
                    Number(digits(entry.std, 2)),
                    Number(_change(entry.value, entry.nominal)),
                )
                for name, entry in result.parameter_corrections.items()
            ],
        )
    page.heading("What is left")
    page.text(result.unexplained.description)
    if result.unexplained.share > 0.0:
        page.text(f"Unexplained: {percent(result.unexplained.share)} of the energy above the noise.")
    page.heading("What this motion cannot show")
    page.text(
        ", ".join(title(effect) for effect in result.not_testable)
        if result.not_testable
        else "Every mechanism of the library would show at a strength that matters."
    )
    page.heading("Next experiment")
    page.text(diagnosis.experiment.note if diagnosis.experiment else "Nothing is open that another motion could tell.")
    if diagnosis.experiment and diagnosis.experiment.profile:
        page.text(
            f"{NEXT_EXPERIMENT} is its profile: run it, and diagnose all recordings together; hil investigate "
            "does both."
        )
        write_profile(folder / NEXT_EXPERIMENT, diagnosis.experiment.profile)
    page.heading("How it was judged")
    said = diagnosis.experiment.note if diagnosis.experiment else ""
    page.items(
        [
            *(note for note in result.notes if note != said),
            f"Searched and proven in {digits(result.runtime_s)} s.",
            "bench.diagnosed.yaml is the bench with these parameters and terms, for every other command.",
        ]
    )
    write_json(folder / "diagnosis.json", result.as_json())
    write_bench(diagnosis.bench, folder / "bench.diagnosed.yaml")
    page.write(folder / "report.html")


def _lead(diagnosis: Diagnosis) -> str:
    seconds = sum(run.motor.size * run.period_s for run in diagnosis.train.runs)
    held_out = ", ".join(run.name for run in diagnosis.held_out.runs) or "nothing"
    return (
        f"{seconds:.1f} s of training, held out: {held_out} · bench {diagnosis.owner.name} "
        f"({diagnosis.owner.axis.model})"
    )


def _terms(diagnosis: Diagnosis) -> list[Term]:
    """The term of each finding."""
    return [
        next(
            term
            for term in diagnosis.final.terms
            if term.effect == finding.effect and term.values[0] == next(iter(finding.parameters.values())).value
        )
        for finding in diagnosis.result.missing
    ]


def _finding(page: Page, diagnosis: Diagnosis, index: int, term: Term, picture: Path) -> None:
    finding = diagnosis.result.missing[index]
    mechanism = BY_ID[finding.effect]
    page.heading(f"{index + 1}. {title(finding.effect).capitalize()}: {mechanism.element}")
    shown = convincing(diagnosis, term)
    page.picture(figures.save(shown.figure, picture), shown.caption)
    page.text(f"{finding.sentence} Confidence {_sure(finding.confidence)}: {finding.needed}.")
    page.text(f"{mechanism.equation} ({mechanism.source})")
    if finding.form:
        page.text(f"The fit mends the form of this curve by so little that it is no second cause: {finding.form}")
    page.table(
        ("parameter", "value", "standard error", "unit"),
        [
            (name, Number(digits(entry.value, 4)), Number(digits(entry.std, 2)), entry.unit)
            for name, entry in finding.parameters.items()
        ],
    )
    if finding.equivalents:
        page.text(f"This motion cannot tell it from: {', '.join(map(title, finding.equivalents))}.")
    if finding.rivals:
        page.table(
            ("weighed against", "and why it lost"), [(title(rival.effect), rival.evidence) for rival in finding.rivals]
        )


def _where(location: Location) -> list[str]:
    texts = [
        f"Block: {title(location.block)}; element: {location.element}; channels: {', '.join(location.channels)}.",
        "Phases: "
        + ", ".join(
            f"{title(phase.kind)} {100.0 * phase.share:.0f} %" for phase in location.phases if phase.share >= 0.005
        )
        + ".",
    ]
    if location.windows_s:
        texts.append(
            "Windows of the first recording: " + ", ".join(f"{a:.2f}–{b:.2f} s" for a, b in location.windows_s) + "."
        )
    if location.position_m:
        texts.append(f"Position: {1e3 * location.position_m[0]:.1f} to {1e3 * location.position_m[1]:.1f} mm.")
    if location.speed_m_s:
        texts.append(f"Speed: {60.0 * location.speed_m_s[0]:.3g} to {60.0 * location.speed_m_s[1]:.3g} m/min.")
    if location.order_per_rev:
        texts.append(f"Locked to the angle: {number(location.order_per_rev)} per revolution of the screw.")
    elif location.period_m:
        texts.append(f"Locked to the position: every {quantity(location.period_m, 'm')}.")
    elif location.frequency_hz:
        texts.append(f"Locked to time: {number(location.frequency_hz)} Hz.")
    return texts


def _fit(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
    result = diagnosis.result
    page.heading("Does modelling it help?")
    rows = []
    for name, entry in result.fit.items():
        for what, found in (("training", entry.train), ("held out", entry.validate_)):
            if found is not None:
                rows.append(_row(name, title(entry.mode), what, found, entry.unit))
    page.table(
        (
            "channel",
            "how",
            "recordings",
            "bench file",
            "before: parameters refitted",
            "after",
            "noise floor",
            "after over floor",
        ),
        rows,
    )
    run = (*diagnosis.held_out.runs, *diagnosis.train.runs)[0]
    panels = residual_panels(diagnosis, run)
    figure = figures.over_time(f"{run.name}: measured less twin, noise floor in grey", run.time_s, panels)
    figures.save(figure, folder / "residuals.png")
    page.text(f"Measured less twin on {run.name}, before and after; the band is the noise floor (residuals.png).")
    page.plot(plots.over_time(run.time_s, panels))
    if (result.missing and len(diagnosis.proof.ablations) > 1) or diagnosis.proof.dropped:
        page.text("Each term left out in turn, everything else refitted: factor by which the residual energy grows.")
        page.table(
            ("without", "training", "held out", "kept"),
            [
                (
                    label(ablation.term),
                    Number(f"{number(ablation.train)} ×"),
                    Number(f"{number(ablation.held_out)} ×" if ablation.held_out is not None else "–"),
                    kept,
                )
                for kept, found in (("yes", diagnosis.proof.ablations), ("no", diagnosis.proof.dropped))
                for ablation in found
            ],
            mark=3,
        )


def _row(name: str, mode: str, what: str, found: FitFigures, unit: str) -> tuple[str, ...]:
    return (
        name,
        mode,
        what,
        *(
            Number(quantity(value, unit))
            for value in (found.owner_rms, found.before_rms, found.after_rms, found.noise_floor_rms)
        ),
        Number(digits(found.after_rms / found.noise_floor_rms) if found.noise_floor_rms > 0.0 else "–"),
    )


def _sure(confidence: float) -> str:
    return f"{100.0 * confidence:.0f} %" if confidence < 0.99 else "above 99 %"


def _change(value: float, nominal: float) -> str:
    return f"{100.0 * (value / nominal - 1.0):+.1f} %" if nominal > 0.0 else "–"
