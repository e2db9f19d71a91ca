"""Pictures of a diagnosis: for each mechanism the one that convinces of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import welch

from hil.arrays import FloatArray
from hil.diagnosis.diagnose import Diagnosis
from hil.identification.terms import Term
from hil.report import style
from hil.report.diagnosis.curves import drive, friction, lost_motion
from hil.report.diagnosis.view import (
    AFTER,
    NAMES,
    Draw,
    Shown,
    View,
    angle,
    around,
    binned,
    longest,
    noise,
    position,
    residual,
    unit_of,
    view_of,
)
from hil.report.figures import style_axis
from hil.report.style import shown
from hil.twin.library import BY_ID
from hil.twin.mechanism import Picture

_BINS = 120
_PER_BIN = 60  # samples on average, where a recording is short
_SHORT = 6  # periods in the travel, from which on they are laid over each other


def convincing(diagnosis: Diagnosis, term: Term) -> Shown:
    """The picture that shows an engineer a mechanism that was found in the recordings."""
    picture = _PICTURES[BY_ID[term.effect].picture]
    # a friction curve needs every feed there is; all else is shown where it was not fitted
    train, held_out = diagnosis.train.runs, diagnosis.held_out.runs
    runs = (*train, *held_out) if picture is friction else held_out or train
    shown = picture(diagnosis, [view_of(diagnosis, run, term) for run in runs])
    return Shown(shown.figure, f"{shown.caption} Recordings: {', '.join(run.name for run in runs)}.")


def _over(
    label: str,
    x_of: Callable[[Diagnosis, View], FloatArray],
    x_unit: str,
    wanted: str = "motor",
    bins: int = _BINS,
    against_motion: bool = False,
    per_torque: bool = False,
) -> Draw:
    """A picture of the residual over a quantity: measured as points, what the terms explain as a line."""

    def picture(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
        channel = wanted if wanted in views[0].measured else "motor"
        x = np.concatenate([x_of(diagnosis, view)[view.torque.sliding] for view in views])
        scale = np.ones(x.size)
        if against_motion:
            scale = np.concatenate([-np.sign(view.torque.velocity[view.torque.sliding]) for view in views])
        if per_torque:
            torque = np.concatenate([view.run.torque[view.torque.sliding] for view in views])
            scale = 100.0 / np.where(np.abs(torque) > 0.2 * np.abs(torque).max(), torque, np.inf)
        measured, modelled = (
            np.concatenate([residual(view, channel, of_term)[view.torque.sliding] for view in views]) * scale
            for of_term in (False, True)
        )
        used = scale != 0.0
        edges = np.linspace(float(x.min()), float(x.max()), int(np.clip(used.sum() / _PER_BIN, 10, bins)) + 1)
        centre, points, spread = binned(x[used], measured[used], edges)
        _, curve, _ = binned(x[used], modelled[used], edges)
        gap = np.flatnonzero(np.diff(centre) > 1.5 * (edges[1] - edges[0])) + 1  # no line where nothing is
        line = np.insert(centre, gap, np.nan), np.insert(curve, gap, np.nan)
        si = "%" if per_torque else unit_of(diagnosis, channel)
        unit = shown(si, float(np.abs(points).max()))
        figure = Figure(figsize=(10.0, 4.8), layout="constrained")
        axis = figure.subplots()
        axis.errorbar(
            centre,
            points * unit.factor,
            spread * unit.factor,
            fmt="o",
            color=style.MEASURED,
            markersize=3.5,
            linewidth=0.8,
            label="measured, less the twin without this term",
        )
        axis.plot(line[0], line[1] * unit.factor, color=AFTER, linewidth=1.8, label="what the term says")
        name = "friction" if against_motion else "torque per ampere" if per_torque else NAMES[channel]
        style_axis(axis, f"{name} [{unit.unit}]")
        axis.set_xlabel(f"{label} [{x_unit}]")
        axis.axhline(0.0, color="black", linewidth=0.8)
        axis.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        axis.set_title(f"Left by the twin over {label}", loc="left")
        return Shown(
            figure,
            f"What the twin without this term leaves, over {label}: points are measured (median and "
            "middle half of the samples), the line is what the mechanism says.",
        )

    return picture


def _drive_law(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
    """Torque over its command where that shows the term, else what is left of the motion over the command."""
    view = longest(views)
    if float(np.sqrt(np.mean(view.modelled["torque"] ** 2))) < 0.2 * view.run.noise.torque:
        return _over("torque command", lambda _, v: v.run.torque_command, "N m")(diagnosis, views)
    return drive(diagnosis, views)


def _spectrum(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
    """Amplitude spectrum of what is left before and after."""
    nominal, final = diagnosis.explanation.nominal, diagnosis.final
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    axis = figure.subplots()
    channel = "table" if "table" in views[0].measured else "motor"
    for label, fit, colour in (
        ("nominal twin, refitted", nominal, style.COMMAND),
        ("twin with the terms found", final, AFTER),
    ):
        power = []
        for view in views:
            frequency, density = welch(
                diagnosis.residuals(fit, view.run)[channel],
                1.0 / view.run.period_s,
                nperseg=min(4096, view.run.motor.size),
            )
            power.append(density)
        axis.loglog(frequency[1:], np.sqrt(np.mean(power, axis=0))[1:], color=colour, label=label)
    style_axis(axis, f"{NAMES[channel]} [{unit_of(diagnosis, channel)}/√Hz]")
    axis.set_xlabel("frequency [Hz]")
    axis.legend(frameon=False)
    axis.set_title("Spectrum of what the twin leaves", loc="left")
    return Shown(figure, "A mode that the twin has not shows as a peak, which is gone once it has it.")


def _over_time(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
    """What the terms explain over time, in the channel in which they show most."""
    view = views[0]
    size = {name: float(np.sqrt(np.mean(values**2))) / noise(view.run, name) for name, values in view.modelled.items()}
    channel = max(size, key=lambda name: size[name])
    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 1)
    si = unit_of(diagnosis, channel)
    measured, modelled = residual(view, channel, False), residual(view, channel, True)
    unit = shown(si, float(np.abs(measured[view.run.judged]).max()))
    middle = int(np.argmax(np.abs(modelled)))
    for axis, rows in zip(axes, (slice(view.run.judged.start, None), around(middle, view.run, 0.3)), strict=True):
        chosen = style.thin((measured[rows], modelled[rows]), 6000)
        time = view.run.time_s[rows][chosen]
        axis.plot(
            time,
            measured[rows][chosen] * unit.factor,
            color=style.MEASURED,
            linewidth=2.4,
            alpha=0.5,
            label="measured, less the twin without this term",
        )
        axis.plot(time, modelled[rows][chosen] * unit.factor, color=AFTER, linewidth=1.0, label="what the term says")
        style_axis(axis, f"{NAMES[channel]} [{unit.unit}]")
    axes[-1].set_xlabel("time [s]")
    axes[0].legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    axes[0].set_title("Left by the twin over time", loc="left")
    return Shown(
        figure, "What the twin without this term leaves, and what the mechanism says of it; below, where that is most."
    )


def _within_period(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Position within the signal period of the linear encoder [µm]."""
    return np.asarray(1e6 * np.mod(view.run.table_m, view.term.values[1]))


