"""Figure of a mode: frequency response of the axis with its coherence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import csd, welch

from hil.arrays import FloatArray
from hil.diagnosis.pictures.view import Captioned, View
from hil.figures.drawing import WIDTH_IN, legend_above, style_axis
from hil.figures.panels import COMMAND, DEVIATION, MEASURED, SIMULATED
from hil.identification.residual_scales import inertia
from hil.quantities import digits
from hil.twin.library import BY_ID
from hil.twin.parameter import Role

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

SEGMENT_CYCLES = 12  # of the mode in a segment: resolves its peak
LEAST_COHERENCE = 0.2  # of a point: below, its error is its value
BEYOND = 4.0  # highest frequency drawn, over that of the mode


class Response(NamedTuple):
    """Frequencies (m,) [Hz], gain (m,) of the axis, coherence (m,), and relative standard error (m,) of the gain."""

    frequency_hz: FloatArray
    gain: FloatArray
    coherence: FloatArray
    error: FloatArray


def frequency_response(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw the gain from the motor to the table, or from the torque to the motor, and the coherence."""
    term = views[0].term
    mode_hz = BY_ID[term.effect].named(Role.FREQUENCY, term.values) or 1.0 / (20.0 * views[0].run.period_s)
    found = {which: response(diagnosis, views, mode_hz, which) for which in ("measured", "before", "after")}
    figure = Figure(figsize=(WIDTH_IN, 5.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.4))
    for which, colour, width in (("before", COMMAND, 1.2), ("after", SIMULATED, 1.8)):
        one = found[which]
        above.plot(one.frequency_hz, one.gain, color=colour, linewidth=width, label=f"twin {which}")
    one = found["measured"]
    told = one.coherence > LEAST_COHERENCE
    look = {"fmt": "o", "color": MEASURED, "markersize": 4, "linewidth": 1.0, "label": "measured"}
    above.errorbar(one.frequency_hz[told], one.gain[told], 2.0 * (one.gain * one.error)[told], **look)
    above.axvline(mode_hz, color=DEVIATION, linewidth=1.0, linestyle=":", label=f"{digits(mode_hz)} Hz")
    above.set_yscale("log")
    drawn = np.concatenate([each.gain for each in found.values()])
    above.set_ylim(0.5 * float(drawn.min()), 2.0 * float(drawn.max()))
    below.plot(one.frequency_hz, one.coherence, ".-", color=MEASURED, linewidth=1.0)
    below.set_ylim(0.0, 1.05)
    from_to = "table / motor" if "table" in views[0].before else "inertia × acceleration / torque"
    style_axis(above, f"{from_to} [1]")
    style_axis(below, "coherence [1]", "frequency [Hz]")
    legend_above(above)
    return Captioned(
        figure,
        f"Frequency response, {from_to}: the measured one with two standard errors (Bendat and Piersol), and that of "
        "the twins before and after on the same motion. Where the coherence is low the motion tells nothing.",
    )


def response(diagnosis: Diagnosis, views: Sequence[View], mode_hz: float, which: str) -> Response:
    """Estimate the response (H1, Welch) of the measurement, or of the twin before or after, on the measured input."""
    period_s = views[0].run.period_s
    segment = round(SEGMENT_CYCLES / mode_hz / period_s)
    segment = max(min(segment, min(view.run.motor.size for view in views) // 4), 32)
    sums, segments = [np.zeros(segment // 2 + 1, dtype=complex) for _ in range(3)], 0.0
    for view in views:
        given, answer = _signals(diagnosis, view, which)
        count = 2.0 * given.size / segment - 1.0
        settings = {"fs": 1.0 / period_s, "nperseg": segment}
        powers = csd(given, answer, **settings)[1], welch(given, **settings)[1], welch(answer, **settings)[1]
        sums = [total + count * power for total, power in zip(sums, powers, strict=True)]
        segments += count
    frequency_hz = np.fft.rfftfreq(segment, period_s)
    coherence = np.abs(sums[0]) ** 2 / np.maximum((sums[1] * sums[2]).real, 1e-300)
    # segments overlap by half: with a Hann window 11/18 of them count as independent (Welch 1967)
    error = np.sqrt((1.0 - coherence) / np.maximum(2.0 * coherence * segments * 11.0 / 18.0, 1e-300))
    rows = slice(1, max(int(np.searchsorted(frequency_hz, BEYOND * mode_hz)), 4))
    gain = np.abs(sums[0] / np.maximum(sums[1].real, 1e-300))
    return Response(frequency_hz[rows], gain[rows], coherence[rows], error[rows])


def _signals(diagnosis: Diagnosis, view: View, which: str) -> tuple[FloatArray, FloatArray]:
    """Input and answer (n,) as accelerations, or as torques where the table has no encoder."""
    run, rows = view.run, view.run.evaluated
    channel = "table" if "table" in view.before else "motor"
    left = dict(zip(("before", "after"), view.residuals(channel), strict=True)).get(which, np.zeros(run.motor.size))
    if channel == "table":
        pair = diagnosis.given_bench.axis.ratio_m_rad * run.motor, run.table_m - left
        given, answer = (np.diff(values, 2) / run.period_s**2 for values in pair)
        return given[rows], answer[rows]
    given, answer = run.torque[1:-1], inertia(diagnosis.final.bench) * np.diff(run.motor, 2) / run.period_s**2
    return given[rows], (answer - left[1:-1])[rows]
