"""Pictures of a diagnosis: the one that convinces of a mechanism, where the mismatch is, and the fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import savgol_filter, welch

from hil.diagnosis.diagnose import Diagnosis
from hil.diagnosis.disturbance import Disturbance, disturbance
from hil.diagnosis.energy import without_terms
from hil.diagnosis.fit import Fit
from hil.diagnosis.model import Term
from hil.measured import Measured
from hil.report import look
from hil.report.figures import style
from hil.report.look import FloatArray, shown

_BINS = 120
_ENOUGH = 8       # samples of a bin, for a median that is worth a point
_PER_BIN = 60     # samples on average, where a recording is short
_SHORT = 6        # periods in the travel, from which on they are laid over each other
_AFTER = look.SIMULATED


@dataclass(frozen=True, eq=False)
class Shown:
    """A figure and the sentence below it."""

    figure: Figure
    caption: str


@dataclass(frozen=True, eq=False)
class _View:
    """One run as the pictures need it: what the twin without a term leaves, and what the term says of that."""

    term: Term
    run: Measured
    measured: dict[str, FloatArray]      # residual of the corrected twin with one term off
    modelled: dict[str, FloatArray]      # of that, what the term explains
    torque: Disturbance                  # the motor's share of it, as a torque
    torque_modelled: Disturbance


_Picture = Callable[[Diagnosis, Sequence[_View]], Shown]


def convincing(diagnosis: Diagnosis, term: Term) -> Shown:
    """The picture that shows an engineer a mechanism that was found in the recordings."""
    picture = _PICTURES.get(term.effect, _over_time)
    # a friction curve needs every feed there is; all else is shown where it was not fitted
    runs = (*diagnosis.train, *diagnosis.held_out) if picture is _friction else diagnosis.held_out or diagnosis.train
    shown = picture(diagnosis, [_view(diagnosis.final, run, term) for run in runs])
    return Shown(shown.figure, f"{shown.caption} Recordings: {', '.join(run.name for run in runs)}.")


def _view(final: Fit, run: Measured, term: Term) -> _View:
    off = without_terms(final, term)
    measured, left = off.model.blocks(off.x, run), final.model.blocks(final.x, run)
    modelled = {name: measured[name] - left[name] for name in measured}
    inertia, observer_s = _inertia(final), final.model.observer_s
    return _View(term, run, measured, modelled, disturbance(run, measured["motor"], inertia, observer_s),
                 disturbance(run, modelled["motor"], inertia, observer_s))


def _inertia(final: Fit) -> float:
    """Inertia of the whole axis in motor units."""
    modes = final.model.resolved(final.x)[0].twin().modal
    return float(modes.shape[modes.motor, 0] ** -2)


def _friction(diagnosis: Diagnosis, views: Sequence[_View]) -> Shown:
    """Motor torque less J a over speed, of the recordings and of the twin run from the same set-points."""
    final = diagnosis.final
    linear, ratio = diagnosis.owner.axis.linear, diagnosis.owner.axis.ratio_m_rad
    fastest = max(float(np.abs(view.torque.velocity).max()) for view in views)
    edges = np.geomspace(1e-3 * fastest, fastest, 45)
    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    axis = figure.subplots()
    measured = [_friction_of(final, view.run, view.run.motor, view.run.torque) for view in views]
    answers = [final.model.respond(final.x, view.run) for view in views]
    simulated = [_friction_of(final, view.run, answer.motor_position, answer.torque)
                 for view, answer in zip(views, answers, strict=True)]
    for sign, marker, name in ((1.0, "^", "positive"), (-1.0, "v", "negative")):
        colour = look.MEASURED if sign > 0.0 else look.DEVIATION
        speed, friction, spread = _binned(*_one_way(measured, sign), edges)
        axis.errorbar(speed * ratio * 60.0, friction, spread, fmt=marker, color=colour, markersize=5, linewidth=0.8,
                      label=f"measured, {name} direction")
        speed, friction, _ = _binned(*_one_way(simulated, sign), edges)
        axis.plot(speed * ratio * 60.0, friction, color=_AFTER, linestyle="-" if sign > 0.0 else "--", linewidth=1.8,
                  label=f"twin with the terms found, {name}")
    for name, fit, line in (("bench file", diagnosis.explanation.owner, ":"),
                            ("nominal twin, refitted", diagnosis.explanation.nominal, "-.")):
        physics = fit.model.resolved(fit.x)[0].axis.physics()
        axis.plot(edges * ratio * 60.0, physics.coulomb_n_m + physics.viscous_n_m_s_rad * edges, color=look.COMMAND,
                  linestyle=line, label=name)
    axis.set_xscale("log")
    style(axis, f"friction [{'N' if linear else 'N m'}]")
    axis.set_xlabel("speed of the table [m/min]")
    axis.legend(frameon=False, ncols=2)
    axis.set_title("Friction over speed", loc="left")
    return Shown(figure, "Motor torque less inertia times acceleration where the axis hardly accelerates: median and "
                         "middle half of the samples in each range of speed. The twin with the terms found is run from "
                         "the same set-points and treated alike.")


def _friction_of(final: Fit, run: Measured, motor: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed and friction (m,) of the rows at which the axis moves and hardly accelerates."""
    window = max(round(0.021 / run.period_s) | 1, 5)
    velocity = savgol_filter(motor, window, 2, deriv=1, delta=run.period_s)
    inertial = _inertia(final) * savgol_filter(motor, window, 2, deriv=2, delta=run.period_s)
    friction = savgol_filter(torque, window, 2) - inertial
    physics = final.model.resolved(final.x)[0].axis.physics()
    # the slip of a stick-slip cycle is too short for the differences; at speed, J a is known well
    share = np.where(np.abs(velocity) > 0.05 * np.abs(velocity).max(), 1.0, 0.1)
    rows = (np.abs(inertial) < share * physics.coulomb_n_m) & (np.abs(velocity) > 0.0)
    rows[: run.judged.start + window] = rows[-window:] = False
    return velocity[rows], friction[rows]


