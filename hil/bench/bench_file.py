"""Bench files: the axis as its owner describes it, control, encoders, drive, and mechanisms found by a diagnosis.

An axis file (the keys of `axis` at the top level, and `control`) is a bench too: the rest has defaults. Without
`control`, or with `control: unknown`, the plant alone is judged (`hil.bench.control_section`).
`load_bench` raises errors with file, line and field.
"""

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from hil.bench.axis_fields import BenchSection
from hil.bench.axis_models import Axis, OneMass, model_of
from hil.bench.compensation_section import CompensationSection
from hil.bench.control_section import Control, ControlSection, UnknownControl, with_law
from hil.bench.hardware import DriveMode, DriveSection, SimulationSection
from hil.control import cascade as law
from hil.control.compensation_tables import OFF, Adds, Compensation
from hil.errors import FieldError
from hil.files.shipped import given_or_shipped
from hil.files.yaml_model import load_model
from hil.twin.axis import Twin
from hil.twin.library import BY_ID
from hil.twin.physics import Active

# a resolution in micrometres is refused
Resolution = Annotated[float, Field(gt=0.0, le=1e-3, allow_inf_nan=False, description="table travel per count [m]")]


class MechanismEntry(BenchSection):
    """A mechanism that the twin of this bench contains."""

    effect: str = Field(description="id of a mechanism, as the reference of mechanisms lists them")
    variant: str = Field("", description="its form; absent: the first one")
    parameters: dict[str, float] = Field(description="name -> value in SI")

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.effect not in BY_ID:
            raise FieldError(("effect",), f"given {self.effect!r}, allowed one of {', '.join(BY_ID)}")
        mechanism = BY_ID[self.effect]
        required = {parameter.name for parameter in mechanism.parameters if parameter.default is None}
        if not required <= set(self.parameters) <= set(mechanism.names):
            raise FieldError(
                ("parameters",),
                f"given {', '.join(self.parameters) or 'nothing'}, allowed exactly {', '.join(mechanism.names)}",
            )
        if self.variant and self.variant not in mechanism.forms:
            allowed = ", ".join(variant or "none" for variant in mechanism.forms)
            raise FieldError(("variant",), f"given {self.variant!r}, allowed one of {allowed}")
        for parameter in mechanism.parameters:
            value = self.parameters.get(parameter.name, parameter.default)
            assert value is not None
            if not parameter.low <= value <= parameter.high:
                raise FieldError(
                    ("parameters", parameter.name),
                    f"given {value:g}, allowed {parameter.low:g} to {parameter.high:g} {parameter.dimension.value}",
                )
        return self

    def active(self) -> Active:
        """The entry as the twin takes it."""
        mechanism = BY_ID[self.effect]
        variant = mechanism.forms.index(self.variant) if self.variant else 0
        return Active(
            self.effect,
            tuple(self.parameters.get(parameter.name, parameter.default or 0.0) for parameter in mechanism.parameters),
            variant,
        )


class MotorEncoder(BenchSection):
    """Motor encoder."""

    # UNSIGNED32 in CiA 402, object 0x608F
    counts_per_rev: Annotated[int, Field(gt=0, lt=2**32, description="counts per revolution of the motor")] = 2**20
    resolution_m: Annotated[float | None, Field(gt=0.0, description="count of a linear axis [m]")] = None
    direction: Literal[1, -1] = Field(1, description="-1: it counts down while the table moves away from home")


class TableEncoder(BenchSection):
    """Linear encoder at the table."""

    resolution_m: Resolution = 0.5e-6
    direction: Literal[1, -1] = Field(1, description="-1: it counts down while the table moves away from home")


class Encoders(BenchSection):
    """Encoders of the axis; `table: null` where there is none."""

    motor: MotorEncoder = Field(MotorEncoder(), description="encoder of the motor")
    table: TableEncoder | None = Field(TableEncoder(), description="encoder of the table; null: there is none")


