"""Pictures (PNG): stacked panels over time, measured and simulated, in the look of every report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.report import style
from hil.report.style import shown, thin

DRAWN_ROWS = 6000  # of a line in a picture: more than a picture has columns


@dataclass(frozen=True, eq=False)
class Line:
    """A line (n,) of a panel in SI units."""

    label: str
    values: FloatArray
    colour: str
    broad: bool = False  # lies under another line that may hide it


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines that share an axis; `unit` is their SI unit. `band` draws +- this value (1 sigma of noise) in grey."""

    label: str
    unit: str
    lines: tuple[Line, ...]
    band: float = 0.0

    @property
    def shown(self) -> style.Shown:
        """How values are shown; one unit for the panel."""
        return shown(self.unit, max(float(abs(line.values).max()) for line in self.lines))


def over_time(title: str, time_s: FloatArray, panels: Sequence[Panel], rows: slice = slice(None)) -> Figure:
    """Panels one above the other over a common time axis, of the rows given."""
    figure = Figure(figsize=(10.0, 0.8 + 1.75 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    time_s = time_s[rows]
    for axis, panel in zip(axes, panels, strict=True):
        lines = [line.values[rows] for line in panel.lines]
        chosen = thin(tuple(lines), DRAWN_ROWS)
        unit = shown(panel.unit, max(float(abs(values).max()) for values in lines))
        if panel.band > 0.0:
            axis.axhspan(
                -panel.band * unit.factor, panel.band * unit.factor, color=style.NOISE, alpha=0.35, label="noise, ±1 σ"
            )
        for line, values in zip(panel.lines, lines, strict=True):
            axis.plot(
                time_s[chosen],
                values[chosen] * unit.factor,
                color=line.colour,
                label=line.label,
                linewidth=2.6 if line.broad else 0.9,
                alpha=0.5 if line.broad else 1.0,
            )
        style_axis(axis, f"{panel.label}\n[{unit.unit}]")
    axes[0].set_title(title, loc="left")
    # above the first panel: inside, it would hide a line sooner or later
    labelled = [axis.get_legend_handles_labels() for axis in axes]
    known = {label: handle for handles, labels in labelled for handle, label in zip(handles, labels, strict=True)}
    axes[0].legend(
        handles=list(known.values()),
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=3,
        frameon=False,
        borderaxespad=0.2,
    )
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(time_s[0], time_s[-1])
    figure.align_ylabels(axes)
    return figure


def style_axis(axis: Axes, label: str) -> None:
    """Label and grid of an axis."""
    axis.set_ylabel(label)
    axis.grid(alpha=0.3)
    axis.margins(y=0.12)


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG; the path."""
    figure.savefig(path, dpi=110)
    return path
