"""Report of `hil compare`: page, pictures, numbers, and the bench with fitted parameters."""

import math
from pathlib import Path

from hil.bench.axis_models import OneMass
from hil.bench.bench_file import Bench
from hil.files.optional_library import missing_of
from hil.files.output import write_json, write_text
from hil.identification.compare import Comparison
from hil.identification.figures import block_panels, motion_panels
from hil.identification.inverse_dynamics import InverseDynamics
from hil.identification.nominal_fit import FitResult
from hil.identification.terms import ambiguous
from hil.identification.twin_deviation import BlockDeviation, Deviation
from hil.quantities import change, digits, percent, quantity, with_error
from hil.report.page import Page

PARAMETER_HEADERS = ("parameter", "bench file", "fitted", "standard error", "change")


def write_comparison(result: Comparison, folder: Path) -> None:
    """Write compare.json and, after a fit, bench.fitted.yaml.

    With the libraries of the extra `report` also compare.html, overview.png, move.png and blocks.png.
    """
    write_json(folder / "compare.json", result.as_json())
    if result.fit is not None:
        write_bench(result.bench, folder / "bench.fitted.yaml")
    if not missing_of("report"):
        _write_page(result, folder)


def _write_page(result: Comparison, folder: Path) -> None:
    from hil.figures.drawing import save
    from hil.report import plots

    time_s = result.measured.time_s
    page = Page(f"{result.recording.name} against its twin", _lead(result), result.statement, result.explained)
    if result.held:
        page.heading("Measured and simulated")
        page.text(
            "The twin is simulated in closed loop from the set-points of the recording. Deviation: measured - "
            "simulated; relative: rms of the deviation / rms of the measured channel."
        )
        page.table(("channel", "rms deviation", "largest deviation", "relative"), rows_of(result))
        page.plot(plots.over_time(time_s, motion_panels(result)))
    page.heading("Block by block")
    page.text("The input of each block is the measured one, so that its deviation is not that of another block.")
    page.table(
        ("block", "input", "output", "rms deviation", "largest deviation", "relative", "rms / noise"),
        [_block_row(block) for block in result.blocks],
        left=(0, 1, 2),
    )
    page.plot(plots.over_time(time_s, block_panels(result), [150, 120] * len(result.blocks)))
    if result.fit is not None:
        _fit(page, result.fit)
    if result.inverse_dynamics is not None:
        _inverse_dynamics(page, result, result.inverse_dynamics)
    page.heading("One move")
    save(result.plot(), folder / "overview.png")
    page.picture(
        save(result.plot(fastest_move=True), folder / "move.png"),
        "The fastest move of the recording (move.png); overview.png shows the whole recording.",
    )
    save(result.plot(blocks=True), folder / "blocks.png")
    page.heading("How it was computed")
    page.items(
        [*result.notes, *(f"{block.deviation.name}: {block.remark}." for block in result.blocks if block.remark)]
    )
    page.write(folder / "compare.html")


def rows_of(result: Comparison) -> list[tuple[str, ...]]:
    """Rows of the table: channel, or block of an unstable twin, with rms, largest and relative deviation."""
    blocks = ((block.deviation.name, block.deviation) for block in result.blocks)
    shown = ((channel.label, channel) for channel in result.channels) if result.held else blocks
    return [(name, *_figures(deviation)) for name, deviation in shown]


def parameter_rows(fit: FitResult) -> list[tuple[str, ...]]:
    """Rows of the table of fitted parameters with `PARAMETER_HEADERS`."""
    return [
        (one.name, *fitted_cells(one.nominal, one.value, math.inf if one.at_bound else one.standard_error))
        for one in fit.parameters
    ]


def fitted_cells(nominal: float, value: float, error: float) -> tuple[str, str, str, str]:
    """Cells of a fitted value: bench file, fitted, standard error (infinite: at its bound), change."""
    shown, of_error = (digits(value, 4), "at its bound") if math.isinf(error) else with_error(value, error)
    return digits(nominal, 4), shown, of_error, change(value, nominal)


def write_bench(bench: Bench, path: Path) -> None:
    """Write a bench as the YAML file that `load_bench` reads."""
    write_text(path, bench_text(bench))


def bench_text(bench: Bench) -> str:
    """Text of a bench file, without what is as by default."""
    import yaml

    data = bench.model_dump(mode="json", exclude_defaults=True)
    data["schema_version"] = bench.schema_version
    data["axis"]["model"] = bench.axis.model
    return str(yaml.safe_dump(data, sort_keys=False, allow_unicode=True))


def _lead(result: Comparison) -> str:
    seconds = len(result.recording) * result.recording.period_s
    parameters = "parameters fitted to this recording" if result.fit else "parameters of the bench file"
    mechanisms = ", ".join(entry.effect for entry in result.bench.mechanisms)
    return (
        f"{seconds:.1f} s at {digits(1.0 / result.recording.period_s)} Hz · bench {result.bench.name} "
        f"({result.bench.axis.model}{f', with {mechanisms}' if mechanisms else ''}) · {parameters}"
    )


def _figures(deviation: Deviation) -> tuple[str, str, str]:
    """Cells of rms, largest and relative deviation."""
    unit = deviation.unit
    return quantity(deviation.rms, unit), quantity(deviation.peak, unit), percent(deviation.relative)


def _block_row(block: BlockDeviation) -> tuple[str, ...]:
    deviation = block.deviation
    over_noise = digits(deviation.rms / block.noise) if block.noise > 0.0 else "–"
    return deviation.name, block.inputs, deviation.label, *_figures(deviation), over_noise


def _fit(page: Page, fit: FitResult) -> None:
    page.heading("Fitted parameters")
    page.table(PARAMETER_HEADERS, parameter_rows(fit))
    page.text(
        "Fitted block by block as in hil diagnose, within a factor of three of the bench file, and in no channel worse "
        "than it. Standard errors count what the model leaves, with its correlation; a parameter at its bound is not "
        "identifiable from this motion. bench.fitted.yaml holds the bench with these values."
    )


def _inverse_dynamics(page: Page, result: Comparison, fit: InverseDynamics) -> None:
    axis = result.bench.axis
    assert isinstance(axis, OneMass)
    page.heading("Inverse-dynamics fit")
    page.text(
        "Least-squares fit of the force to the measured motion, F = M a + Fv v + Fc sign(v) + F0; relative error "
        f"{percent(fit.relative_error)}."
    )
    known = [entry.active() for entry in result.bench.mechanisms]
    offset = next((one.values[0] for one in known if ambiguous(one)), 0.0)
    rows = (
        ("mass M", "kg", fit.inertia, fit.inertia_std_error, axis.mass_kg),
        ("viscous friction Fv", "N s/m", fit.viscous, fit.viscous_std_error, axis.viscous_force_n_s_m),
        ("Coulomb friction Fc", "N", fit.coulomb, fit.coulomb_std_error, axis.coulomb_force_n),
        ("offset F0", "N", fit.offset, fit.offset_std_error, offset),
    )
    page.table(
        ("parameter", "unit", "value", "standard error", "bench file"),
        [(*names, digits(value, 5), digits(error, 2), digits(nominal, 5)) for *names, value, error, nominal in rows],
        left=(0, 1),
    )
