"""Data of the figure of a finding: residuals without the finding's term, and the part that the term models."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.diagnosis.location.residual_energy import without_terms
from hil.diagnosis.search.disturbance import Disturbance, disturbance
from hil.figures.panels import COMMAND, MEASURED, SIMULATED
from hil.identification.measured import Measured
from hil.identification.residual_scales import inertia
from hil.identification.terms import Term

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

BIN_SAMPLES_MIN = 8  # samples of a drawn bin: quartiles of fewer have a large variance
CHANNEL_LABELS = {
    "motor": "torque on the motor",
    "table": "table - motor position",
    "torque": "torque",
    "command": "command",
}


class Captioned(NamedTuple):
    """A figure and its caption."""

    figure: Figure
    caption: str


@dataclass(frozen=True, eq=False)
class View:
    """A run beside the final twin with one term switched off."""

    term: Term
    run: Measured
    before: dict[str, FloatArray]  # residuals (n,) of the twin without the term, by channel
    after: dict[str, FloatArray]  # those (n,) of the final twin
    torque: Disturbance  # the motor's residual before as a torque on the motor
    torque_after: Disturbance

    def residuals(self, channel: str) -> tuple[FloatArray, FloatArray]:
        """Residuals (n,) before and after; those of the motor as the torque that causes them."""
        if channel == "motor":
            return self.torque.torque, self.torque_after.torque
        return self.before[channel], self.after[channel]

    @property
    def strongest(self) -> str:
        """Channel in which the term is largest against the noise."""
        size = {
            name: float(np.sqrt(np.mean((values - self.after[name])[self.run.evaluated] ** 2))) / noise(self.run, name)
            for name, values in self.before.items()
        }
        return max(size, key=lambda name: size[name])


Drawer = Callable[["Diagnosis", Sequence[View]], Captioned]


class Curve(NamedTuple):
    """A signal (n,) of one run, measured or simulated, with its label and colour."""

    label: str
    values: FloatArray
    colour: str


def view_of(diagnosis: Diagnosis, run: Measured, term: Term) -> View:
    """Simulate a run without a term of the final hypothesis."""
    final, observer_s = diagnosis.final, diagnosis.train.observer_s
    before = without_terms(final.hypothesis, term).blocks(run, observer_s)
    after = diagnosis.residuals(final, run)
    torque, torque_after = (
        disturbance(run, values["motor"], inertia(final.bench), observer_s) for values in (before, after)
    )
    return View(term, run, before, after, torque, torque_after)


def three_curves(diagnosis: Diagnosis, run: Measured, channel: str, measured: FloatArray) -> list[Curve]:
    """A signal (n,) measured, simulated by the refitted nominal twin, and simulated by the final twin."""
    nominal, final = (measured - diagnosis.residuals(fit, run)[channel] for fit in (diagnosis.nominal, diagnosis.final))
    return [
        Curve("nominal twin, refitted", nominal, COMMAND),
        Curve("measured", measured, MEASURED),
        Curve("twin with the findings", final, SIMULATED),
    ]


def longest(views: Sequence[View]) -> View:
    """The view of the longest run."""
    return max(views, key=lambda view: view.run.motor.size)


def unit_of_channel(diagnosis: Diagnosis, channel: str) -> str:
    """SI unit of a residual."""
    axis = diagnosis.given_bench.axis
    if channel == "table":
        return "rad" if axis.turns else "m"
    return "N" if axis.linear else "N m"


def label_of_channel(diagnosis: Diagnosis, channel: str) -> str:
    """Axis label of the residual of a channel, with "force" for "torque" on a linear axis."""
    label = CHANNEL_LABELS[channel]
    return label.replace("torque", "force") if diagnosis.given_bench.axis.linear else label


def noise(run: Measured, channel: str) -> float:
    """White noise (1 sigma) of a residual."""
    return {"motor": run.noise.motor, "table": run.noise.table_m}.get(channel, run.noise.torque)


def binned(x: FloatArray, y: FloatArray, edges: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres (m,), medians (m,) and distances to the quartiles (2, m) of y in bins of x; NaN with too few samples."""
    index = np.digitize(x, edges) - 1
    quartiles = np.full((edges.size - 1, 3), np.nan)
    for i in range(edges.size - 1):
        if np.count_nonzero(index == i) >= BIN_SAMPLES_MIN:
            quartiles[i] = np.percentile(y[index == i], [25.0, 50.0, 75.0])
    low, middle, high = quartiles.T
    return 0.5 * (edges[:-1] + edges[1:]), middle, np.stack([middle - low, high - middle])


def angle(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Angle of the motor within its revolution [deg]."""
    turned = view.run.motor * diagnosis.given_bench.axis.physics().angle_per_unit
    return np.asarray(np.degrees(np.mod(turned, 2.0 * np.pi)))


def position(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Position by the motor encoder [mm]."""
    return np.asarray(1e3 * diagnosis.given_bench.axis.ratio_m_rad * view.run.motor)


def around(row: int, run: Measured, half_s: float) -> slice:
    """Evaluated rows within +- `half_s` of a row."""
    half = round(half_s / run.period_s)
    return slice(max(row - half, run.evaluated.start), min(row + half, run.motor.size))
