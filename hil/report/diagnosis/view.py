"""What the picture of a mechanism is drawn from: a run without its term and with it, and the axes to draw it over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.diagnosis.diagnose import Diagnosis
from hil.diagnosis.location.residual_energy import without_terms
from hil.diagnosis.search.disturbance import Disturbance, disturbance
from hil.identification.dataset import Measured, inertia
from hil.identification.terms import Term
from hil.report import style

AFTER = style.SIMULATED
_ENOUGH = 8  # samples of a bin, for a median that is worth a point


@dataclass(frozen=True, eq=False)
class Shown:
    """A figure and the sentence below it."""

    figure: Figure
    caption: str


@dataclass(frozen=True, eq=False)
class View:
    """One run as the pictures need it: what the twin without a term leaves, and what the term says of that."""

    term: Term
    run: Measured
    measured: dict[str, FloatArray]  # residual of the corrected twin with one term off
    modelled: dict[str, FloatArray]  # of that, what the term explains
    torque: Disturbance  # the motor's share of it, as a torque
    torque_modelled: Disturbance


Draw = Callable[[Diagnosis, Sequence[View]], Shown]
NAMES = {"motor": "torque on the motor", "table": "table against motor", "torque": "torque", "command": "command"}


def view_of(diagnosis: Diagnosis, run: Measured, term: Term) -> View:
    final, data = diagnosis.final, diagnosis.train
    measured = without_terms(final.hypothesis, term).blocks(run, data.observer_s)
    left = diagnosis.residuals(final, run)
    modelled = {name: measured[name] - left[name] for name in measured}
    whole, observer_s = inertia(final.bench), data.observer_s
    return View(
        term,
        run,
        measured,
        modelled,
        disturbance(run, measured["motor"], whole, observer_s),
        disturbance(run, modelled["motor"], whole, observer_s),
    )


def longest(views: Sequence[View]) -> View:
    """The view of the longest run."""
    return max(views, key=lambda found: found.run.motor.size)


def residual(view: View, channel: str, modelled: bool) -> FloatArray:
    """Residual (n,); that of the motor as the torque that makes it."""
    if channel == "motor":
        return (view.torque_modelled if modelled else view.torque).torque
    return (view.modelled if modelled else view.measured)[channel]


def unit_of(diagnosis: Diagnosis, channel: str) -> str:
    return "m" if channel == "table" else "N" if diagnosis.owner.axis.linear else "N m"


def noise(run: Measured, channel: str) -> float:
    return {"motor": run.noise.motor, "table": run.noise.table_m}.get(channel, run.noise.torque)


def binned(x: FloatArray, y: FloatArray, edges: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, medians, and distances to the quartiles (2, m) of the bins that hold enough samples."""
    index = np.digitize(x, edges) - 1
    order = np.argsort(index, kind="stable")
    groups = np.split(y[order], np.searchsorted(index[order], np.arange(edges.size)))
    kept = [i for i in range(edges.size - 1) if groups[i + 1].size >= _ENOUGH]
    low, middle, high = np.array([np.percentile(groups[i + 1], [25.0, 50.0, 75.0]) for i in kept]).reshape(-1, 3).T
    centre = np.array([0.5 * (edges[i] + edges[i + 1]) for i in kept])
    return centre, middle, np.stack([middle - low, high - middle])


def angle(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Angle of the motor within its revolution [deg]."""
    turned = view.run.motor * diagnosis.owner.axis.physics().angle_per_unit
    return np.asarray(np.degrees(np.mod(turned, 2.0 * np.pi)))


def position(diagnosis: Diagnosis, view: View) -> FloatArray:
    return np.asarray(1e3 * diagnosis.owner.axis.ratio_m_rad * view.run.motor)


def around(row: int, run: Measured, half_s: float) -> slice:
    half = round(half_s / run.period_s)
    return slice(max(row - half, 0), min(row + half, run.motor.size))
