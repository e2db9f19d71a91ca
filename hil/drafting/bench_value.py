"""A key of a drafted bench file with its value."""

from dataclasses import dataclass

from hil.identification.least_squares import Estimate


@dataclass(frozen=True)
class BenchValue:
    """A key of the bench file with its value, its unit and error, and how it was found."""

    key: str
    value: float | int | str
    error: str
    how: str = ""

    @property
    def shown(self) -> str:
        """The value as text, a number with six digits."""
        return f"{self.value:.6g}" if isinstance(self.value, float) else str(self.value)


def estimated(key: str, estimate: Estimate, unit: str, more: str = "") -> BenchValue:
    """A key with its estimate, the unit, the standard error and how it was found."""
    how = "; ".join(filter(None, (estimate.how, more)))
    return BenchValue(key, estimate.value, f"{unit}, +-{estimate.std_error:.2g}", how)
