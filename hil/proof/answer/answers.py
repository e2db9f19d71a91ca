"""What a diagnosis, or another method, answered about a case: the parts of diagnosis.json that are scored.

Only `verdict` and the ids in `missing` are needed; what a method does not say is not scored.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil.errors import HilError
from hil.proof.answer.blind import DIAGNOSIS, ERROR, answered

FAILED, ABSENT = "error", "no_answer"  # verdicts beside those of a diagnosis


@dataclass(frozen=True)
class Named:
    """A mechanism that was named: parameters are (value, standard error)."""

    effect: str
    equivalents: tuple[str, ...] = ()
    confidence: float | None = None
    parameters: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def reported(self) -> frozenset[str]:
        """The set of ids that is reported: the name and what cannot be told from it."""
        return frozenset({self.effect, *self.equivalents})


@dataclass(frozen=True)
class Reply:
    """An answer. `over_floor`: residual over noise floor on held-out recordings, in the worst channel."""

    verdict: str
    named: tuple[Named, ...] = ()
    location: dict[str, Any] = field(default_factory=dict)
    not_testable: tuple[str, ...] = ()
    nominal: dict[str, tuple[float, float]] = field(default_factory=dict)
    over_floor: float | None = None
    runtime_s: float | None = None
    statement: str = ""


def read_replies(folder: Path, names: Iterable[str]) -> dict[str, Reply]:
    """Answers in folder/NAME/diagnosis.json for those cases that have one; raises HilError for one that cannot be
    read."""
    return {name: _read(folder / name) for name in names if answered(folder / name)}


def _read(place: Path) -> Reply:
    path = place / DIAGNOSIS
    try:
        if not path.exists():
            failure = json.loads((place / ERROR).read_text(encoding="utf-8"))
            return Reply(FAILED, statement=f"{failure['kind']}: {failure['error']}")
        return reply_of(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise HilError(
            f"{path}: cannot be read as an answer ({type(error).__name__}: {error}); remove the folder to "
            "have the case diagnosed again"
        ) from None


def reply_of(data: dict[str, Any]) -> Reply:
    """The answer that a diagnosis.json holds."""
    return Reply(
        verdict=data["verdict"],
        named=tuple(
            Named(
                found["effect"],
                tuple(found.get("equivalents", ())),
                _confidence(found.get("confidence")),
                _estimates(found.get("parameters", {})),
            )
            for found in data["missing"]
        ),
        location=data.get("location") or {},
        not_testable=tuple(data.get("not_testable", ())),
        nominal=_estimates(data.get("parameter_corrections", {})),
        over_floor=_over_floor(data.get("fit", {})),
        runtime_s=data.get("runtime_s"),
        statement=data.get("statement", ""),
    )


def _confidence(given: float | None) -> float | None:
    if given is not None and not 0.0 <= given <= 1.0:
        raise ValueError(f"confidence: given {given}, allowed 0 to 1")
    return given


def _estimates(found: dict[str, Any]) -> dict[str, tuple[float, float]]:
    return {name: (entry["value"], entry["std"]) for name, entry in found.items()}


def _over_floor(fit: dict[str, Any]) -> float | None:
    ratios = [
        entry["validate"]["after_rms"] / max(entry["validate"]["noise_floor_rms"], 1e-300)
        for entry in fit.values()
        if entry.get("validate")
    ]
    return max(ratios, default=None)
