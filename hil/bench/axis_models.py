"""Axis section of a bench file: one pydantic model per kind of axis, which gives the twin's physics."""

from dataclasses import replace
from math import pi
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from hil.bench.axis_fields import AxisSection, Damping, Driven, Lead, NotNegative, Positive
from hil.bench.turning_axes import DcMotor, Rotary, RotaryTwoMass
from hil.errors import FieldError
from hil.twin.physics import Physics
from hil.twin.structure.chain import (
    LINEAR_LEAD_M,
    Chain,
    one_mass,
    serial_chain,
    seven_dof,
    two_mass,
)
from hil.twin.structure.chain import (
    RECONSTRUCTED_TABLE_1 as _TABLE_1,
)


class Screw(Driven):
    """A motor and a screw that moves a table."""

    lead_m: Lead = Field(description="travel of the table per motor revolution [m]")

    @property
    def ratio_m_rad(self) -> float:
        """Table travel per radian of the motor, r = lead / 2 pi."""
        return self.lead_m / (2.0 * pi)


class TwoMass(Screw):
    """Motor and table with a spring between them, seen at the table (Eq. 1)."""

    MASSES: ClassVar[tuple[str, ...]] = ("motor_mass_kg", "table_mass_kg")
    SPRINGS: ClassVar[tuple[str, ...]] = ("stiffness_n_m", "damping_ratio")
    model: Literal["two_mass"] = "two_mass"
    motor_mass_kg: Positive = Field(description="motor inertia as translation at the table [kg]")
    table_mass_kg: Positive = Field(description="table and screw at the table [kg]")
    stiffness_n_m: Positive = Field(description="stiffness of the transmission at the table [N/m]")
    damping_ratio: Damping = 0.03

    def chain(self) -> Chain:
        """The 2-dof chain."""
        return two_mass(self.motor_mass_kg, self.table_mass_kg, self.stiffness_n_m, self.damping_ratio, self.lead_m)


class Rigid(Screw):
    """A motor and a screw stiff enough to be one mass with the table."""

    MASSES: ClassVar[tuple[str, ...]] = ("mass_kg",)
    model: Literal["rigid"] = "rigid"
    mass_kg: Positive = Field(description="all moving mass and inertia at the table [kg]")

    def chain(self) -> Chain:
        """The chain of one mass."""
        return one_mass(self.mass_kg, self.lead_m)


class SevenDofAxis(Screw):
    """The 7-dof drive of the source; defaults are the reconstruction of its lost Table 1."""

    MASSES: ClassVar[tuple[str, ...]] = ("motor_inertia_kg_m2", "table_mass_kg")
    SPRINGS: ClassVar[tuple[str, ...]] = ("nut_support_stiffness_n_m", "coupling_stiffness_n_m_rad", "damping_ratio")
    model: Literal["seven_dof"] = "seven_dof"
    lead_m: Lead = Field(_TABLE_1.lead_m, description="travel of the table per motor revolution [m]")
    motor_inertia_kg_m2: Positive = Field(_TABLE_1.motor_inertia_kg_m2, description="rotor of the motor")
    table_mass_kg: Positive = Field(_TABLE_1.table_mass_kg, description="table with its load")
    coupling_stiffness_n_m_rad: Positive = Field(
        _TABLE_1.coupling_stiffness_n_m_rad, description="coupling between motor and screw"
    )
    nut_stiffness_n_m: Positive = Field(_TABLE_1.nut_stiffness_n_m, description="contact of nut and screw")
    nut_support_stiffness_n_m: Positive = Field(
        _TABLE_1.nut_support_stiffness_n_m, description="support of the nut at the table"
    )
    nut_position_m: float | None = Field(None, description="nut from the front end of its travel [m]")
    damping_ratio: Damping = 0.03

    def chain(self) -> Chain:
        """The 7-dof chain with the nut at its position."""
        given = self.model_dump(include=set(vars(_TABLE_1)))
        parameters = replace(_TABLE_1, **given)
        return seven_dof(parameters, self.damping_ratio, self.nut_position_m)


