"""Tables and JSON of measured figures, and their comparison with those of an earlier run."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from hil.errors import InputError
from hil.validation.benchmarks.figure import Figure

WIDTH = 80  # columns of a usual terminal
HEADERS = ("figure", "measured", "target", "beside", "", "ratio")
AGAINST_HEADERS = ("figure", "then", "now", "ratio")
LEGEND = (
    "us: microseconds; x: times real time. ratio: how many times as fast as what stands beside it, measured in the "
    "same run: another tool at the same task, or (alone) a part of the task that no code around it can undercut."
)
_UNITS = {"x real time": "x"}


def rows(figures: Sequence[Figure]) -> list[tuple[str, ...]]:
    """Rows of the table with `HEADERS`: a line for each reference of a figure, one for a figure without."""
    lines: list[tuple[str, ...]] = []
    for figure in figures:
        own = (figure.label, number(figure.value, figure.unit), _target(figure))
        for reference in figure.beside:
            ratio = number(figure.times_as_fast(reference.value))
            lines.append((*own, reference.name, number(reference.value, figure.unit), ratio))
            own = ("", "", "")
        if not figure.beside:
            lines.append((*own, "", "", ""))
    return lines


def notes(figures: Sequence[Figure]) -> list[str]:
    """Legend, missed targets, and how each figure was measured, in lines of at most `WIDTH` columns."""
    labels: dict[str, list[str]] = {}
    for figure in figures:
        labels.setdefault(figure.detail, []).append(figure.label)
    missed = [figure.label for figure in figures if figure.met is False]
    texts = [LEGEND, f"targets missed: {'; '.join(missed) or 'none'}"]
    texts += [f"{_together(named)}: {detail}" for detail, named in labels.items() if detail]
    return [wrapped(text) for text in texts]


def wrapped(text: str) -> str:
    """Break a text into lines of at most `WIDTH` columns, the later ones indented."""
    return fill(text, WIDTH, subsequent_indent="  ")


def as_data(figures: Sequence[Figure]) -> list[dict[str, Any]]:
    """Figures as JSON holds them."""
    return [
        vars(figure)
        | {
            "met": figure.met,
            "beside": [
                reference._asdict() | {"ratio": figure.times_as_fast(reference.value)} for reference in figure.beside
            ],
        }
        for figure in figures
    ]


def read_earlier(path: Path) -> dict[str, float]:
    """Values by name of the figures in the JSON of an earlier run. Raises InputError for a file that is none."""
    try:
        figures = json.loads(path.read_text(encoding="utf-8"))["figures"]
        return {str(figure["name"]): float(figure["value"]) for figure in figures if figure["value"] is not None}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the --out file of an earlier run") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{path}: no figures in it; give the --out file of an earlier `hil bench`") from None


def against(figures: Sequence[Figure], earlier: dict[str, float]) -> list[dict[str, Any]]:
    """Figures that the earlier run has too: name, label, value then and now, and the ratio (above 1: faster now)."""
    return [
        {
            "name": figure.name,
            "label": figure.label,
            "unit": figure.unit,
            "then": earlier[figure.name],
            "now": figure.value,
            "ratio": figure.times_as_fast(earlier[figure.name]),
        }
        for figure in figures
        if figure.name in earlier
    ]


def against_rows(compared: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Rows of the table with `AGAINST_HEADERS`."""
    return [
        (one["label"], number(one["then"], one["unit"]), number(one["now"], one["unit"]), f"{one['ratio']:.3f}")
        for one in compared
    ]


def number(value: float, unit: str = "") -> str:
    """A value with three significant digits or more, thousands apart, and its unit as tables show it."""
    digits = 0 if value >= 100.0 else 1 if value >= 10.0 else 2
    text = "-" if math.isnan(value) else f"{value:,.{digits}f}".replace(",", " ")
    return f"{text} {_UNITS.get(unit, unit)}".strip()


def _together(labels: Sequence[str]) -> str:
    """Labels that share a note, without the part behind the last comma where they are several."""
    return "; ".join(dict.fromkeys(label.rpartition(", ")[0] if len(labels) > 1 else label for label in labels))


def _target(figure: Figure) -> str:
    if figure.target is None:
        return ""
    return f"{'≤' if figure.at_most else '≥'} {number(figure.target).removesuffix('.0')}"
