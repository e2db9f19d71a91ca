"""Figure of a finding: the characteristic quantity of its mechanism, measured and modelled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import welch

from hil.arrays import FloatArray
from hil.diagnosis.pictures.laws import friction_over_speed, lost_motion, torque_over_command
from hil.diagnosis.pictures.view import (
    CHANNEL_LABELS,
    Captioned,
    Drawer,
    View,
    angle,
    around,
    binned,
    label_of_channel,
    longest,
    noise,
    position,
    unit_of_channel,
    view_of,
)
from hil.diagnosis.pictures.windows import force_over_time
from hil.diagnosis.turning import labelled
from hil.figures.drawing import legend_above, style_axis
from hil.figures.panels import COMMAND, DEVIATION, MEASURED, SIMULATED, thin
from hil.identification.terms import Term
from hil.quantities import reading_unit
from hil.twin.library import BY_ID
from hil.twin.mechanism import Picture
from hil.twin.parameter import Role

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

BINS = 120  # points that a figure of this width resolves
SAMPLES_PER_BIN = 60  # on average; a shorter recording gets wider bins, so that medians stay smooth
FOLDED_FROM = 6  # periods within the travel from which the position is taken within the period: more are not readable
DRAWN_ROWS = 6000  # several per pixel
POINTS, CURVE = "measured - twin without this term", "modelled by this term"


def finding_figure(diagnosis: Diagnosis, term: Term) -> Captioned:
    """Draw the evidence for a term of the final hypothesis, on the held-out recordings if there are any."""
    picture = PICTURES[BY_ID[term.effect].text.picture]
    # a friction curve needs every feed of every recording
    every = picture is friction_over_speed or bool(term.windows)  # an event is in any of them
    train, held_out = diagnosis.train.runs, diagnosis.held_out.runs
    runs = (*train, *held_out) if every else held_out or train
    figure, caption = picture(diagnosis, [view_of(diagnosis, run, term) for run in runs])
    names = ", ".join(run.name for run in runs)
    return Captioned(labelled(figure, diagnosis.given_bench.axis.turns), f"{caption} Recordings: {names}.")


def term_of(diagnosis: Diagnosis, index: int) -> Term:
    """The term of the final hypothesis that the finding `index` reports."""
    finding = diagnosis.result.findings[index]
    terms = diagnosis.final.terms
    if finding.windows:
        return next(term for term in terms if term.windows)
    strength = next(iter(finding.parameters.values())).value
    return next(term for term in terms if term.effect == finding.effect and term.values[0] == strength)


def _residual_over(
    label: str,
    x_of: Callable[[Diagnosis, View], FloatArray],
    x_unit: str,
    wanted: str = "motor",
    bins: int = BINS,
    against_motion: bool = False,
    per_torque: bool = False,
) -> Drawer:
    """Make a picture of a residual over a quantity, measured (points) and modelled (line).

    `against_motion` counts a torque positive against the motion, `per_torque` relates it to the motor torque [%].
    """

    def picture(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
        channel = wanted if wanted in views[0].measured else "motor"
        x = np.concatenate([x_of(diagnosis, view)[view.torque.sliding] for view in views])
        scale = np.ones(x.size)
        if against_motion:
            scale = np.concatenate([-np.sign(view.torque.velocity[view.torque.sliding]) for view in views])
        if per_torque:
            torque = np.concatenate([view.run.torque[view.torque.sliding] for view in views])
            scale = 100.0 / np.where(np.abs(torque) > 0.2 * np.abs(torque).max(), torque, np.inf)
        measured, modelled = (
            np.concatenate([view.residual(channel, of_term)[view.torque.sliding] for view in views]) * scale
            for of_term in (False, True)
        )
        used = scale != 0.0
        count = int(np.clip(used.sum() / SAMPLES_PER_BIN, 10, bins))
        edges = np.linspace(float(x.min()), float(x.max()), count + 1)
        centre, points, spread = binned(x[used], measured[used], edges)
        _, curve, _ = binned(x[used], modelled[used], edges)
        si = "%" if per_torque else unit_of_channel(diagnosis, channel)
        factor, unit = reading_unit(si, float(np.nanmax(np.abs(points))))
        figure = Figure(figsize=(10.0, 4.8), layout="constrained")
        axis = figure.subplots()
        axis.errorbar(
            centre,
            points * factor,
            spread * factor,
            fmt="o",
            color=MEASURED,
            markersize=3.5,
            linewidth=0.8,
            label=POINTS,
        )
        axis.plot(centre, curve * factor, color=SIMULATED, linewidth=1.8, label=CURVE)
        axis.axhline(0.0, color="black", linewidth=0.8)
        legend_above(axis)
        name = label_of_channel(diagnosis, channel)
        name = "friction" if against_motion else "change of the torque" if per_torque else name
        style_axis(axis, f"{name} [{unit}]", f"{label} [{x_unit}]", f"Residual over {label}")
        return Captioned(
            figure,
            f"Residual of the twin without this term over {label}: points are measured (median and quartiles), the "
            "line is the part modelled by the term.",
        )

    return picture


def _over_turn(per_torque: bool = False) -> Drawer:
    """Make a picture over the motor angle, or over the position where no revolution is known."""

    def picture(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
        known = diagnosis.given_bench.axis.physics().turn_known
        label, x_of, unit = ("motor angle", angle, "deg") if known else ("position", position, "mm")
        return _residual_over(label, x_of, unit, bins=240, per_torque=per_torque)(diagnosis, views)

    return picture


def _within_period(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Position within the term's period [mm]."""
    return np.asarray(np.mod(position(diagnosis, view), 1e3 * view.term.values[1]))


