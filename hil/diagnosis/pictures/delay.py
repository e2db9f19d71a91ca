"""Figure of a delay or a lag: a signal behind the one that it follows.

Cross-correlation over the lag; the difference from the twin over the rate, where a delay is a straight line whose slope
is minus the delay; and both signals at the fastest change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from hil.arrays import FloatArray
from hil.diagnosis.pictures import looks
from hil.diagnosis.pictures.fitted_law import FINE, FittedRows, bin_edges, means
from hil.diagnosis.pictures.view import Captioned, View, around, longest, unit_of_channel
from hil.diagnosis.turning import speed_unit
from hil.figures.drawing import WIDTH_IN, Drawing, legend_outside, style_axis
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
BINS = 16  # of the rate


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
    """Draw the cross-correlation of the rates of two signals, the difference from the twin over the rate, a change."""
    view = longest(views)
    pair = _pair(diagnosis, view)
    found, fine = (correlation(pair, view, finer) for finer in (1, FINER))
    figure = Drawing(WIDTH_IN, 6.0)
    mosaic = figure.subplot_mosaic([["peak", "rate"], ["change", "change"]])
    factor, unit = reading_unit("s", float(found.lag_s[-1]))
    looks.twin(mosaic["peak"], factor * fine.lag_s, fine.before, "before")
    looks.twin(mosaic["peak"], factor * fine.lag_s, fine.after, "after")
    looks.points(mosaic["peak"], factor * found.lag_s, found.measured, found.error)
    name, of = pair.names
    style_axis(mosaic["peak"], "cross-correlation", f"lag of {name}\nbehind {of} [{unit}]")
    turns = diagnosis.given_bench.axis.turns
    _over_rate(mosaic["rate"], pair, view, turns)
    _change(mosaic["change"], pair, view, turns)
    legend_outside(figure, mosaic.values(), 5)
    return Captioned(
        figure,
        f"Cross-correlation of the rate of {name} with that of {of}: a delay moves its peak, a lag bends it. Right: "
        "what the twin without this effect leaves, over the rate: of a delay a straight line, steep if it is long. "
        "Below: both at the fastest change.",
    )


def _over_rate(axis: Axes, pair: Pair, view: View, turns: bool) -> None:
    """Draw the difference from the twin over the rate of what the signal follows: a line, and the points of it."""
    rate = motion(pair.followed, view.run.period_s, SMOOTH_S).velocity
    used = np.zeros(rate.size, dtype=np.bool_)
    used[view.run.evaluated] = True
    after = pair.signal - pair.after
    after = after - float(np.mean(after[used]))
    slope = float(np.polyfit(rate[used], (pair.after - pair.before)[used], 1)[0])
    rows = [FittedRows(rate, np.ones(rate.size), pair.signal - pair.before, after, used)]
    edges = bin_edges(rows, BINS)
    seen = means(rows, edges)
    factor, unit = reading_unit(pair.unit, abs(slope) * float(np.abs(edges).max()))
    to_read, per_s = speed_unit(turns) if pair.unit in ("m", "rad") else (1.0, f"{pair.unit}/s")
    fine = np.linspace(edges[0], edges[-1], FINE)
    looks.law(axis, to_read * fine, factor * slope * fine)
    looks.points(axis, to_read * seen.x, factor * (slope * seen.x + seen.after), factor * seen.error)
    style_axis(axis, f"measured - twin [{unit}]", f"rate of {pair.names[1]} [{per_s}]")


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
        ratio, unit = diagnosis.given_bench.axis.ratio_m_rad, unit_of_channel(diagnosis, channel)
        names = "the table position", "the motor position"
        return Pair(ratio * run.motor, run.table_m, run.table_m - before, run.table_m - after, names, unit)
    if channel == "motor":
        shown = run.torque + before
        names = f"the {force} on the motor", f"the measured {force}"
        return Pair(run.torque, shown, shown - before, shown - after, names, drive)
    signal = run.torque if channel == "torque" else run.torque_command
    followed = run.torque_command if channel == "torque" else signal - before
    names = (f"the {force}", "its command") if channel == "torque" else ("the command", "the twin's")
    return Pair(followed, signal, signal - before, signal - after, names, drive)


def _change(axis: Axes, pair: Pair, view: View, turns: bool) -> None:
    """Draw the signals at the fastest change of the one that is followed."""
    run = view.run
    signals, unit = [pair.followed, pair.signal, pair.before, pair.after], pair.unit
    rates = [motion(values, run.period_s, SMOOTH_S).velocity for values in signals]
    position = unit in ("m", "rad")
    if position:  # of positions the speed is shown, at its fastest change
        signals, rates = rates, [motion(values, run.period_s, SMOOTH_S).velocity for values in rates]
    rows = around(int(np.argmax(np.abs(rates[0])[run.evaluated])) + run.evaluated.start, run, STEEPEST_S)
    factor, unit = speed_unit(turns) if position else reading_unit(unit, float(np.abs(signals[1][rows]).max()))
    measured, before, after = (factor * values[rows] for values in signals[1:])
    looks.trace(axis, run.time_s[rows], measured)
    looks.twin(axis, run.time_s[rows], before, "before")
    looks.twin(axis, run.time_s[rows], after, "after")
    name = pair.names[0].removeprefix("the ").replace("position", "speed")
    style_axis(axis, f"{name} [{unit}]", "time [s]")
