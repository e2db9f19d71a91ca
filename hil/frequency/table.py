"""Results of a frequency response as rows of a table: measured, standard error, twin."""

from __future__ import annotations

from math import isfinite, nan
from typing import TYPE_CHECKING

from hil.frequency.margins import StabilityMargins
from hil.quantities import digits, with_error

if TYPE_CHECKING:
    from hil.frequency.result import FrequencyResponse

HEADERS = ("", "measured", "standard error", "twin")
_LOOPS = {"position": "position loop", "velocity": "velocity loop"}


def rows_of(result: FrequencyResponse) -> list[tuple[str, str, str, str]]:
    """Bandwidths, margins, first antiresonance and resonance: name with unit, measured, standard error, twin."""
    rows = [
        _row("first antiresonance [Hz]", result.resonances.antiresonance_hz, result.twin_resonances.antiresonance_hz),
        _row("first resonance [Hz]", result.resonances.resonance_hz, result.twin_resonances.resonance_hz),
    ]
    for loop, title in _LOOPS.items():
        if f"{loop}_open" not in result.margins:
            continue
        one, twin = result.margins[f"{loop}_open"], result.twin_margins[f"{loop}_open"]
        closed = f"{loop}_closed"
        rows.append(_row(f"{title}: bandwidth [Hz]", result.bandwidth_hz[closed], result.twin_bandwidth_hz[closed]))
        rows += _of_margins(title, one, twin)
    return rows


def _of_margins(title: str, one: StabilityMargins, twin: StabilityMargins) -> list[tuple[str, str, str, str]]:
    rows = [
        _row(f"{title}: gain margin [dB]", one.gain_db, twin.gain_db, one.gain_std_db),
        _row(f"{title}: phase margin [deg]", one.phase_deg, twin.phase_deg, one.phase_std_deg),
        _row(f"{title}: delay margin [ms]", 1e3 * one.delay_s, 1e3 * twin.delay_s, 1e3 * one.delay_std_s),
        _row(f"{title}: modulus margin", one.modulus, twin.modulus, one.modulus_std),
        _row(f"{title}: crossover [Hz]", one.crossover_hz, twin.crossover_hz),
    ]
    if isfinite(one.gain_down_db) or isfinite(twin.gain_down_db):
        rows.insert(1, _row(f"{title}: gain margin downwards [dB]", one.gain_down_db, twin.gain_down_db))
    return rows


def _row(name: str, measured: float, twin: float, error: float = nan) -> tuple[str, str, str, str]:
    value, deviation = with_error(measured, error) if isfinite(error) else (_text(measured), "–")
    return name, value if isfinite(measured) else "–", deviation, _text(twin)


def _text(value: float) -> str:
    return digits(value, 4) if isfinite(value) else "–"


def range_text(low_hz: float, high_hz: float) -> str:
    """A range of frequencies, such as "1 to 458 Hz"."""
    return f"{low_hz:.3g} to {high_hz:.3g} Hz"


def verdict(result: FrequencyResponse) -> str:
    """Where the measurement can be trusted, and how stable the loops are, in some sentences."""
    how = "laps" if result.method == "periods" else "segments"
    parts = [f"The plant is known to a tenth from {range_text(*result.trusted_hz)} ({result.averages:.3g} {how})."]
    if result.distorted:
        parts.append("Friction distorts it: the axis stops in the excitation.")
    for loop, title in _LOOPS.items():
        one = result.margins.get(f"{loop}_open")
        if one is None:
            continue
        width = result.bandwidth_hz[f"{loop}_closed"]
        told = [f"bandwidth {digits(width)} Hz"] if isfinite(width) else []
        told += [f"phase margin {digits(one.phase_deg)}°"] if isfinite(one.phase_deg) else []
        told += [f"gain margin {digits(one.gain_db)} dB"] if isfinite(one.gain_db) else []
        told += [f"modulus margin {digits(one.modulus, 2)}"] if isfinite(one.modulus) else []
        if told:
            parts.append(f"{title.capitalize()}: {', '.join(told)}.")
    return " ".join(parts)


def as_text(result: FrequencyResponse) -> str:
    """The result as a few lines."""
    rows = [(name, measured, twin) for name, measured, _, twin in rows_of(result) if "crossover" not in name]
    lines = [f"  {name:42} {measured:>10} {twin:>10}" for name, measured, twin in rows]
    return "\n".join(
        [f"Frequency response of {result.name} beside the twin of {result.bench}: {verdict(result)}", *lines]
    )
