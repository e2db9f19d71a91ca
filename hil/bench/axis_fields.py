"""Fields that axis sections of a bench file share: bounded numbers, and the base of axes with a rotary motor."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from hil.twin.physics import Physics
from hil.twin.structure.chain import Chain

# 1e15: above every SI value of an axis; squares and products of such values stay finite
Positive = Annotated[float, Field(gt=0.0, le=1e15, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e15, allow_inf_nan=False)]
# up to a metre: a lead in millimetres is refused
Lead = Annotated[float, Field(ge=1e-5, le=1.0, allow_inf_nan=False)]
Damping = Annotated[float, Field(ge=0.0, lt=1.0, description="modal damping ratio of the elastic modes")]


class BenchSection(BaseModel):
    """Base of all sections of a bench file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


FRICTION = ("coulomb_torque_n_m", "viscous_torque_n_m_s_rad")
RATIOS = ("damping_ratio",)  # nominal parameters of any axis that are below 1


class Driven(BenchSection):
    """An axis driven by a rotary motor; friction is given at the motor."""

    coulomb_torque_n_m: NotNegative = Field(description="Coulomb friction at the motor [N m]")
    viscous_torque_n_m_s_rad: NotNegative = Field(description="viscous friction at the motor [N m s/rad]")

    @property
    def linear(self) -> bool:
        """True if the motor side is in m and N."""
        return False

    @property
    def drive_unit(self) -> str:
        """Unit of the torque channels: N m, N, or V of a motor that is driven by its voltage."""
        return "N m"

    @property
    def turns(self) -> bool:
        """True if the load turns."""
        return False

    def chain(self) -> Chain:
        """The lumped chain of the axis."""
        raise NotImplementedError

    def physics(self) -> Physics:
        """The nominal physics of the twin."""
        return Physics(self.chain(), self.coulomb_torque_n_m, self.viscous_torque_n_m_s_rad)
