"""Layout for PlotJuggler 3: commanded, measured and twin of each quantity in one panel, over an exported file."""

from collections.abc import Collection
from pathlib import Path
from xml.etree import ElementTree as Xml

from hil.channels import AxisChannels
from hil.errors import InputError
from hil.exchange.mcap_file import TOPIC
from hil.files.output import write_text

# what PlotJuggler reads: its plugin, and how it is to read the file
_PLUGINS = {
    ".csv": ("DataLoad CSV", {"time_axis": "time_s", "delimiter": "0"}),
    ".mcap": (
        "DataLoad MCAP",
        {
            "use_timestamp": "0",
            "use_mcap_log_time": "1",
            "clamp_large_arrays": "0",
            "max_array_size": "500",
            "selected_topics": TOPIC,
        },
    ),
}
_COLOURS = ("#1f77b4", "#d62728", "#2ca02c")  # commanded, measured, twin


def layout_path(path: Path) -> Path:
    """Place of the layout of an exported file. Raises InputError for a format that PlotJuggler does not read."""
    if path.suffix.lower() not in _PLUGINS:
        raise InputError(
            f"{path}: given --plotjuggler with the ending {path.suffix!r}, allowed {', '.join(_PLUGINS)}, which "
            "PlotJuggler reads; correct it or leave it out"
        )
    return path.with_name(f"{path.stem}-layout.xml")


def write_layout(path: Path, axis: AxisChannels, recorded: Collection[str]) -> Path:
    """Write the layout beside the exported file `path`; return its place. Raises InputError where it cannot be."""
    ending = path.suffix.lower()
    panels = _panels(axis, recorded)
    root = Xml.Element("root")
    tabs = Xml.SubElement(root, "tabbed_widget", {"parent": "main_window", "name": "Main Window"})
    container = Xml.SubElement(Xml.SubElement(tabs, "Tab", containers="1", tab_name="axis"), "Container")
    sizes = ";".join(f"{1.0 / len(panels):.6f}" for _ in panels)
    splitter = Xml.SubElement(container, "DockSplitter", count=str(len(panels)), orientation="-", sizes=sizes)
    for title, curves in panels.items():
        plot = Xml.SubElement(
            Xml.SubElement(splitter, "DockArea", name=title), "plot", mode="TimeSeries", style="Lines"
        )
        for name, colour in curves.items():
            Xml.SubElement(plot, "curve", name=f"{TOPIC}/{name}" if ending == ".mcap" else name, color=colour)
    Xml.SubElement(tabs, "currentTabIndex", index="0")
    Xml.SubElement(root, "use_relative_time_offset", enabled="1")
    loaded = Xml.SubElement(
        Xml.SubElement(root, "previouslyLoaded_Datafiles"), "fileInfo", filename=path.name, prefix=""
    )
    plugin, parameters = _PLUGINS[ending]
    Xml.SubElement(Xml.SubElement(loaded, "plugin", ID=plugin), "parameters", parameters)
    Xml.indent(root)
    layout = layout_path(path)
    write_text(layout, f'<?xml version="1.0" encoding="UTF-8"?>\n{Xml.tostring(root, encoding="unicode")}\n')
    return layout


def _panels(axis: AxisChannels, recorded: Collection[str]) -> dict[str, dict[str, str]]:
    """Colour of each channel by panel; channels that are not recorded, and panels without any, are left out."""
    panels = {
        "table position": (axis.position_command, axis.table_position, f"twin_{axis.table_position}"),
        "motor position": ("", axis.motor_position, f"twin_{axis.motor_position}"),
        "velocity": (axis.velocity_command, axis.motor_velocity, ""),
        "torque": (axis.torque_command, axis.torque, f"twin_{axis.torque}"),
        "drive": ("", "drive_state", ""),
    }
    found = {
        title: {name: colour for name, colour in zip(names, _COLOURS, strict=True) if name in recorded}
        for title, names in panels.items()
    }
    return {title: curves for title, curves in found.items() if curves}
