"""Report of `hil frf`: the table, Bode diagrams of plant and loops, and the numbers."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from hil.figures.drawing import save
from hil.files.output import write_json
from hil.frequency.curves import ResponseCurve
from hil.frequency.picture import PAIRS, bode
from hil.frequency.result import FrequencyResponse
from hil.frequency.table import HEADERS, range_text, rows_of, verdict
from hil.report.page import Page

SCHEMA_VERSION = 1
_CAPTIONS = (
    ("plant", "Plant", "Motor torque to motor and to table. The torque is held for a tick, by both alike."),
    (
        "open_loops",
        "Open loops and their margins",
        "The velocity loop with the position loop open, and the position loop around it, cut at its input. Dotted: "
        "0 dB, -180°, crossover with its phase margin (PM), gain margin (GM), and, if another crossing of 0 dB bears "
        "less, the delay margin (DM) of the measured loop.",
    ),
    ("closed_loops", "Closed loops", "Velocity set-point to motor velocity; position set-point to position."),
)


class FurtherPicture(NamedTuple):
    """A picture of another origin: its file and caption."""

    path: Path
    caption: str


def write_frf(
    result: FrequencyResponse, folder: Path, further_heading: str = "", further: Sequence[FurtherPicture] = ()
) -> None:
    """Write frf.html, its PNGs and frf.json to a folder; further pictures come last, under their heading."""
    page = Page(
        f"Frequency response of {result.name}",
        f"beside the twin of {result.bench}; lines {result.resolution_hz:.3g} Hz apart, "
        f"{result.averages:.3g} independent {'laps' if result.method == 'periods' else 'segments'}",
        verdict(result),
        not result.distorted,
    )
    page.table(HEADERS, rows_of(result))
    if result.notes:
        page.items(result.notes)
    for (name, heading, caption), pair in zip(_CAPTIONS, PAIRS, strict=True):
        if any(one in result.measured for one in pair):
            page.heading(heading)
            page.picture(save(bode(result, pair), folder / f"{name}.png"), caption)
    if further:
        page.heading(further_heading)
        for path, text in further:
            page.picture(path, text)
    page.heading("How it was measured")
    page.text(
        "Torque and positions answer to the set-points, which no noise of a sensor reaches; the plant is the quotient "
        "of two answers, so that the closed loop does not bias it (joint input-output estimate, H1). "
        + (
            "Mean and covariance of the answers are those from lap to lap."
            if result.method == "periods"
            else "The answers are Welch's, of Hann segments that overlap by a half."
        )
    )
    page.table(
        ("response", "trustworthy", "lines"),
        [
            [one.title, range_text(*one.trusted_hz) if one.trusted.any() else "nowhere", str(int(one.trusted.sum()))]
            for one in result.measured.values()
        ],
        left=(0, 1),
    )
    page.text(
        "Trustworthy: standard error below a tenth (0.9 dB, 6°). Bars: 95 % bounds of magnitude and phase. Coherence: "
        "of torque and position with the set-points, the smaller one."
    )
    write_json(folder / "frf.json", as_json(result))
    page.write(folder / "frf.html")


def as_json(result: FrequencyResponse) -> dict[str, Any]:
    """Content of frf.json. Frequencies in Hz; what is not known is null."""
    whole = {
        "schema_version": SCHEMA_VERSION,
        "recording": result.name,
        "bench": result.bench,
        "method": result.method,
        "averages": result.averages,
        "resolution_hz": result.resolution_hz,
        "trusted_hz": list(result.trusted_hz),
        "distorted": result.distorted,
        "notes": list(result.notes),
    }
    for side, curves, margins, widths, resonances in (
        ("measured", result.measured, result.margins, result.bandwidth_hz, result.resonances),
        ("twin", result.twin, result.twin_margins, result.twin_bandwidth_hz, result.twin_resonances),
    ):
        whole[side] = {
            "first_antiresonance_hz": resonances.antiresonance_hz,
            "first_resonance_hz": resonances.resonance_hz,
            "bandwidth_hz": dict(widths),
            "margins": {name: asdict(one) for name, one in margins.items()},
            "responses": {name: _curve(one, side == "measured") for name, one in curves.items()},
        }
    return _known(whole)  # type: ignore[no-any-return]


def _curve(one: ResponseCurve, measured: bool) -> dict[str, Any]:
    curve = {
        "title": one.title,
        "unit": one.unit,
        "frequency_hz": one.frequency_hz.tolist(),
        "real": one.response.real.tolist(),
        "imaginary": one.response.imag.tolist(),
    }
    if measured:
        curve |= {
            "std_error": one.std_error.tolist(),
            "radius_95": one.radius,
            "coherence": one.coherence.tolist(),
            "trusted": one.trusted.tolist(),
            "trusted_hz": list(one.trusted_hz),
        }
    return curve


def _known(value: Any) -> Any:
    """The same data with null for what is not a number."""
    if isinstance(value, dict):
        return {key: _known(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_known(one) for one in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