def _friction_over_position(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw friction over position, folded to one period if the travel holds many."""
    travel = max(float(np.ptp(position(diagnosis, view))) for view in views)
    period_m = BY_ID[views[0].term.effect].named(Role.PERIOD, views[0].term.values)
    folded = period_m is not None and 1e3 * period_m < travel / FOLDED_FROM
    label, x_of, bins = ("position within the period", _within_period, 40) if folded else ("position", position, BINS)
    return _residual_over(label, x_of, "mm", bins=bins, against_motion=True)(diagnosis, views)


def _torque_over_command(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw torque over its command if the term shows there, else the torque on the motor over the command."""
    view = longest(views)
    if float(np.sqrt(np.mean(view.modelled["torque"] ** 2))) >= 0.2 * view.run.noise.torque:
        return torque_over_command(diagnosis, views)
    unit = "N" if diagnosis.given_bench.axis.linear else "N m"
    return _residual_over("torque command", lambda _, view: view.run.torque_command, unit)(diagnosis, views)


def _spectrum(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw the amplitude spectral density of the residual before and after."""
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    axis = figure.subplots()
    channel = "table" if "table" in views[0].measured else "motor"
    for label, fit, colour in (
        ("nominal twin, refitted", diagnosis.nominal, COMMAND),
        ("twin with the findings", diagnosis.final, SIMULATED),
    ):
        spectra = [
            welch(
                diagnosis.residuals(fit, view.run)[channel],
                1.0 / view.run.period_s,
                nperseg=min(4096, view.run.motor.size),
            )
            for view in views
        ]
        density = np.sqrt(np.mean([power for _, power in spectra], axis=0))
        axis.loglog(spectra[0][0][1:], density[1:], color=colour, label=label)
    term = BY_ID[views[0].term.effect]
    for role in (Role.FREQUENCY, Role.LINE):
        found_hz = term.named(role, views[0].term.values)
        if found_hz is not None:
            axis.axvline(found_hz, color=DEVIATION, linewidth=1.0, linestyle="--", label=f"{found_hz:.3g} Hz")
    # here the motor's residual is a position, not converted to a torque
    linear = diagnosis.given_bench.axis.linear or (channel == "table" and not diagnosis.given_bench.axis.turns)
    unit = "m" if linear else "rad"
    label = CHANNEL_LABELS["table"] if channel == "table" else "motor position"
    style_axis(axis, f"{label} [{unit}/√Hz]", "frequency [Hz]", "Spectrum of the residual")
    axis.legend(frameon=False)
    return Captioned(
        figure, "A mode or a line that the twin lacks is a peak of the nominal twin and absent with the findings."
    )


def _over_time(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw the residual over time in the channel in which the term is largest; below, its maximum enlarged."""
    view = views[0]
    size = {name: float(np.sqrt(np.mean(values**2))) / noise(view.run, name) for name, values in view.modelled.items()}
    channel = max(size, key=lambda name: size[name])
    measured, modelled = view.residual(channel, False), view.residual(channel, True)
    factor, unit = reading_unit(unit_of_channel(diagnosis, channel), float(np.abs(measured[view.run.evaluated]).max()))
    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 1)
    middle = view.run.evaluated.start + int(np.argmax(np.abs(modelled[view.run.evaluated])))
    for axis, rows in zip(axes, (slice(view.run.evaluated.start, None), around(middle, view.run, 0.3)), strict=True):
        chosen = thin((measured[rows], modelled[rows]), DRAWN_ROWS)
        time = view.run.time_s[rows][chosen]
        axis.plot(time, measured[rows][chosen] * factor, color=MEASURED, linewidth=2.4, alpha=0.5, label=POINTS)
        axis.plot(time, modelled[rows][chosen] * factor, color=SIMULATED, linewidth=1.0, label=CURVE)
        style_axis(axis, f"{label_of_channel(diagnosis, channel)} [{unit}]")
    axes[0].set_title("Residual over time", loc="left")
    legend_above(axes[0])
    axes[-1].set_xlabel("time [s]")
    return Captioned(
        figure,
        "Residual of the twin without this term and the part modelled by the term; below, enlarged about its maximum.",
    )


def _within_signal_period(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Position within the signal period of the linear encoder [µm]."""
    return np.asarray(1e6 * np.mod(view.run.table_m, view.term.values[1]))


PICTURES: dict[Picture, Drawer] = {
    Picture.TIME: _over_time,
    Picture.FORCE: force_over_time,
    Picture.FRICTION: friction_over_speed,
    Picture.FRICTION_ALONG_TRAVEL: _friction_over_position,
    Picture.POSITION: _residual_over("position", position, "mm"),
    Picture.POSITION_TABLE: _residual_over("position", position, "mm", "table"),
    Picture.MOTOR_ANGLE: _over_turn(),
    Picture.MOTOR_ANGLE_PER_TORQUE: _over_turn(per_torque=True),
    Picture.MOTOR_ANGLE_TABLE: _residual_over("motor angle", angle, "deg", "table"),
    Picture.SCREW_ANGLE: _residual_over("screw angle", angle, "deg", "table"),
    Picture.SIGNAL_PERIOD: _residual_over(
        "position within the signal period", _within_signal_period, "µm", "table", bins=40
    ),
    Picture.LOST_MOTION: lost_motion,
    Picture.DRIVE_LAW: _torque_over_command,
    Picture.SPECTRUM: _spectrum,
}