def _one_way(found: Sequence[tuple[FloatArray, FloatArray]], sign: float) -> tuple[FloatArray, FloatArray]:
    """Absolute speed and friction against the motion, of one direction."""
    speed = np.concatenate([sign * v for v, _ in found])
    friction = np.concatenate([sign * f for _, f in found])
    return speed[speed > 0.0], friction[speed > 0.0]


def _over(label: str, x_of: Callable[[Diagnosis, _View], FloatArray], x_unit: str, wanted: str = "motor",
          bins: int = _BINS, against_motion: bool = False, per_torque: bool = False) -> _Picture:
    """A picture of the residual over a quantity: measured as points, what the terms explain as a line."""

    def picture(diagnosis: Diagnosis, views: Sequence[_View]) -> Shown:
        channel = wanted if wanted in views[0].measured else "motor"
        x = np.concatenate([x_of(diagnosis, view)[view.torque.sliding] for view in views])
        scale = np.ones(x.size)
        if against_motion:
            scale = np.concatenate([-np.sign(view.torque.velocity[view.torque.sliding]) for view in views])
        if per_torque:
            torque = np.concatenate([view.run.torque[view.torque.sliding] for view in views])
            scale = 100.0 / np.where(np.abs(torque) > 0.2 * np.abs(torque).max(), torque, np.inf)
        measured, modelled = (np.concatenate([_residual(view, channel, of_term)[view.torque.sliding] for view in views])
                              * scale for of_term in (False, True))
        used = scale != 0.0
        edges = np.linspace(float(x.min()), float(x.max()), int(np.clip(used.sum() / _PER_BIN, 10, bins)) + 1)
        centre, points, spread = _binned(x[used], measured[used], edges)
        _, curve, _ = _binned(x[used], modelled[used], edges)
        gap = np.flatnonzero(np.diff(centre) > 1.5 * (edges[1] - edges[0])) + 1      # no line where nothing is
        line = np.insert(centre, gap, np.nan), np.insert(curve, gap, np.nan)
        si = "%" if per_torque else _unit(diagnosis, channel)
        unit = shown(si, float(np.abs(points).max()))
        figure = Figure(figsize=(10.0, 4.8), layout="constrained")
        axis = figure.subplots()
        axis.errorbar(centre, points * unit.factor, spread * unit.factor, fmt="o", color=look.MEASURED, markersize=3.5,
                      linewidth=0.8, label="measured, less the twin without this term")
        axis.plot(line[0], line[1] * unit.factor, color=_AFTER, linewidth=1.8, label="what the term says")
        name = "friction" if against_motion else "torque per ampere" if per_torque else _NAMES[channel]
        style(axis, f"{name} [{unit.unit}]")
        axis.set_xlabel(f"{label} [{x_unit}]")
        axis.axhline(0.0, color="black", linewidth=0.8)
        axis.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        axis.set_title(f"Left by the twin over {label}", loc="left")
        return Shown(figure, f"What the twin without this term leaves, over {label}: points are measured (median and "
                             "middle half of the samples), the line is what the mechanism says.")

    return picture


