"""Interactive plots (Bokeh) of the panels of the pictures, with a common time axis and zoom."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.layouts import gridplot
from bokeh.models import BoxAnnotation, ColumnDataSource, CrosshairTool, HoverTool, Range1d, Span
from bokeh.plotting import figure

from hil.arrays import FloatArray
from hil.figures.panels import NOISE, Panel, thin

DRAWN_ROWS = 6_000  # of a panel: several per pixel, and a page of 16 panels stays below 3 MB


def over_time(time_s: FloatArray, panels: Sequence[Panel], heights: Sequence[int] = ()) -> Any:
    """Plot panels one above the other with a common time axis (n,) [s], toolbar and crosshair."""
    shared = Range1d(float(time_s[0]), float(time_s[-1]), bounds=(float(time_s[0]), float(time_s[-1])))
    line = Span(dimension="height", line_color=NOISE, line_dash="dotted")
    cursor = CrosshairTool(overlay=line, dimensions="height")
    plots = []
    for index, panel in enumerate(panels):
        last = index == len(panels) - 1
        height = heights[index] if heights else 175
        plots.append(_panel(time_s, panel, shared, cursor, height + 40 * last + 26 * (index == 0), last))
    legend = plots[0].legend[0]
    legend.orientation, legend.padding, legend.border_line_alpha = "horizontal", 2, 0.0
    plots[0].add_layout(legend, "above")  # inside, it would hide lines
    for plot in plots[1:]:
        plot.legend.visible = False
    return gridplot(
        [[plot] for plot in plots],
        merge_tools=True,
        sizing_mode="stretch_width",
        toolbar_location="right",
        toolbar_options={"logo": None},
    )


def _drawn(values: FloatArray) -> Any:
    """Values (n,) in single precision; gaps where they are not finite or beyond its range."""
    inside = np.abs(values) < np.finfo(np.float32).max  # False for values that are not a number
    return np.where(inside, values, np.nan).astype(np.float32)


def _panel(time_s: FloatArray, panel: Panel, shared: Range1d, cursor: CrosshairTool, height: int, last: bool) -> Any:
    factor, unit = panel.shown()
    chosen = thin(tuple(line.values for line in panel.lines), DRAWN_ROWS)
    data = {"time_s": time_s[chosen].astype(np.float32)}
    data |= {f"y{i}": _drawn(line.values[chosen] * factor) for i, line in enumerate(panel.lines)}
    source = ColumnDataSource(data)
    plot = figure(
        height=height,
        x_range=shared,
        tools="xpan,xwheel_zoom,box_zoom,reset,save",
        active_scroll="xwheel_zoom",
        y_axis_label=f"{panel.label} [{unit}]",
        x_axis_label="time [s]" if last else None,
    )
    if panel.band > 0.0:
        plot.add_layout(
            BoxAnnotation(
                bottom=-panel.band * factor,
                top=panel.band * factor,
                fill_color=NOISE,
                fill_alpha=0.35,
                level="underlay",
            )
        )
    drawn = []
    for i, line in enumerate(panel.lines):
        look = {"line_width": 3.2, "line_alpha": 0.5} if line.broad else {"line_width": 1.1}
        drawn.append(plot.line("time_s", f"y{i}", source=source, color=line.colour, legend_label=line.label, **look))
    tips = [("time", "@time_s{0.0000} s")]
    tips += [(line.label, f"@y{i}{{0.0000}} {unit}") for i, line in enumerate(panel.lines)]
    plot.add_tools(cursor, HoverTool(renderers=drawn[:1], tooltips=tips, mode="vline"))
    plot.xaxis.major_label_text_font_size = "12px" if last else "0px"
    plot.yaxis.axis_label_text_font_style = "normal"
    plot.yaxis.axis_label_text_font_size = "12px"
    plot.xaxis.axis_label_text_font_style = "normal"
    plot.min_border_left = 80
    return plot
