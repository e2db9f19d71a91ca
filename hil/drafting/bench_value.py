"""A key of a drafted bench file with its value."""

from dataclasses import dataclass


@dataclass(frozen=True)
class BenchValue:
    """A key of the bench file with its value, its unit and error, and how it was found."""

    key: str
    value: float | int | str
    error: str
    how: str = ""