class SerialChain(Screw):
    """Any number of inertias in a row, reduced to the motor shaft; the last spring is the nut."""

    MASSES: ClassVar[tuple[str, ...]] = ("inertia_scale",)
    SPRINGS: ClassVar[tuple[str, ...]] = ("stiffness_scale", "damping_ratio")
    model: Literal["serial_chain"] = "serial_chain"
    inertias_kg_m2: tuple[Positive, ...] = Field(min_length=2, description="from motor to table [kg m^2]")
    stiffnesses_n_m_rad: tuple[Positive, ...] = Field(min_length=1, description="one fewer than inertias [N m/rad]")
    inertia_scale: Positive = Field(1.0, description="factor on all inertias")
    stiffness_scale: Positive = Field(1.0, description="factor on all stiffnesses")
    damping_ratio: Damping = 0.03

    @model_validator(mode="after")
    def _one_spring_fewer(self) -> Self:
        springs, allowed = len(self.stiffnesses_n_m_rad), len(self.inertias_kg_m2) - 1
        if springs != allowed:
            raise FieldError(
                ("stiffnesses_n_m_rad",), f"given {springs} values, allowed {allowed}: one fewer than inertias_kg_m2"
            )
        return self

    def chain(self) -> Chain:
        """The chain of n inertias."""
        return serial_chain(
            [j * self.inertia_scale for j in self.inertias_kg_m2],
            [k * self.stiffness_scale for k in self.stiffnesses_n_m_rad],
            self.damping_ratio,
            self.lead_m,
        )


class OneMass(AxisSection):
    """A linear axis: one mass, one encoder, newtons and metres."""

    MASSES: ClassVar[tuple[str, ...]] = ("mass_kg",)
    FRICTION: ClassVar[tuple[str, ...]] = ("coulomb_force_n", "viscous_force_n_s_m")
    linear: ClassVar[bool] = True
    drive_unit: ClassVar[str] = "N"
    model: Literal["one_mass"] = "one_mass"
    mass_kg: Positive = Field(description="moving mass [kg]")
    coulomb_force_n: NotNegative = Field(description="Coulomb friction [N]")
    viscous_force_n_s_m: NotNegative = Field(description="viscous friction [N s/m]")
    screw_lead_m: Lead | None = Field(None, description="lead of its screw, for orders per revolution [m]")

    @property
    def ratio_m_rad(self) -> float:
        """1: motor and table are both in metres."""
        return 1.0

    def physics(self) -> Physics:
        """The nominal physics of the twin."""
        angle = 2.0 * pi / (self.screw_lead_m or 1.0)  # without a lead orders are counted per metre
        return Physics(
            one_mass(self.mass_kg, LINEAR_LEAD_M),
            self.coulomb_force_n,
            self.viscous_force_n_s_m,
            linear=True,
            angle_per_unit=angle,
            turn_known=self.screw_lead_m is not None,
        )


Axis = Annotated[
    TwoMass | SevenDofAxis | SerialChain | Rigid | OneMass | Rotary | RotaryTwoMass | DcMotor,
    Field(discriminator="model"),
]


def model_of(keys: set[str]) -> str:
    """Return the kind of axis that a file without the key `model` describes, from its keys."""
    if keys & {"coulomb_force_n", "viscous_force_n_s_m"}:
        return "one_mass"
    if "coulomb_voltage_v" in keys:
        return "dc_motor"
    if "inertias_kg_m2" in keys:
        return "serial_chain"
    if "load_inertia_kg_m2" in keys:
        return "rotary_two_mass"
    if "inertia_kg_m2" in keys:
        return "rotary"
    if keys & {"motor_inertia_kg_m2", "nut_stiffness_n_m"}:
        return "seven_dof"
    return "rigid" if "mass_kg" in keys else "two_mass"