def _within_friction_period(diagnosis: Diagnosis, view: View) -> FloatArray:
    return np.asarray(np.mod(position(diagnosis, view), 1e3 * view.term.values[1]))


def _friction_along_travel(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
    """Friction over position, within the period where that is short."""
    travel = max(float(np.ptp(position(diagnosis, view))) for view in views)
    short = 1e3 * views[0].term.values[1] < travel / _SHORT
    picture = (
        _over("position within the period", _within_friction_period, "mm", bins=40, against_motion=True)
        if short
        else _over("position", position, "mm", against_motion=True)
    )
    return picture(diagnosis, views)


_PICTURES: dict[Picture, Draw] = {
    Picture.TIME: _over_time,
    Picture.FRICTION: friction,
    Picture.FRICTION_ALONG_TRAVEL: _friction_along_travel,
    Picture.POSITION: _over("position", position, "mm"),
    Picture.POSITION_TABLE: _over("position", position, "mm", "table"),
    Picture.MOTOR_ANGLE: _over("motor angle", angle, "deg", bins=240),
    Picture.MOTOR_ANGLE_PER_TORQUE: _over("motor angle", angle, "deg", bins=240, per_torque=True),
    Picture.MOTOR_ANGLE_TABLE: _over("motor angle", angle, "deg", "table"),
    Picture.SCREW_ANGLE: _over("screw angle", angle, "deg", "table"),
    Picture.SIGNAL_PERIOD: _over("position within the signal period", _within_period, "µm", "table", bins=40),
    Picture.LOST_MOTION: lost_motion,
    Picture.DRIVE_LAW: _drive_law,
    Picture.SPECTRUM: _spectrum,
}
