"""Matplotlib figures in the style of every report. Matplotlib is loaded when this module is."""

from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.figures.panels import NOISE, Panel, thin

WIDTH_IN = 7.4  # of a picture: its letters are as large as those of a page of 700 px
DRAWN_ROWS = 6000  # of a line: several per column of pixels
PAGE_DPI, NOTEBOOK_DPI = 140, 100


class Drawing(Figure):
    """A matplotlib figure that a notebook shows where it is the value of a cell, without pyplot and its state."""

    def __init__(self, width_in: float, height_in: float) -> None:
        super().__init__(figsize=(width_in, height_in), layout="constrained")

    def _repr_png_(self) -> bytes:
        return self.png(NOTEBOOK_DPI)

    def png(self, dpi: float) -> bytes:
        """The figure as a PNG file."""
        file = BytesIO()
        self.savefig(file, format="png", dpi=dpi)
        return file.getvalue()


def over_time(title: str, time_s: FloatArray, panels: Sequence[Panel], rows: slice = slice(None)) -> Drawing:
    """Draw panels one above the other over a common time axis (n,) [s], restricted to `rows`."""
    figure = Drawing(WIDTH_IN, 0.8 + 1.75 * len(panels))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    time_s = time_s[rows]
    for axis, panel in zip(axes, panels, strict=True):
        lines = [line.values[rows] for line in panel.lines]
        chosen = thin(lines, DRAWN_ROWS)
        factor, unit = panel.shown(rows)
        if panel.band > 0.0:
            band = panel.band * factor
            axis.axhspan(-band, band, color=NOISE, alpha=0.35, label="noise, ±1 σ")
        for line, values in zip(panel.lines, lines, strict=True):
            width, alpha = (2.6, 0.5) if line.broad else (0.9, 1.0)
            axis.plot(
                time_s[chosen],
                values[chosen] * factor,
                color=line.colour,
                label=line.label,
                linewidth=width,
                alpha=alpha,
            )
        style_axis(axis, f"{panel.label}\n[{unit}]")
    axes[0].set_title(title, loc="left")
    legend_outside(figure, axes)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(time_s[0], time_s[-1])
    figure.align_ylabels(axes)
    return figure


def style_axis(axis: Axes, label: str, x_label: str | None = None, title: str | None = None) -> None:
    """Set labels, title and grid of an axis."""
    axis.set_ylabel(label)
    if x_label is not None:
        axis.set_xlabel(x_label)
    if title is not None:
        axis.set_title(title, loc="left")
    axis.grid(alpha=0.3)
    axis.margins(y=0.12)


def legend_above(axis: Axes) -> None:
    """Put the legend above an axis, where it hides no line."""
    axis.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=4,
        frameon=False,
        borderaxespad=0.2,
        columnspacing=1.2,
        handletextpad=0.5,
        handlelength=1.6,
    )


def legend_outside(figure: Figure, axes: Iterable[Axes], columns: int = 4) -> None:
    """Put one legend above all axes of a figure, each label once."""
    labelled = [axis.get_legend_handles_labels() for axis in axes]
    known = {label: handle for handles, labels in labelled for handle, label in zip(handles, labels, strict=True)}
    figure.legend(
        known.values(),
        known.keys(),
        loc="outside upper center",
        ncols=columns,
        frameon=False,
        columnspacing=1.2,
        handletextpad=0.5,
        handlelength=1.6,
    )


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG and return the path."""
    figure.savefig(path, dpi=PAGE_DPI)
    return path
