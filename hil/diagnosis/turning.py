"""Words and units for a load that turns: the channels of the table hold its angle [rad] and torque [N m]."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.figures.drawing import Drawing

_WORDS = {
    "ball screw, nut and linear encoder": "gear, coupling and load encoder",
    "linear encoder": "load encoder",
    "ball nut and thrust bearing": "gear or coupling",
    "ball nut and screw": "gear and bearings",
    "gear, ball nut or worm": "gear or worm",
    "ball nut": "gear",
    "nut": "gear",
    "ball screw": "gear",
    "screw grows": "ratio of the encoders grows",
    "of its length": "of its value",
    "a length": "an angle",
    "lead": "transmission",
    "table": "load",
    "Table": "Load",
    "guideways": "bearings",
    "screw": "motor",
    "metre": "radian",
    "mm": "mrad",
    "µm": "µrad",
    "force": "torque",
    "forces": "torques",
    "Force": "Torque",
    "[N]": "[N m]",
    "m/s²": "rad/s²",
}
_ANY = re.compile(rf"(?<![\w/])({'|'.join(map(re.escape, _WORDS))})(?![\w/])")


def of_load(text: str, turns: bool) -> str:
    """The text in the words of a load that turns, if it does."""
    return _ANY.sub(lambda match: _WORDS[match[1]], text) if turns else text


def speed_unit(turns: bool) -> tuple[float, str]:
    """Factor and unit in which speeds of the table [m/s], or of a load that turns [rad/s], are read."""
    return (1.0, "rad/s") if turns else (60.0, "m/min")


def labelled(figure: Drawing, turns: bool) -> Drawing:
    """The figure with titles and labels in the words of a load that turns, if it does."""
    for axis in figure.axes if turns else ():
        axis.set_title(of_load(axis.get_title(loc="left"), turns), loc="left")
        axis.set_xlabel(of_load(axis.get_xlabel(), turns))
        axis.set_ylabel(of_load(axis.get_ylabel(), turns))
    return figure
