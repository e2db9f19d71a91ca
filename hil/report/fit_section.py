"""Sections of a report: the residual before and after, and the parameters of the bench."""

from pathlib import Path

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.pictures.location import residual_panels
from hil.diagnosis.result import FitFigures
from hil.diagnosis.wording import label, spoken, spoken_key, title
from hil.figures.drawing import save
from hil.identification.residual_scales import inertia
from hil.quantities import digits, quantity, reading_unit, unit_of
from hil.report import plots
from hil.report.compare_report import fitted_cells
from hil.report.page import Page
from hil.report.summary import torque_line

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


def fit_section(page: Page, diagnosis: Diagnosis, folder: Path) -> None:
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
    page.text(
        f"Measured - twin on {run.name}, before and after; the band is the noise floor (residuals.png). Torque is "
        "shown where the axis slides: an effect below the noise of a position is seen there."
    )
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


def _figures(found: FitFigures, unit: str) -> list[str]:
    """Cells of a channel's rms values, and the last over the noise floor."""
    values = (found.owner_rms, found.before_rms, found.after_rms, found.noise_floor_rms)
    over_floor = digits(found.after_rms / found.noise_floor_rms) if found.noise_floor_rms > 0.0 else "–"
    return [*("unstable" if value is None else quantity(value, unit) for value in values), over_floor]


def corrections_section(page: Page, diagnosis: Diagnosis) -> None:
    """Parameters of the bench that are corrected; where none is, those that it has."""
    result, rows = diagnosis.result, list[tuple[str, ...]]()
    for name, one in result.parameter_corrections.items():
        factor, unit = reading_unit(one.unit, max(abs(one.nominal), abs(one.value)))
        values = (factor * value for value in (one.nominal, one.value, one.std))
        rows.append((spoken_key(name), unit, *fitted_cells(*values)))
    if not rows and not result.not_identifiable:
        _values_of_bench(page, diagnosis.given_bench)
        return
    page.heading("Parameters of the bench")
    if result.not_identifiable:
        page.text(f"Not identifiable from this motion: {', '.join(result.not_identifiable)}.")
    if held := diagnosis.given_bench.axis.held:
        page.text(f"Held as the bench file gives them: {', '.join(map(spoken_key, held))}.")
    if rows:
        page.table(("parameter", "unit", "bench file", "fitted", "standard error", "change"), rows, left=(0, 1))


def _values_of_bench(page: Page, bench: Bench) -> None:
    found = [(name, unit_of(name), float(getattr(bench.axis, name))) for name in bench.axis.NOMINAL]
    if not bench.axis.linear and "inertia_kg_m2" not in bench.axis.NOMINAL:
        found.insert(0, ("inertia at the motor", "kg m^2", inertia(bench)))
    rows = []
    for name, si, value in found:
        factor, unit = reading_unit(si, abs(value))
        rows.append((name, unit, digits(factor * value, 4)))
    page.heading("Parameters of the bench")
    page.text("No correction is told. Masses and inertia are those of all that moves, motor and screw included.")
    page.table(("parameter", "unit", "bench file"), rows, left=(0, 1))