class Bench(BenchSection):
    """A bench file."""

    schema_version: Literal[1] = Field(1, description="version of the format")
    name: str = Field("", description="name of the bench; absent: that of the file")
    description: str = Field("", description="what the bench is")
    axis: Axis = Field(description="masses, stiffness and friction, as the owner believes them")
    control: ControlSection = Field(
        UnknownControl(law="unknown"), description="the control law and its gains; absent or unknown: it is not judged"
    )
    encoders: Encoders = Field(Encoders(), description="resolution and direction of the encoders")
    mechanisms: tuple[MechanismEntry, ...] = Field((), description="mechanisms that the twin of this bench contains")
    compensation: CompensationSection | None = Field(
        None, description="what the controller adds to torque and position set-point; absent: nothing"
    )
    drive: DriveSection | None = Field(None, description="bus, drive and supervision; absent: recordings only")
    simulation: SimulationSection | None = Field(None, description="present: the devices are simulated")

    @model_validator(mode="before")
    @classmethod
    def _lift_axis(cls, data: Any) -> Any:
        """Accept an axis file: keys of the axis at the top level."""
        if not isinstance(data, dict):
            return data
        data = dict(data)
        if "axis" not in data:
            data["axis"] = {key: data.pop(key) for key in list(data) if key not in cls.model_fields}
        if isinstance(data["axis"], dict) and "model" not in data["axis"]:
            data["axis"] = {"model": model_of(set(data["axis"])), **data["axis"]}
        data["control"] = with_law(data.get("control"))
        # from here on pydantic takes it for Python's own data, where strictly only a tuple is one
        return _tuples(data)

    @model_validator(mode="after")
    def _room_for_mechanisms(self) -> Self:
        effects = [entry.effect for entry in self.mechanisms]
        for effect in effects:
            given, most = effects.count(effect), BY_ID[effect].most
            if given > most:
                raise FieldError(
                    ("mechanisms",), f"given {effect} {given} times, allowed {most}: it cannot act more often at once"
                )
        return self

    @model_validator(mode="after")
    def _feedback_is_measured(self) -> Self:
        if self.control.position_feedback == "table" and not self.has_table_encoder:
            raise FieldError(
                ("control", "position_feedback"),
                "given table, allowed motor: this bench has no linear encoder; describe it under encoders.table",
            )
        return self

    @model_validator(mode="after")
    def _torque_is_commanded(self) -> Self:
        adds_torque = any(table.adds is Adds.TORQUE for table in self.tables().tables)
        if adds_torque and self.drive is not None and self.drive.mode is not DriveMode.CST:
            raise FieldError(
                ("compensation", "entries"),
                f"given a table that adds to the torque, allowed none in {self.drive.mode}, where the drive makes it; "
                "say enabled: false there, or drive.mode: cst",
            )
        return self

    def tables(self) -> Compensation:
        """Tables of the compensation; none if it is off."""
        if self.compensation is None:
            return OFF
        return self.compensation.compensation(self.axis.physics().angle_per_unit / self.axis.ratio_m_rad)

    @property
    def gains(self) -> law.Gains:
        """Constants of the control law."""
        return self.control.gains(self.axis.ratio_m_rad)

    @property
    def period_s(self) -> float:
        """Period of the velocity loop [s]: one row of a recording, one set-point of a trajectory."""
        return self.gains.period_s

    @property
    def law_known(self) -> bool:
        """True if the control law is known, so that closed loop and controller can be simulated."""
        return not isinstance(self.control, UnknownControl)

    @property
    def torque_delay_s(self) -> float | None:
        """Delay with which a recorded torque acts, to be estimated; None: it acts as recorded."""
        return self.control.torque_delay_s if isinstance(self.control, UnknownControl) else None

    @property
    def differences_setpoints(self) -> bool:
        """True if the velocity feed-forward is the last difference of the position set-points, as in a drive in CSP."""
        if self.drive is not None and self.drive.mode is DriveMode.CSP:
            return True
        return isinstance(self.control, Control) and self.control.velocity_setpoint == "backward_difference"

    @property
    def setpoint_delay_s(self) -> float:
        """Time by which the control law uses recorded set-points later; 0 without a known law."""
        return 0.0 if isinstance(self.control, UnknownControl) else self.control.setpoint_delay_s

    @property
    def known_control(self) -> Control:
        """The control law. Raises FieldError if it is unknown."""
        if isinstance(self.control, UnknownControl):
            raise FieldError(
                ("control",),
                "given no control law, allowed one: without it an axis can be diagnosed (hil diagnose), but not run or "
                "simulated in closed loop; add the section `control`",
            )
        return self.control

    def sampled(self, period_s: float) -> "Bench":
        """The bench with the period of a recording [s], if its control law is unknown and gives no period."""
        if not isinstance(self.control, UnknownControl) or self.control.velocity_period_s is not None:
            return self
        return self.model_copy(update={"control": self.control.model_copy(update={"velocity_period_s": period_s})})

    def twin(self) -> Twin:
        """The twin of this bench, with its mechanisms."""
        return Twin(self.axis.physics(), self.gains, tuple(entry.active() for entry in self.mechanisms))

    @property
    def motor_count(self) -> float:
        """Resolution of the motor encoder [rad, linear axis m]; 0 if unknown."""
        motor = self.encoders.motor
        return (motor.resolution_m or 0.0) if self.axis.linear else 2.0 * math.pi / motor.counts_per_rev

    @property
    def has_table_encoder(self) -> bool:
        """True with a linear encoder; a linear axis of one mass has none."""
        return self.encoders.table is not None and not isinstance(self.axis, OneMass)


def _tuples(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _tuples(value) for key, value in data.items()}
    return tuple(_tuples(value) for value in data) if isinstance(data, list) else data


def load_bench(source: str | Path) -> Bench:
    """Load a bench file, or a shipped bench by its name.

    Raises InputError with file, line, field, what was given and what is allowed.
    """
    path = given_or_shipped(source, "bench")
    bench = load_model(path, Bench)
    return bench if bench.name else bench.model_copy(update={"name": path.stem})
