"""Fields that axis sections of a bench file share: bounded numbers, and the base of axes with a rotary motor."""

from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from hil.errors import FieldError
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


RATIOS = ("damping_ratio",)  # nominal parameters of any axis that are below 1


class AxisSection(BenchSection):
    """Base of the axis sections: its kind, and the parameters that the diagnosis refits before it looks for physics."""

    MASSES: ClassVar[tuple[str, ...]] = ()
    SPRINGS: ClassVar[tuple[str, ...]] = ()  # between motor and table
    FRICTION: ClassVar[tuple[str, ...]] = ("coulomb_torque_n_m", "viscous_torque_n_m_s_rad")
    NOMINAL: ClassVar[tuple[str, ...]] = ()  # the three together
    linear: ClassVar[bool] = False  # the motor side is in m and N
    turns: ClassVar[bool] = False  # the load turns
    drive_unit: ClassVar[str] = "N m"  # of the torque channels: N m, N, or V of a motor driven by its voltage
    held: tuple[str, ...] = Field((), description="keys of the axis whose values a diagnosis keeps: a weighed mass")

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        cls.NOMINAL = (*cls.MASSES, *cls.SPRINGS, *cls.FRICTION)

    @model_validator(mode="after")
    def _held_is_refitted(self) -> Self:
        others = [name for name in self.held if name not in self.NOMINAL]
        if others:
            raise FieldError(("held",), f"given {', '.join(others)}, allowed {', '.join(self.NOMINAL)}")
        if not self.refitted:
            raise FieldError(("held",), "given every key that a diagnosis refits, allowed all but one")
        return self

    @property
    def refitted(self) -> tuple[str, ...]:
        """Parameters that a diagnosis refits: `NOMINAL` without those held."""
        return tuple(name for name in self.NOMINAL if name not in self.held)


class Driven(AxisSection):
    """An axis driven by a rotary motor; friction is given at the motor."""

    coulomb_torque_n_m: NotNegative = Field(description="Coulomb friction at the motor [N m]")
    viscous_torque_n_m_s_rad: NotNegative = Field(description="viscous friction at the motor [N m s/rad]")

    def chain(self) -> Chain:
        """The lumped chain of the axis."""
        raise NotImplementedError

    def physics(self) -> Physics:
        """The nominal physics of the twin."""
        return Physics(self.chain(), self.coulomb_torque_n_m, self.viscous_torque_n_m_s_rad)
