"""Page of a tried compensation: errors of each motion before, predicted and after."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.compensating.loop_tuning import HEADERS as MARGINS
from hil.compensating.loop_tuning import UNCHANGED, margin_rows
from hil.compensating.trial import Trial, error_series, rms
from hil.control.compensation_tables import Adds
from hil.figures.panels import COMMAND, MEASURED
from hil.files.optional_library import missing_of
from hil.files.output import write_json
from hil.quantities import quantity, reading_unit
from hil.report.page import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hil.arrays import FloatArray
    from hil.bench.bench_file import Bench

SCHEMA_VERSION = 1
HEADERS = ("motion", "error, rms", "before", "repeated", "predicted", "range", "after", "before / after")
_NAMES = {Adds.TORQUE: "following", Adds.POSITION: "positioning"}


def rows_of(trial: Trial) -> list[list[str]]:
    """Rows of the table: each motion and each kind of error."""
    rows, unit = [], trial.unit
    for motion in trial.motions:
        for adds, name in _NAMES.items():
            first, second = (one.of(adds) for one in motion.before)
            low, high = (motion.predicted.before.of(adds) * share for share in motion.predicted.interval(adds))
            values = [first, second, motion.predicted.after.of(adds)]
            told = [quantity(one, unit) for one in values]
            after = motion.after.of(adds)
            spread = f"{quantity(low, unit)} to {quantity(high, unit)}"
            ratio = f"{rms([first, second]) / after:.2f}" if after else "–"
            rows.append([motion.name, name, *told, spread, quantity(after, unit), ratio])
    return rows


def write_trial(trial: Trial, bench: Bench, folder: Path) -> None:
    """Write compensation.json, and with the libraries of the extra `report` compensation.html and its picture."""
    numbers = [
        {
            "motion": motion.name,
            **{
                f"{name}_m": {
                    "before": [one.of(adds) for one in motion.before],
                    "predicted_before": motion.predicted.before.of(adds),
                    "predicted": motion.predicted.after.of(adds),
                    "predicted_share": list(motion.predicted.interval(adds)),
                    "after": motion.after.of(adds),
                }
                for adds, name in _NAMES.items()
            },
        }
        for motion in trial.motions
    ]
    kept = [table.name for table in trial.plan.compensation.tables] if trial.section else []
    left_out = [{"name": name, "reason": reason} for name, reason in trial.left_out]
    told = {"statement": trial.statement, "kept": kept, "left_out": left_out, "motions": numbers}
    write_json(folder / "compensation.json", {"schema_version": SCHEMA_VERSION, **told})
    if not missing_of("report"):
        _page(trial, bench, folder)


def _page(trial: Trial, bench: Bench, folder: Path) -> None:
    from hil.figures.drawing import save

    page = Page(f"Compensation of {bench.name}", "before, predicted, after", trial.statement, bool(trial.section))
    if trial.motions:
        page.table(HEADERS, rows_of(trial), left=(0, 1))
        page.picture(
            save(draw(trial, bench), folder / "compensation.png"),
            "Errors of each motion over time, before and after; rows in which the compensation fades in are left out.",
        )
    if trial.section:
        page.heading("Kept")
        units = {Adds.TORQUE: bench.axis.drive_unit, Adds.POSITION: trial.unit}
        sources = trial.plan.derived.sources
        page.table(
            ("table", "from", "largest value"),
            [
                [one.name, ", ".join(sources[one.name]), quantity(_largest(one.forward, one.backward), units[one.adds])]
                for one in trial.plan.compensation.tables
            ],
            left=(0, 1),
        )
    if trial.margins:
        page.heading("Stability")
        page.table(MARGINS, margin_rows([trial.margins], bench.axis.drive_unit), left=(0, 1, 2))
        page.items([UNCHANGED])
    if trial.left_out:
        page.heading("Left out")
        page.items([f"{name}: {reason}" for name, reason in trial.left_out])
    page.write(folder / "compensation.html")


def draw(trial: Trial, bench: Bench) -> Figure:
    """Draw both errors of each motion over time, before and after."""
    from matplotlib.figure import Figure

    from hil.figures.drawing import WIDTH_IN, legend_outside, style_axis

    figure = Figure(figsize=(WIDTH_IN, 0.8 + 2.1 * 2 * len(trial.motions)), layout="constrained")
    axes = figure.subplots(2 * len(trial.motions), 1, squeeze=False)[:, 0]
    for number, motion in enumerate(trial.motions):
        series = [error_series(one, bench, trial.fade_in_s) for one in motion.recordings]
        for kind, name in enumerate(_NAMES.values()):
            axis = axes[2 * number + kind]
            largest = max(float(np.abs(one[1 + kind]).max()) for one in series)
            small = reading_unit(trial.unit, largest)
            for (time_s, *errors), label, colour in zip(series, ("before", "after"), (COMMAND, MEASURED), strict=True):
                axis.plot(time_s, small.factor * errors[kind], color=colour, linewidth=0.9, label=label)
            style_axis(axis, f"{name} error [{small.unit}]", title=motion.name if kind == 0 else "")
        axes[2 * number + 1].set_xlabel("time [s]")
    legend_outside(figure, axes[:1], columns=2)
    return figure


def _largest(*columns: FloatArray) -> float:
    return max(float(np.abs(one).max()) for one in columns)
