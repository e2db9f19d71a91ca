"""Figure of a delay or a lag: cross-correlation of a signal with the one it follows, and both at a fast change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from hil.arrays import FloatArray
from hil.diagnosis.pictures import looks
from hil.diagnosis.pictures.view import Captioned, View, around, longest
from hil.figures.drawing import WIDTH_IN, Drawing, legend_outside, style_axis
from hil.figures.panels import NOISE
from hil.identification.derivatives import motion
from hil.identification.terms import Term
from hil.quantities import reading_unit
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
    figure = Drawing(WIDTH_IN, 6.0)
    mosaic = figure.subplot_mosaic([["peak", "left"], ["change", "change"]])
    factor, unit = reading_unit("s", float(found.lag_s[-1]))
    looks.twin(mosaic["peak"], factor * fine.lag_s, fine.before, "before")
    looks.twin(mosaic["peak"], factor * fine.lag_s, fine.after, "after")
    looks.points(mosaic["peak"], factor * found.lag_s, found.measured, found.error)
    name, of = pair.names
    style_axis(mosaic["peak"], "cross-correlation", f"lag of {name}\nbehind {of} [{unit}]")
    mosaic["left"].axhspan(-BAND * found.error, BAND * found.error, color=NOISE, alpha=0.35, label="99 % of chance")
    looks.twin(mosaic["left"], factor * found.lag_s, found.measured - found.before, "before")
    looks.twin(mosaic["left"], factor * found.lag_s, found.measured - found.after, "after")
    style_axis(mosaic["left"], "measured - twin", f"lag [{unit}]")
    _change(mosaic["change"], pair, view)
    legend_outside(figure, mosaic.values(), 5)
    return Captioned(
        figure,
        f"Cross-correlation of the rate of {name} with that of {of}: a delay moves its peak, a lag bends it. Right: "
        "what each twin leaves of it, with the band of chance. Below: both at the fastest change.",
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
    measured, before, after = (
        finer * np.fft.irfft(np.conj(spectra[0]) * other, finer * size)[lags] / scale for other in spectra[1:]
    )
    # variance of the cross-correlation of two independent signals (Bartlett): of the residual that has neither the
    # shape of the signal nor of a delay of it, and of the signal
    shapes = np.stack([rates[0], np.gradient(rates[0])])
    left = rates[1] - rates[3]
    left = left - np.linalg.lstsq(shapes.T, left, rcond=None)[0] @ shapes
    power = np.sum(np.abs(spectra[0]) ** 2 * np.abs(np.fft.rfft(left, size)) ** 2) * 2.0 / size / left.size
    return Correlation(lags * run.period_s / finer, measured, before, after, float(np.sqrt(power)) / scale)


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
    signals, unit = [pair.followed, pair.signal, pair.before, pair.after], pair.unit
    rates = [motion(values, run.period_s, SMOOTH_S).velocity for values in signals]
    if unit == "m":  # of positions the speed is shown, at its fastest change
        signals, unit = rates, "m/s"
        rates = [motion(values, run.period_s, SMOOTH_S).velocity for values in signals]
    rows = around(int(np.argmax(np.abs(rates[0])[run.evaluated])) + run.evaluated.start, run, STEEPEST_S)
    factor, unit = reading_unit(unit, float(np.abs(signals[1][rows]).max()))
    measured, before, after = (factor * values[rows] for values in signals[1:])
    looks.trace(axis, run.time_s[rows], measured)
    looks.twin(axis, run.time_s[rows], before, "before")
    looks.twin(axis, run.time_s[rows], after, "after")
    name = pair.names[0].removeprefix("the ").replace("position", "speed")
    style_axis(axis, f"{name} [{unit}]", "time [s]")
