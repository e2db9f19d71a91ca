"""One comparison of a printed value with the computed one."""

from dataclasses import dataclass
from enum import StrEnum


class Reproduction(StrEnum):
    """Outcome of one comparison."""

    REPRODUCED = "reproduced"
    DIFFERS = "differs"
    NOT_COMPARABLE = "not comparable"  # no number printed, or none that can be computed


@dataclass(frozen=True)
class Row:
    """One comparison. `tolerance` is relative (of the printed value; absolute where that is 0)."""

    where: str
    quantity: str
    unit: str
    printed: float | None
    computed: float | None
    tolerance: float
    why: str

    @property
    def verdict(self) -> Reproduction:
        """Whether the computed value lies within the tolerance of the printed one."""
        if self.printed is None or self.computed is None:
            return Reproduction.NOT_COMPARABLE
        allowed = self.tolerance * (abs(self.printed) or 1.0)
        return Reproduction.REPRODUCED if abs(self.computed - self.printed) <= allowed else Reproduction.DIFFERS
