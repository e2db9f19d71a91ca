"""Pictures of a proof: power over size, confusion matrix, calibration, parameter errors, times."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.diagnosis.wording import title
from hil.figures import panels as style
from hil.figures.drawing import legend_above, style_axis
from hil.validation.proof.score.scores import Scores
from hil.validation.proof.score.statistics import Counts, Rate, confusion, power, rate

_ERRORS = (0.03, 0.10)  # goals of the median and of the 90th percentile
_LEAST_ERROR = 1e-5  # smallest error drawn; smaller ones are drawn here


def power_figure(scores: Scores) -> Figure | None:
    """Draw detection and naming over the size of an effect; None without a ladder."""
    rungs = power(scores.cases)
    if not rungs:
        return None
    figure, axes = _one_axis(9.0, 4.6)
    size = np.array([rung.size for rung in rungs])
    for label, rates, colour, shift in (
        ("detected", [rung.detected for rung in rungs], style.MEASURED, 0.985),
        ("named first", [rung.named for rung in rungs], style.SIMULATED, 1.015),
    ):
        _rates(axes, size * shift, rates, colour, label)
    axes.axvline(1.0, color=style.NOISE, linestyle="dashed", label="noise floor")
    alarms = rate(case.detected for case in scores.of_tier("null", "parameters_only")).value
    if alarms is not None:
        axes.axhline(alarms, color=style.NOISE, linestyle="dotted", label="false alarms without an effect")
    axes.set_xscale("log")
    axes.set_xticks(size, [f"{value:g}" for value in size])
    axes.minorticks_off()
    size_label = "size of the concealed effect, in units of the noise (rms of the strongest channel)"
    style_axis(axes, "share of the cases", size_label, "Power: how large an effect must be")
    axes.set_ylim(-0.03, 1.03)
    legend_above(axes)
    return figure


def confusion_figure(scores: Scores) -> Figure | None:
    """Draw the confusion matrix; None without cases."""
    counts = confusion(scores.cases)
    if not counts:
        return None
    columns = _columns(counts)
    shares = np.array(
        [[counts[row].get(column, 0) / sum(counts[row].values()) for column in columns] for row in counts]
    )
    figure, axes = _one_axis(3.6 + 0.31 * len(columns), 2.6 + 0.29 * len(counts))
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    axes.set_xticks(np.arange(len(columns)) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(counts)) - 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=0.8)
    axes.tick_params(which="minor", length=0)
    for y, row in enumerate(counts):
        for x, column in enumerate(columns):
            if number := counts[row].get(column, 0):
                colour = "white" if shares[y, x] > 0.6 else "black"
                axes.text(x, y, str(number), ha="center", va="center", fontsize=8, color=colour)
    slanted: dict[str, Any] = {"rotation": 60, "ha": "right", "rotation_mode": "anchor", "fontsize": 8}
    axes.set_xticks(range(len(columns)), [title(name) for name in columns], **slanted)
    axes.set_yticks(range(len(counts)), [title(name) for name in counts], fontsize=8)
    axes.set_xlabel("named first, or the verdict without a name")
    axes.set_ylabel("concealed")
    axes.set_title("Confusion of names (cases)", loc="left")
    return figure


def calibration_figure(scores: Scores) -> Figure | None:
    """Draw accuracy over confidence; None without findings."""
    if not scores.calibration:
        return None
    figure, axes = _one_axis(5.6, 5.2)
    axes.plot([0.0, 1.0], [0.0, 1.0], color=style.NOISE, linestyle="dashed", label="calibrated")
    confidence = np.array([found.confidence for found in scores.calibration])
    _rates(axes, confidence, [found.right for found in scores.calibration], style.MEASURED, "findings")
    for found in scores.calibration:
        at = found.confidence, found.right.value or 0.0
        axes.annotate(str(found.right.of), at, (6, -9), textcoords="offset points", fontsize=8, color=style.COMMAND)
    style_axis(axes, "share that is right", "confidence", "Right findings (number: of so many)")
    axes.set_xlim(-0.02, 1.08)
    axes.set_ylim(-0.06, 1.04)
    axes.legend(loc="lower right")
    return figure


def errors_figure(scores: Scores) -> Figure | None:
    """Draw errors of the parameters of rightly named single effects; None without any."""
    errors: dict[str, list[float]] = {}
    for case in scores.of_tier("single"):
        if case.concealed and case.parameter_errors():
            errors.setdefault(case.concealed.effect, []).extend(case.parameter_errors().values())
    if not errors:
        return None
    names = sorted(errors, key=lambda name: -float(np.median(errors[name])))
    figure, axes = _one_axis(9.0, 1.4 + 0.27 * len(names))
    for y, name in enumerate(names):
        values = np.maximum(errors[name], _LEAST_ERROR)
        axes.plot(values, np.full(values.size, y), "o", color=style.MEASURED, alpha=0.5, markersize=4)
        axes.plot([np.median(values)], [y], "|", color=style.DEVIATION, markersize=14, markeredgewidth=2)
    for goal, text, line in zip(_ERRORS, ("median", "90th percentile"), ("dashed", "dotted"), strict=True):
        axes.axvline(goal, color=style.COMMAND, linestyle=line, label=f"goal, {text}: {100 * goal:g} %")
    legend_above(axes)
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), [title(name) for name in names], fontsize=8)
    error_label = "relative error of a parameter (bar: median of the effect)"
    style_axis(axes, "", error_label, "Parameters of effects that were rightly named")
    axes.set_ylim(-0.7, len(names) - 0.3)
    return figure


def times_figure(scores: Scores) -> Figure | None:
    """Draw a histogram of the times of a diagnosis; None without any."""
    times = [case.answer.runtime_s for case in scores.cases if case.answer.runtime_s is not None]
    if not times:
        return None
    figure, axes = _one_axis(9.0, 3.4)
    axes.hist(times, bins=min(40, 4 + len(times) // 3), color=style.MEASURED, alpha=0.8)
    for part, text in ((0.5, "median"), (0.9, "90 %")):
        value = float(np.quantile(times, part))
        axes.axvline(value, color=style.SIMULATED, linestyle="dashed")
        axes.text(value, 0.97, f" {text} {value:.0f} s", transform=axes.get_xaxis_transform(), va="top", fontsize=8)
    style_axis(axes, "cases", "time of a diagnosis [s]", "Time")
    return figure


def _one_axis(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots()


def _rates(axes: Axes, at: FloatArray, rates: Sequence[Rate], colour: str, label: str) -> None:
    """Draw rates with their 95 % intervals."""
    values = np.array([found.value or 0.0 for found in rates])
    low, high = np.array([found.interval for found in rates]).T
    line: dict[str, Any] = {"capsize": 3, "linewidth": 1.2, "elinewidth": 0.8, "markersize": 5}
    axes.errorbar(at, values, (values - low, high - values), fmt="o-", color=colour, label=label, **line)


def _columns(counts: Counts) -> list[str]:
    """Return the answers in the order of the rows, then the others."""
    said = {column for row in counts.values() for column in row}
    return [row for row in counts if row in said] + sorted(said - set(counts))
