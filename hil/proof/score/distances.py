"""How far what was said is from the truth: numbers, phases, windows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import pi, remainder


def difference(name: str, value: float, true: float) -> float:
    """Size of the difference of a parameter from its true value; phases [rad] go round."""
    return abs(remainder(value - true, 2.0 * pi)) if name.startswith("phase") else abs(value - true)


def relative_error(name: str, value: float, known: Mapping[str, float]) -> float:
    """Relative error of a parameter, whose true values are `known`.

    A harmonic counts by its amplitude: its error is relative to the first amplitude, that of its phase [rad] is
    weighted with its own.
    """
    off = difference(name, value, known[name])
    first = next((size for other, size in known.items() if other.startswith("amplitude")), 0.0)
    if name.startswith("phase"):
        own = known.get(name.replace("phase", "amplitude").replace("_rad", "_m"), first)
        return off * (own / first if first else 1.0)
    scale = first if name.startswith("amplitude") else abs(known[name])
    return off / scale if scale else float(off > 0.0)


def overlap(windows: Iterable[Sequence[float]], begin: float, end: float) -> float:
    """Intersection over union of windows (begin, end), which may overlap each other, and the true one, from `begin` to
    `end`."""
    said = _merged(windows)
    common = sum(max(min(b, end) - max(a, begin), 0.0) for a, b in said)
    return common / (end - begin + sum(b - a for a, b in said) - common)


def _merged(windows: Iterable[Sequence[float]]) -> list[tuple[float, float]]:
    """Windows (begin, end) in order, those that overlap as one."""
    found: list[tuple[float, float]] = []
    for begin, end in sorted((begin, end) for begin, end in windows):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], end)
        else:
            found.append((begin, end))
    return found
