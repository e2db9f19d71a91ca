"""Axis section of a bench file for loads that turn: one inertia, two with a gear, a DC motor driven by voltage.

Positions of the "table" are angles of the load: 1 m stands for 1 rad, 1 N for 1 N m.
"""

from math import pi
from typing import ClassVar, Literal

from pydantic import Field

from hil.bench.axis_fields import AxisSection, Damping, Driven, NotNegative, Positive
from hil.twin.physics import Physics
from hil.twin.structure.chain import Chain, one_mass, serial_chain


class Turning(AxisSection):
    """A load that turns, with a gear between motor and load."""

    gear_ratio: Positive = Field(1.0, description="motor revolutions per revolution of the load")
    turns: ClassVar[bool] = True

    @property
    def lead_m(self) -> float:
        """Angle of the load per motor revolution [rad], in place of a lead."""
        return 2.0 * pi / self.gear_ratio

    @property
    def ratio_m_rad(self) -> float:
        """Angle of the load per radian of the motor [rad/rad]."""
        return 1.0 / self.gear_ratio


class Rotary(Turning, Driven):
    """A rotary axis of one inertia."""

    MASSES: ClassVar[tuple[str, ...]] = ("inertia_kg_m2",)
    model: Literal["rotary"] = "rotary"
    inertia_kg_m2: Positive = Field(description="all inertia at the motor [kg m^2]")

    def chain(self) -> Chain:
        """One inertia."""
        return one_mass(self.inertia_kg_m2 / self.ratio_m_rad**2, self.lead_m)


class RotaryTwoMass(Turning, Driven):
    """A motor and a load that turns, with a gear and a spring between them."""

    MASSES: ClassVar[tuple[str, ...]] = ("motor_inertia_kg_m2", "load_inertia_kg_m2")
    SPRINGS: ClassVar[tuple[str, ...]] = ("stiffness_n_m_rad", "damping_ratio")
    model: Literal["rotary_two_mass"] = "rotary_two_mass"
    motor_inertia_kg_m2: Positive = Field(description="motor and gear at the motor [kg m^2]")
    load_inertia_kg_m2: Positive = Field(description="load at its own shaft [kg m^2]")
    stiffness_n_m_rad: Positive = Field(description="gear and shaft at the load [N m/rad]")
    damping_ratio: Damping = 0.03

    def chain(self) -> Chain:
        """The 2-dof chain, reduced to the motor."""
        square = self.ratio_m_rad**2
        inertias = (self.motor_inertia_kg_m2, self.load_inertia_kg_m2 * square)
        names = ("motor", "table")
        return serial_chain(inertias, [self.stiffness_n_m_rad * square], self.damping_ratio, self.lead_m, names=names)


class DcMotor(Turning):
    """A DC motor driven by a voltage u, with its load as one inertia, in volts.

    Kt i = J a + D w + Tc sign(w) with u = R i + Ke w gives, without the inductance and times R / Kt,

        u = k (tau a + w) + uc sign(w),    k = Ke + R D / Kt,    tau = R J / (Kt k),    uc = R Tc / Kt

    The voltage acts like a torque, and the back-EMF like viscous friction. A recording holds it in torque_command_n_m
    and torque_n_m with 1 N m for 1 V, so that the twin takes k tau for the inertia, k for viscous and uc for Coulomb
    friction. R, Kt and J alone are not told by voltage and motion. A dead zone of the motor in volts is uc.
    """

    MASSES: ClassVar[tuple[str, ...]] = ("time_constant_s",)
    FRICTION: ClassVar[tuple[str, ...]] = ("coulomb_voltage_v", "voltage_constant_v_s_rad")
    drive_unit: ClassVar[str] = "V"
    model: Literal["dc_motor"] = "dc_motor"
    time_constant_s: Positive = Field(description="mechanical time constant tau [s]")
    coulomb_voltage_v: NotNegative = Field(description="voltage that Coulomb friction takes, half the dead zone [V]")
    voltage_constant_v_s_rad: Positive = Field(description="voltage per speed k, back-EMF and viscous [V s/rad]")

    def physics(self) -> Physics:
        """The nominal physics of the twin, 1 N m for 1 V."""
        inertia = self.time_constant_s * self.voltage_constant_v_s_rad
        chain = one_mass(inertia / self.ratio_m_rad**2, self.lead_m)
        return Physics(chain, self.coulomb_voltage_v, self.voltage_constant_v_s_rad)
