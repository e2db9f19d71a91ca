"""Circular tests of two axes by ISO 230-4: `circular_accuracy`.

    G     circular deviation: width of the narrowest ring that holds the path of one sense
    G(b)  bidirectional circular deviation: of the ring that holds both paths
    F     radial deviation: distance of the path from the least-squares centre, less the nominal radius; greatest, least
    D     mean bidirectional radial deviation: radius of the least-squares circle of both paths less the nominal one

A quadrant spike is the largest radial deviation from 0 to 15 degrees after an axis has turned, less the line between
the means from 15 to 5 degrees before and from 15 to 25 degrees after it; outwards is positive.

Source: ISO 230-4:2005, clause 3. The quadrant spike is no figure of the standard.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import FloatArray
from hil.positioning.circle_fit import least_squares_circle, narrowest_ring
from hil.positioning.paths import CircularPath, circular_paths
from hil.quantities import quantity
from hil.recording.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUADRANTS_DEG = (0, 90, 180, 270)  # 0 and 180: the first axis turns; 90 and 270: the second


@dataclass(frozen=True, eq=False)
class CircularAccuracy:
    """Figures of ISO 230-4 of two axes [m].

    `paths` maps the sense (1 anticlockwise, -1 clockwise) to its turn. `figures` maps "circular_SENSE_m" (G),
    "circular_bidirectional_m" (G(b)), "radial_greatest_SENSE_m" and "radial_least_SENSE_m" (F), "mean_radial_m" (D) to
    their values; what needs both senses is there only with both. `spikes_m`: sense -> degrees -> spike. Printing it
    gives the figures; `plot` draws the radial deviations over the angle.
    """

    x_name: str
    y_name: str
    paths: Mapping[int, CircularPath]

    @property
    def radius_m(self) -> float:
        """Commanded radius."""
        return next(iter(self.paths.values())).radius_m

    @property
    def feed_m_s(self) -> float:
        """Commanded feed along the path."""
        return next(iter(self.paths.values())).feed_m_s

    @cached_property
    def figures(self) -> Mapping[str, float]:
        """The figures by their names [m]."""
        found = dict[str, float]()
        for path in self.paths.values():
            found[f"circular_{path.name}_m"] = narrowest_ring(path.x_m, path.y_m).width_m
        if len(self.paths) == 2:
            x, y = (np.concatenate([getattr(path, one) for path in self.paths.values()]) for one in ("x_m", "y_m"))
            found["circular_bidirectional_m"] = narrowest_ring(x, y).width_m
        for path in self.paths.values():
            radial = radial_deviation(path)
            found[f"radial_greatest_{path.name}_m"] = float(radial.max())
            found[f"radial_least_{path.name}_m"] = float(radial.min())
        if len(self.paths) == 2:
            found["mean_radial_m"] = least_squares_circle(x, y).radius_m - self.radius_m
        return found

    @cached_property
    def spikes_m(self) -> Mapping[int, Mapping[int, float]]:
        """Quadrant spikes: sense -> angle [degrees] -> spike [m]."""
        return {sense: {at: _spike(path, at) for at in QUADRANTS_DEG} for sense, path in self.paths.items()}

    @property
    def verdict(self) -> str:
        """The largest circular deviation and the largest spike in a sentence."""
        name = "circular_bidirectional_m" if len(self.paths) == 2 else next(iter(self.figures))
        spike, at, path = max(
            ((abs(value), at, self.paths[sense]) for sense, one in self.spikes_m.items() for at, value in one.items()),
            key=lambda one: one[0],
        )
        what = "Bidirectional circular deviation G(b)" if len(self.paths) == 2 else "Circular deviation G"
        return (
            f"{what} {quantity(self.figures[name], 'm')} at a radius of {quantity(self.radius_m, 'm')} and "
            f"{quantity(self.feed_m_s, 'm/s')}; largest quadrant spike {quantity(spike, 'm')} at {at}°, {path.name}."
        )

    def __str__(self) -> str:
        titled = [(*title_of(name), quantity(value, "m")) for name, value in self.figures.items()]
        rows = [f"  {symbol:4} {meaning:40} {value:>12}" for symbol, meaning, value in titled]
        return "\n".join([f"Circle of {self.x_name} and {self.y_name} (ISO 230-4): {self.verdict}", *rows])

    __repr__ = __str__

    def plot(self) -> "Figure":
        """Draw the paths with their radial deviation enlarged, and the deviation over the angle."""
        from hil.positioning.circle_picture import draw_circle

        return draw_circle(self)


def circular_accuracy(x: Recording, y: Recording) -> CircularAccuracy:
    """Compute the figures of ISO 230-4 of two axes that go along a circle together.

    x, y: recordings of the first and second axis from one moment on, at one rate, with linear encoders and set-points
    that make a circle together, such as profiles/circle_x.yaml and profiles/circle_y.yaml. Of each sense the last whole
    turn counts.

    Returns the figures in m. Raises InputError for other rates, without linear encoders, or without a whole turn.
    Source: ISO 230-4:2005.
    """
    return CircularAccuracy(x.name, y.name, circular_paths(x, y))


def title_of(name: str) -> tuple[str, str]:
    """Symbol and meaning of a figure by its name."""
    what, _, rest = name.removesuffix("_m").partition("_")
    if name == "mean_radial_m":
        return "D", "mean bidirectional radial deviation"
    if what == "circular":
        both = rest == "bidirectional"
        return ("G(b)", "bidirectional circular deviation") if both else ("G", f"circular deviation, {rest}")
    which, _, sense = rest.partition("_")
    return "F", f"{which} radial deviation, {sense}"


def radial_deviation(path: CircularPath) -> FloatArray:
    """Radial deviation (n,) of a path about its least-squares centre, from the nominal radius [m]."""
    centre = least_squares_circle(path.x_m, path.y_m)
    return np.asarray(np.hypot(path.x_m - centre.x_m, path.y_m - centre.y_m) - path.radius_m)


def _spike(path: CircularPath, at_deg: int) -> float:
    radial, away = radial_deviation(path), path.sense * (np.degrees(path.angle_rad) - at_deg)
    away = (away + 180.0) % 360.0 - 180.0  # after the axis has turned: positive
    before, after = (radial[(away >= low) & (away < high)].mean() for low, high in ((-15.0, -5.0), (15.0, 25.0)))
    within = (away >= 0.0) & (away < 15.0)
    rest = radial[within] - np.interp(away[within], [-10.0, 20.0], [before, after])
    return float(rest[np.argmax(np.abs(rest))])
