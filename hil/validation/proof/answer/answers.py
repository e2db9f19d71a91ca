"""Read the scored parts of diagnosis.json, written by the diagnosis or by another method.

Only `verdict` and the ids in `missing` are required; figures that a method does not give are not scored.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from hil.errors import HilError
from hil.twin.library import names_of
from hil.twin.parameter import Role
from hil.validation.proof.answer.blind import DIAGNOSIS, ERROR, answered

FAILED, ABSENT = "error", "no_answer"  # verdicts beside those of a diagnosis


@dataclass(frozen=True)
class Named:
    """A named mechanism: parameters are (value, standard error)."""

    effect: str
    equivalents: tuple[str, ...] = ()
    confidence: float | None = None
    parameters: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def reported(self) -> frozenset[str]:
        """The set of reported ids: the name and its equivalents."""
        return frozenset({self.effect, *self.equivalents})

    def values(self, role: Role) -> list[float]:
        """Return the values of the parameters with a role."""
        return [self.parameters[name][0] for name in names_of(role) if name in self.parameters]


@dataclass(frozen=True)
class Place:
    """The scored part of the location of a mismatch."""

    block: str | None = None
    windows_s: tuple[tuple[float, float], ...] = ()
    frequency_hz: float | None = None
    period_m: float | None = None
    order_per_rev: float | None = None


@dataclass(frozen=True)
class Answer:
    """An answer. `over_floor`: residual over noise, held out, in the worst channel; `moment_s`: of a change."""

    verdict: str
    named: tuple[Named, ...] = ()
    location: Place = Place()
    not_testable: tuple[str, ...] = ()
    nominal: dict[str, tuple[float, float]] = field(default_factory=dict)
    over_floor: float | None = None
    runtime_s: float | None = None
    statement: str = ""
    moment_s: float | None = None


def read_answers(folder: Path, names: Iterable[str]) -> dict[str, Answer]:
    """Read the answers in folder/NAME/diagnosis.json of cases that have one; raises HilError for an invalid one."""
    return {name: _read(folder / name) for name in names if answered(folder / name)}


def parse_answer(data: dict[str, Any]) -> Answer:
    """Return the answer of a diagnosis.json."""
    location = data.get("location") or {}
    return Answer(
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
        location=Place(**{known.name: location[known.name] for known in fields(Place) if known.name in location}),
        not_testable=tuple(data.get("not_testable", ())),
        nominal=_estimates(data.get("parameter_corrections", {})),
        over_floor=_over_floor(data.get("fit", {})),
        runtime_s=data.get("runtime_s"),
        statement=data.get("statement", ""),
        moment_s=(data.get("change") or {}).get("moment_s"),
    )


def _read(place: Path) -> Answer:
    path = place / DIAGNOSIS
    try:
        if not path.exists():
            failure = json.loads((place / ERROR).read_text(encoding="utf-8"))
            return Answer(FAILED, statement=f"{failure['kind']}: {failure['error']}")
        return parse_answer(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise HilError(
            f"{path}: cannot be read as an answer ({type(error).__name__}: {error}); remove the folder to "
            "have the case diagnosed again"
        ) from None


def _confidence(given: float | None) -> float | None:
    if given is not None and not 0.0 <= given <= 1.0:
        raise ValueError(f"confidence: given {given}, allowed 0 to 1")
    return given


def _estimates(found: dict[str, Any]) -> dict[str, tuple[float, float]]:
    return {name: (entry["value"], entry["std"]) for name, entry in found.items()}


def _over_floor(fit: dict[str, Any]) -> float | None:
    held_out = (entry["validate"] for entry in fit.values() if entry.get("validate"))
    return max((entry["after_rms"] / max(entry["noise_floor_rms"], 1e-300) for entry in held_out), default=None)
