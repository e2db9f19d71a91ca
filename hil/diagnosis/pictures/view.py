"""Data of the figure of a finding: residuals without the finding's term, and the part that the term models."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.location.residual_energy import without_terms
from hil.diagnosis.search.disturbance import Disturbance, disturbance
from hil.figures.drawing import Drawing
from hil.identification.measured import Measured
from hil.identification.terms import Term

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

CHANNEL_LABELS = {
    "motor": "torque on the motor",
    "table": "table - motor position",
    "torque": "torque",
    "command": "command",
}


class Captioned(NamedTuple):
    """A figure and its caption."""

    figure: Drawing
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
    def has_table(self) -> bool:
        """True if a second encoder is recorded."""
        return bool(self.run.table_m.size)

    @property
    def shows_delay(self) -> str:
        """Channel that shows a delay best: the difference of two encoders needs no model of the axis."""
        size = self._sizes()
        strongest = max(size, key=lambda name: size[name])
        return "table" if size.get("table", 0.0) > 0.5 * size[strongest] else strongest

    @property
    def strongest(self) -> str:
        """Channel in which the term is largest against the noise."""
        size = self._sizes()
        return max(size, key=lambda name: size[name])

    def _sizes(self) -> dict[str, float]:
        return {
            name: float(np.sqrt(np.mean((values - self.after[name])[self.run.evaluated] ** 2))) / noise(self.run, name)
            for name, values in self.before.items()
        }


Drawer = Callable[["Diagnosis", Sequence[View]], Captioned]


def view_of(diagnosis: Diagnosis, run: Measured, term: Term) -> View:
    """Simulate a run without a term of the final hypothesis."""
    final, observer_s = diagnosis.final, diagnosis.train.observer_s
    before = without_terms(final.hypothesis, term).blocks(run, observer_s, diagnosis.train.steps)
    after = diagnosis.residuals(final, run)
    torque, torque_after = (torque_of(run, values["motor"], final.bench, observer_s) for values in (before, after))
    return View(term, run, before, after, torque, torque_after)


def torque_of(run: Measured, left: FloatArray, bench: Bench, observer_s: float) -> Disturbance:
    """The motor's residual (n,) as the torque that causes it: the observer moves the motor's side of the transmission
    as one body, so that its inertia counts."""
    chain = bench.axis.physics().chain
    side = chain.side(chain.motor)
    return disturbance(run, left, float(side @ chain.inertia_kg_m2 @ side), observer_s)


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


def around(row: int, run: Measured, half_s: float) -> slice:
    """Evaluated rows within +- `half_s` of a row."""
    half = round(half_s / run.period_s)
    return slice(max(row - half, run.evaluated.start), min(row + half, run.motor.size))