def _lost_motion(diagnosis: Diagnosis, views: Sequence[_View]) -> Shown:
    """Table less motor over the torque, and over time at one reversal."""
    view = max(views, key=lambda found: found.run.motor.size)
    run, ratio = view.run, diagnosis.owner.axis.ratio_m_rad
    stretch = run.table_m - ratio * run.motor
    nominal, final = diagnosis.explanation.nominal, diagnosis.final
    lines = (("measured", stretch, look.MEASURED),
             ("nominal twin, refitted", stretch - nominal.model.blocks(nominal.x, run)["table"], look.COMMAND),
             ("twin with the terms found", stretch - final.model.blocks(final.x, run)["table"], _AFTER))
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    acceleration = savgol_filter(run.table_m, max(round(0.009 / run.period_s) | 1, 5), 2, deriv=2, delta=run.period_s)
    rows = np.arange(run.judged.start, stretch.size, max(stretch.size // 8000, 1))
    unit = shown("m", float(np.abs(stretch).max()))
    for label, values, colour in (lines[1], lines[0], lines[2]):
        broad = label == "measured"
        left.plot(acceleration[rows], values[rows] * unit.factor, ".", color=colour, markersize=5.0 if broad else 1.5,
                  alpha=0.4 if broad else 0.8, label=label, rasterized=True, markeredgewidth=0.0)
    style(left, f"table less motor position [{unit.unit}]")
    left.set_xlabel("acceleration of the table [m/s²]: load of the transmission")
    left.set_title("Over the load", loc="left")
    left.legend(frameon=False, markerscale=3.0)
    window = _reversal(run)
    time = run.time_s[window]
    for label, values, colour in lines:
        broad = label == "measured"
        right.plot(time, values[window] * unit.factor, color=colour, label=label,
                   linewidth=2.6 if broad else 1.1, alpha=0.5 if broad else 1.0)
    style(right, f"table less motor position [{unit.unit}]")
    right.set_xlabel("time [s]")
    right.set_title("At one reversal", loc="left")
    return Shown(figure, "Table against motor: compliance is a slope over the load, lost motion a step where the load "
                         "changes its direction, however small it is.")


def _drive(diagnosis: Diagnosis, views: Sequence[_View]) -> Shown:
    """Torque over its command: measured and both twins."""
    view = max(views, key=lambda found: found.run.motor.size)
    run, nominal, final = view.run, diagnosis.explanation.nominal, diagnosis.final
    if float(np.sqrt(np.mean(view.modelled["torque"] ** 2))) < 0.2 * run.noise.torque:
        return _over("torque command", lambda _, v: v.run.torque_command, "N m")(diagnosis, views)
    rows = np.arange(run.judged.start, run.motor.size, max(run.motor.size // 8000, 1))
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    unit = "N" if diagnosis.owner.axis.linear else "N m"
    window = _steepest(run.torque_command, run)
    for label, values, colour in (
            ("nominal twin, refitted", run.torque - nominal.model.blocks(nominal.x, run)["torque"], look.COMMAND),
            ("measured", run.torque, look.MEASURED),
            ("twin with the terms found", run.torque - final.model.blocks(final.x, run)["torque"], _AFTER)):
        broad = label == "measured"
        left.plot(run.torque_command[rows], values[rows], ".", color=colour, markersize=6.0 if broad else 2.0,
                  alpha=0.5, markeredgewidth=0.0, label=label)
        right.plot(run.time_s[window], values[window], color=colour, linewidth=3.0 if broad else 1.2,
                   alpha=0.5 if broad else 1.0)
    right.plot(run.time_s[window], run.torque_command[window], color="black", linewidth=0.8, linestyle=":",
               label="command")
    style(left, f"torque [{unit}]")
    left.set_xlabel(f"torque command [{unit}]")
    left.legend(frameon=False, markerscale=2.0)
    left.set_title("Over the command", loc="left")
    style(right, f"torque [{unit}]")
    right.set_xlabel("time [s]")
    right.legend(frameon=False)
    right.set_title("Where the command changes fastest", loc="left")
    return Shown(figure, "Torque against its command, measured and as the twin has it before and after.")


def _spectrum(diagnosis: Diagnosis, views: Sequence[_View]) -> Shown:
    """Amplitude spectrum of what is left before and after."""
    nominal, final = diagnosis.explanation.nominal, diagnosis.final
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    axis = figure.subplots()
    channel = "table" if "table" in views[0].measured else "motor"
    for label, fit, colour in (("nominal twin, refitted", nominal, look.COMMAND),
                               ("twin with the terms found", final, _AFTER)):
        power = []
        for view in views:
            frequency, density = welch(fit.model.blocks(fit.x, view.run)[channel], 1.0 / view.run.period_s,
                                       nperseg=min(4096, view.run.motor.size))
            power.append(density)
        axis.loglog(frequency[1:], np.sqrt(np.mean(power, axis=0))[1:], color=colour, label=label)
    style(axis, f"{_NAMES[channel]} [{_unit(diagnosis, channel)}/√Hz]")
    axis.set_xlabel("frequency [Hz]")
    axis.legend(frameon=False)
    axis.set_title("Spectrum of what the twin leaves", loc="left")
    return Shown(figure, "A mode that the twin has not shows as a peak, which is gone once it has it.")


def _over_time(diagnosis: Diagnosis, views: Sequence[_View]) -> Shown:
    """What the terms explain over time, in the channel in which they show most."""
    view = views[0]
    size = {name: float(np.sqrt(np.mean(values**2))) / _noise(view.run, name) for name, values in view.modelled.items()}
    channel = max(size, key=lambda name: size[name])
    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 1)
    si = _unit(diagnosis, channel)
    measured, modelled = _residual(view, channel, False), _residual(view, channel, True)
    unit = shown(si, float(np.abs(measured[view.run.judged]).max()))
    middle = int(np.argmax(np.abs(modelled)))
    for axis, rows in zip(axes, (slice(view.run.judged.start, None), _around(middle, view.run, 0.3)), strict=True):
        chosen = look.thin((measured[rows], modelled[rows]), 6000)
        time = view.run.time_s[rows][chosen]
        axis.plot(time, measured[rows][chosen] * unit.factor, color=look.MEASURED, linewidth=2.4, alpha=0.5,
                  label="measured, less the twin without this term")
        axis.plot(time, modelled[rows][chosen] * unit.factor, color=_AFTER, linewidth=1.0, label="what the term says")
        style(axis, f"{_NAMES[channel]} [{unit.unit}]")
    axes[-1].set_xlabel("time [s]")
    axes[0].legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    axes[0].set_title("Left by the twin over time", loc="left")
    return Shown(figure, "What the twin without this term leaves, and what the mechanism says of it; below, where that "
                         "is most.")


_NAMES = {"motor": "torque on the motor", "table": "table against motor", "torque": "torque", "command": "command"}


def _residual(view: _View, channel: str, modelled: bool) -> FloatArray:
    """Residual (n,); that of the motor as the torque that makes it."""
    if channel == "motor":
        return (view.torque_modelled if modelled else view.torque).torque
    return (view.modelled if modelled else view.measured)[channel]


def _unit(diagnosis: Diagnosis, channel: str) -> str:
    return "m" if channel == "table" else "N" if diagnosis.owner.axis.linear else "N m"


def _noise(run: Measured, channel: str) -> float:
    return {"motor": run.noise.motor, "table": run.noise.table_m}.get(channel, run.noise.torque)


def _binned(x: FloatArray, y: FloatArray, edges: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, medians, and distances to the quartiles (2, m) of the bins that hold enough samples."""
    index = np.digitize(x, edges) - 1
    order = np.argsort(index, kind="stable")
    groups = np.split(y[order], np.searchsorted(index[order], np.arange(edges.size)))
    kept = [i for i in range(edges.size - 1) if groups[i + 1].size >= _ENOUGH]
    low, middle, high = np.array([np.percentile(groups[i + 1], [25.0, 50.0, 75.0]) for i in kept]).reshape(-1, 3).T
    centre = np.array([0.5 * (edges[i] + edges[i + 1]) for i in kept])
    return centre, middle, np.stack([middle - low, high - middle])


def _reversal(run: Measured) -> slice:
    """Rows about a reversal of the set-points in the middle of the recording."""
    moving = np.flatnonzero(np.abs(run.velocity_command_m_s) > 1e-3 * np.abs(run.velocity_command_m_s).max())
    turns = moving[1:][np.diff(np.sign(run.velocity_command_m_s[moving])) != 0.0]
    row = int(turns[turns.size // 2]) if turns.size else run.motor.size // 2
    return _around(row, run, 0.4)


def _steepest(values: FloatArray, run: Measured) -> slice:
    rows = np.convolve(np.abs(np.diff(values)), np.ones(20), "same")
    return _around(int(np.argmax(rows[run.judged])) + run.judged.start, run, 0.05)


def _around(row: int, run: Measured, half_s: float) -> slice:
    half = round(half_s / run.period_s)
    return slice(max(row - half, 0), min(row + half, run.motor.size))


def _angle(diagnosis: Diagnosis, view: _View) -> FloatArray:
    """Angle of the motor within its revolution [deg]."""
    turned = view.run.motor * diagnosis.owner.axis.physics().angle_per_unit
    return np.asarray(np.degrees(np.mod(turned, 2.0 * np.pi)))


def _position(diagnosis: Diagnosis, view: _View) -> FloatArray:
    return np.asarray(1e3 * diagnosis.owner.axis.ratio_m_rad * view.run.motor)


def _within_period(diagnosis: Diagnosis, view: _View) -> FloatArray:
    """Position within the signal period of the linear encoder [µm]."""
    return np.asarray(1e6 * np.mod(view.run.table_m, view.term.values[1]))


def _within_friction_period(diagnosis: Diagnosis, view: _View) -> FloatArray:
    return np.asarray(np.mod(_position(diagnosis, view), 1e3 * view.term.values[1]))


def _friction_along_travel(diagnosis: Diagnosis, views: Sequence[_View]) -> Shown:
    """Friction over position, within the period where that is short."""
    travel = max(float(np.ptp(_position(diagnosis, view))) for view in views)
    short = 1e3 * views[0].term.values[1] < travel / _SHORT
    picture = (_over("position within the period", _within_friction_period, "mm", bins=40, against_motion=True) if short
               else _over("position", _position, "mm", against_motion=True))
    return picture(diagnosis, views)


_PICTURES: dict[str, _Picture] = {
    **dict.fromkeys(("asymmetric_friction", "constant_load", "stribeck_friction", "nonlinear_viscous_friction"),
                    _friction),
    "position_dependent_friction": _friction_along_travel,
    "spring_load": _over("position", _position, "mm"),
    "cogging_torque": _over("motor angle", _angle, "deg", bins=240),
    "torque_ripple": _over("motor angle", _angle, "deg", bins=240, per_torque=True),
    "encoder_eccentricity": _over("motor angle", _angle, "deg", "table"),
    "periodic_lead_error": _over("screw angle", _angle, "deg", "table"),
    "cumulative_lead_error": _over("position", _position, "mm", "table"),
    "scale_interpolation_error": _over("position within the signal period", _within_period, "µm", "table", bins=40),
    **dict.fromkeys(("backlash", "preload_loss"), _lost_motion),
    **dict.fromkeys(("torque_constant_saturation", "torque_saturation", "torque_dead_zone", "current_loop_lag",
                     "transport_delay"), _drive),
    "structural_mode": _spectrum,
}
