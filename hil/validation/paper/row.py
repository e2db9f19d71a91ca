"""Comparison of a printed value with the computed one; its words are in rows.yaml."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import yaml

_WORDS: dict[str, dict[str, Any]] = yaml.safe_load(Path(__file__).with_name("rows.yaml").read_text(encoding="utf-8"))


class Reproduction(StrEnum):
    """Outcome of one comparison."""

    REPRODUCED = "reproduced"
    DIFFERS = "differs"
    NOT_COMPARABLE = "not comparable"  # no number printed, or none that can be computed


@dataclass(frozen=True)
class Row:
    """Comparison of a printed value with the computed one.

    `tolerance` is relative (of the printed value; absolute where that is 0).
    """

    where: str
    quantity: str
    unit: str
    printed: float | None
    computed: float | None
    tolerance: float
    why: str

    @property
    def verdict(self) -> Reproduction:
        """Outcome: reproduced if the computed value lies within the tolerance of the printed one."""
        if self.printed is None or self.computed is None:
            return Reproduction.NOT_COMPARABLE
        allowed = self.tolerance * (abs(self.printed) or 1.0)
        return Reproduction.REPRODUCED if abs(self.computed - self.printed) <= allowed else Reproduction.DIFFERS


def row(key: str, computed: float | None, printed: float | None = None, **details: Any) -> Row:
    """Build a row from the words of rows.yaml; `printed` for values worked out from a printed formula."""
    words = {"printed": printed, **_WORDS[key]}
    return Row(
        computed=None if computed is None else float(computed),
        **words | {text: words[text].format(**details) for text in ("quantity", "why")},
    )
