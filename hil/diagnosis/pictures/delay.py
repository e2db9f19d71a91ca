"""Figure of a delay or a lag: cross-correlation of a signal with the one it follows, and both at a fast change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.diagnosis.pictures.view import Captioned, View, around, longest
from hil.figures.drawing import WIDTH_IN, legend_outside, style_axis
from hil.figures.panels import COMMAND, MEASURED, NOISE, SIMULATED
from hil.identification.derivatives import motion
from hil.identification.terms import Term
from hil.quantities import quantity, reading_unit
from hil.twin.library import BY_ID

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

SMOOTH_S = 0.005  # of the rates: both signals pass the same filter
LEAST_S, SHOWN = 4e-3, 4.0  # shown lags on either side: at least, and in units of the delay
FINER = 8  # lags of a curve between two rows
STEEPEST_S = 0.03  # shown on either side of the fastest change
BAND = 2.6  # standard errors of a band that chance leaves in 1 % of the lags


class Pair(NamedTuple):
    """A signal (n,), the one that it follows, the same of the twins before and after, label and SI unit."""

    followed: FloatArray
    signal: FloatArray
    before: FloatArray
    after: FloatArray
    names: tuple[str, str]
    unit: str


class Correlation(NamedTuple):
    """Lags (m,) [s], normalised cross-correlations (m,) of the signal and of the twins, and the standard error."""

    lag_s: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    error: float


def cross_correlation(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw the cross-correlation of the rates of two signals over the lag, what the twin leaves of it, and a change."""
    view = longest(views)
    pair = _pair(diagnosis, view)
    found, fine = (correlation(pair, view, finer) for finer in (1, FINER))
    figure = Figure(figsize=(WIDTH_IN, 6.0), layout="constrained")
    mosaic = figure.subplot_mosaic([["peak", "left"], ["change", "change"]])
    factor, unit = reading_unit("s", float(found.lag_s[-1]))
    for values, colour, width, label in (
        (fine.before, COMMAND, 1.2, "twin before"),
        (fine.after, SIMULATED, 1.8, "twin after"),
    ):
        mosaic["peak"].plot(factor * fine.lag_s, values, color=colour, linewidth=width, label=label)
    look = {"fmt": "o", "color": MEASURED, "markersize": 3.5, "linewidth": 1.0}
    mosaic["peak"].errorbar(factor * found.lag_s, found.measured, 2.0 * found.error, label="measured", **look)
    top = float(fine.lag_s[np.argmax(fine.after)])
    mosaic["peak"].axvline(factor * top, color=SIMULATED, linewidth=0.8, linestyle=":")
    name, of = pair.names
    style_axis(mosaic["peak"], "cross-correlation", f"lag of {name}\nbehind {of} [{unit}]")
    mosaic["left"].axhspan(-BAND * found.error, BAND * found.error, color=NOISE, alpha=0.35, label="99 % of chance")
    for values, colour, label in ((found.before, COMMAND, "twin before"), (found.after, SIMULATED, "twin after")):
        mosaic["left"].plot(factor * found.lag_s, found.measured - values, ".-", color=colour, label=label)
    style_axis(mosaic["left"], "measured - twin", f"lag [{unit}]")
    _change(mosaic["change"], pair, view)
    legend_outside(figure, mosaic.values(), 5)
    return Captioned(
        figure,
        f"Cross-correlation of the rate of {name} with that of {of}: the twin after has its peak at "
        f"{quantity(top, 's')}. Right: what each twin leaves of it, with the band of chance. Below: both at the "
        "fastest change.",
    )


def correlation(pair: Pair, view: View, finer: int = 1) -> Correlation:
    """Cross-correlations at the lags that are shown, `finer` times as many as rows."""
    run = view.run
    rates = [_rate(values, view) for values in (pair.followed, pair.signal, pair.before, pair.after)]
    size = 1 << (2 * rates[0].size - 1).bit_length()
    spectra = [np.fft.rfft(one, size) for one in rates]
    scale = float(np.linalg.norm(rates[0]) * np.linalg.norm(rates[1]))
    most = round(max(LEAST_S, SHOWN * _late_s(view.term)) / run.period_s) * finer
    lags = np.arange(-most, most + 1)
    of = [finer * np.fft.irfft(np.conj(spectra[0]) * other, finer * size)[lags] / scale for other in spectra[1:]]
    # variance of the cross-correlation of two independent signals (Bartlett), of the input and what is left
    left = np.abs(spectra[1] - spectra[3]) ** 2
    power = np.sum(np.abs(spectra[0]) ** 2 * left) * 2.0 / size / rates[0].size
    return Correlation(lags * run.period_s / finer, *of, error=float(np.sqrt(power)) / scale)


def _late_s(term: Term) -> float:
    return abs(term.values[BY_ID[term.effect].strength])


def _rate(values: FloatArray, view: View) -> FloatArray:
    rate = motion(values, view.run.period_s, SMOOTH_S).velocity[view.run.evaluated]
    return rate - float(rate.mean())


def _pair(diagnosis: Diagnosis, view: View) -> Pair:
    """The signals in which the term is largest; of a torque that is not measured, the one that the motion shows."""
    run, channel = view.run, view.shows_delay
    before, after = view.residuals(channel)
    drive = diagnosis.given_bench.axis.drive_unit
    force = "force" if diagnosis.given_bench.axis.linear else "torque"
    if channel == "table":
        ratio = diagnosis.given_bench.axis.ratio_m_rad
        names = "the table position", "the motor position"
        return Pair(ratio * run.motor, run.table_m, run.table_m - before, run.table_m - after, names, "m")
    if channel == "motor":
        shown = run.torque + before
        names = f"the {force} on the motor", f"the measured {force}"
        return Pair(run.torque, shown, shown - before, shown - after, names, drive)
    signal = run.torque if channel == "torque" else run.torque_command
    followed = run.torque_command if channel == "torque" else signal - before
    names = (f"the {force}", "its command") if channel == "torque" else ("the command", "the twin's")
    return Pair(followed, signal, signal - before, signal - after, names, drive)


def _change(axis: Axes, pair: Pair, view: View) -> None:
    """Draw the signals at the fastest change of the one that is followed."""
    run = view.run
    rate = np.abs(motion(pair.followed, run.period_s, SMOOTH_S).velocity)
    if pair.unit == "m":  # positions: their speed is shown, at its fastest change
        pair = pair._replace(
            **{name: motion(getattr(pair, name), run.period_s, SMOOTH_S).velocity for name in pair._fields[:4]},
            unit="m/s",
        )
        rate = np.abs(motion(pair.followed, run.period_s, SMOOTH_S).velocity)
    rows = around(int(np.argmax(rate[run.evaluated])) + run.evaluated.start, run, STEEPEST_S)
    factor, unit = reading_unit(pair.unit, float(np.abs(pair.signal[rows]).max()))
    for values, colour, look, label in (
        (pair.signal, MEASURED, {"linewidth": 2.6, "alpha": 0.5}, "measured"),
        (pair.before, COMMAND, {"linewidth": 1.0}, "twin before"),
        (pair.after, SIMULATED, {"linewidth": 1.2}, "twin after"),
    ):
        axis.plot(run.time_s[rows], factor * values[rows], color=colour, label=label, **look)
    name = pair.names[0].removeprefix("the ").replace("position", "speed")
    style_axis(axis, f"{name} [{unit}]", "time [s]")
