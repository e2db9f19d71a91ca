"""Section `compensation` of a bench file: tables that are added to torque and position set-point, with their origin."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from hil.bench.axis_fields import BenchSection, NotNegative, Positive
from hil.control.compensation_tables import OFF, Adds, Compensation, CompensationLimits, CompensationTable, Over
from hil.errors import FieldError

Knots = tuple[Annotated[float, Field(allow_inf_nan=False)], ...]


class CompensationOrigin(BenchSection):
    """Where a table comes from."""

    recording: str = Field("", description="file, or files, of the diagnosis")
    finding: str = Field("", description="what was found, in words")
    standard_error: NotNegative | None = Field(
        None, description="largest standard error of a value of the table, in its unit; absent: unknown"
    )
    date: str = Field("", description="day on which the table was made")


class CompensationEntry(BenchSection):
    """A table: a line through knots; it is periodic over the angle of the motor."""

    name: str = Field(description="what it compensates")
    enabled: bool = Field(True, description="false: this table adds nothing")
    adds: Adds = Field(description="to the torque at the motor [N m, N], or to the position set-point [m, rad]")
    over: Over = Field(
        description="set-point over which the table goes; angle of the motor; time or way since the last reversal"
    )
    at: Knots = Field(min_length=1, description="knots in ascending order; of the angle: from 0 to below 2 pi")
    forward: Knots = Field(description="values at the knots, in motion away from home")
    backward: Knots | None = Field(None, description="values on the way back; absent: as forward")
    origin: CompensationOrigin = Field(CompensationOrigin(), description="where the table comes from")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        for name in ("forward", "backward"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.at):
                raise FieldError((name,), f"given {len(values)} values, allowed {len(self.at)}: one for each knot")
        if any(after <= before for before, after in zip(self.at, self.at[1:], strict=False)):
            raise FieldError(("at",), "given knots that do not ascend, allowed ascending ones; sort them")
        if self.over is Over.ANGLE and not 0.0 <= self.at[0] <= self.at[-1] < 2.0 * math.pi:
            raise FieldError(("at",), f"given angles from {self.at[0]} to {self.at[-1]}, allowed 0 to below 2 pi rad")
        return self

    def table(self) -> CompensationTable:
        """The entry as arrays."""
        at, forward = (np.array(one, dtype=np.float64) for one in (self.at, self.forward))
        backward = forward if self.backward is None else np.array(self.backward, dtype=np.float64)
        return CompensationTable(self.name, self.adds, self.over, at, forward, backward)


class CompensationSection(BenchSection):
    """What the controller adds to its set-points and its torque, by tables over the set-points, within bounds."""

    enabled: bool = Field(True, description="false: nothing is added")
    fade_in_s: NotNegative = Field(1.0, description="time in which it fades in at the start of a run")
    torque_limit: Positive = Field(description="largest torque that is added [N m, N]")
    torque_slope: Positive = Field(description="fastest change of that torque [N m/s, N/s]")
    position_limit_m: Positive = Field(description="largest correction of the position set-point [m, rad]")
    speed_limit_m_s: Positive = Field(description="fastest change of that correction [m/s, rad/s]")
    direction_m_s: Positive = Field(
        1e-3, description="torque goes from one direction to the other within +- this velocity [m/s, rad/s]"
    )
    entries: tuple[CompensationEntry, ...] = Field((), description="the tables")

    def compensation(self, angle_per_m: float) -> Compensation:
        """Tables that are enabled; `angle_per_m`: motor angle per metre [rad/m]."""
        if not self.enabled:
            return OFF
        limits = CompensationLimits(
            self.torque_limit, self.torque_slope, self.position_limit_m, self.speed_limit_m_s, self.fade_in_s,
            self.direction_m_s,
        )  # fmt: skip
        return Compensation(tuple(one.table() for one in self.entries if one.enabled), limits, angle_per_m)
