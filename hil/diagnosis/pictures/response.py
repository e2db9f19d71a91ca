"""Figure of a mode: frequency response of the axis with its coherence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.signal import csd, welch

from hil.arrays import FloatArray
from hil.diagnosis.pictures import looks
from hil.diagnosis.pictures.view import Captioned, View
from hil.figures.drawing import WIDTH_IN, Drawing, legend_outside, style_axis
from hil.figures.panels import DEVIATION, MEASURED
from hil.identification.residual_scales import inertia
from hil.quantities import digits
from hil.twin.library import BY_ID
from hil.twin.parameter import Role

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

SEGMENT_CYCLES = 12  # of the mode in a segment: resolves its peak
LEAST_COHERENCE = 0.2  # of a point: below, its error is its value
BEYOND = 4.0  # highest frequency drawn, over that of the mode


class ResponseEstimate(NamedTuple):
    """Frequencies (m,) [Hz], gain (m,) of the axis, coherence (m,), and standard error (m,) of the gain."""

    frequency_hz: FloatArray
    gain: FloatArray
    coherence: FloatArray
    error: FloatArray


def frequency_response(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw the gain from the motor to the table, or from the torque to the motor, and the coherence."""
    term = views[0].term
    mode_hz = BY_ID[term.effect].named(Role.FREQUENCY, term.values) or 1.0 / (20.0 * views[0].run.period_s)
    found = {which: response(diagnosis, views, mode_hz, which) for which in ("measured", "before", "after")}
    figure = Drawing(WIDTH_IN, 5.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.4))
    looks.twin(above, found["before"].frequency_hz, found["before"].gain, "before")
    looks.twin(above, found["after"].frequency_hz, found["after"].gain, "after")
    one = found["measured"]
    told = one.coherence > LEAST_COHERENCE
    looks.points(above, one.frequency_hz[told], one.gain[told], one.error[told])
    above.axvline(mode_hz, color=DEVIATION, linewidth=1.0, linestyle=":", label=f"{digits(mode_hz)} Hz")
    above.set_yscale("log")
    drawn = np.concatenate([each.gain for each in found.values()])
    above.set_ylim(0.5 * float(drawn.min()), 2.0 * float(drawn.max()))
    below.plot(one.frequency_hz, one.coherence, ".-", color=MEASURED, linewidth=1.0)
    below.set_ylim(0.0, 1.05)
    from_to = "table / motor" if views[0].has_table else "inertia × acceleration / torque"
    style_axis(above, f"{from_to} [1]")
    style_axis(below, "coherence [1]", "frequency [Hz]")
    legend_outside(figure, (above,), 5)
    return Captioned(
        figure,
        f"Frequency response, {from_to}: the measured one with two standard errors, and those of the "
        "twins before and after on the same motion. Where the coherence is low the motion tells nothing.",
    )


def response(diagnosis: Diagnosis, views: Sequence[View], mode_hz: float, which: str) -> ResponseEstimate:
    """Estimate the response (H1, Welch) of the measurement, or of the twin before or after, on the measured input."""
    period_s = views[0].run.period_s
    segment = round(SEGMENT_CYCLES / mode_hz / period_s)
    segment = max(min(segment, min(view.run.motor.size for view in views) // 4), 32)
    sums, segments = [np.zeros(segment // 2 + 1, dtype=complex) for _ in range(5)], 0.0
    for view in views:
        given, answer, left = _signals(diagnosis, view, which)
        count = 2.0 * given.size / segment - 1.0
        settings = {"fs": 1.0 / period_s, "nperseg": segment}
        powers = [csd(one, other, **settings)[1] for one, other in ((given, answer), (given, left))]
        powers += [welch(one, **settings)[1] for one in (given, answer, left)]
        sums = [total + count * power for total, power in zip(sums, powers, strict=True)]
        segments += count
    crossed, crossed_left, (of_given, of_answer, of_left) = (
        sums[0],
        sums[1],
        (np.maximum(s.real, 1e-300) for s in sums[2:]),
    )
    frequency_hz = np.arange(segment // 2 + 1, dtype=np.float64) / (segment * period_s)
    coherence = np.abs(crossed) ** 2 / (of_given * of_answer)
    # error of the response by what the final twin leaves beside its own share in the input (Bendat and Piersol);
    # segments overlap by half: with a Hann window 11/18 of them count as independent (Welch 1967)
    beside = np.maximum(of_left - np.abs(crossed_left) ** 2 / of_given, 0.0)
    error = np.sqrt(beside / of_given / max(2.0 * segments * 11.0 / 18.0, 1.0))
    rows = slice(1, max(int(np.searchsorted(frequency_hz, BEYOND * mode_hz)), 4))
    gain = np.abs(crossed) / of_given
    return ResponseEstimate(frequency_hz[rows], gain[rows], coherence[rows], error[rows])


def _signals(diagnosis: Diagnosis, view: View, which: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Input, answer, and what the final twin leaves of it (n,): accelerations, or torques without a table."""
    run, rows = view.run, view.run.evaluated
    channel = "table" if view.has_table else "motor"
    before, after = view.residuals(channel)
    off = {"before": before, "after": after}.get(which, np.zeros(before.size))
    if channel == "table":
        signals = diagnosis.given_bench.axis.ratio_m_rad * run.motor, run.table_m - off, after
        given, answer, left = (np.diff(values, 2)[rows] / run.period_s**2 for values in signals)
        return given, answer, left
    answer = inertia(diagnosis.final.bench) * np.gradient(view.torque.velocity, run.period_s)
    return run.torque[rows], (answer - off)[rows], after[rows]
