"""Estimated parameters in the result of a diagnosis."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from hil.quantities import with_error

NotNegative = Annotated[float, Field(ge=0.0)]


class ResultPart(BaseModel):
    """Part of diagnosis.json."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Value(ResultPart):
    """An estimated parameter."""

    value: float
    std: NotNegative = Field(description="standard error")
    unit: str

    @property
    def standard_error(self) -> float:
        """Standard error, in the unit of the value; `std` in diagnosis.json."""
        return self.std

    def __str__(self) -> str:
        value, error = with_error(self.value, self.std)
        return f"{value} ± {error} {self.unit}"


class Correction(Value):
    """A nominal parameter of the bench, estimated from the recordings."""

    nominal: float = Field(description="value in the bench file")
