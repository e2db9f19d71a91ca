"""The table of channels: every quantity a recording may hold, with its unit, meaning and sign.

A column of a recording is named by its quantity and its SI unit, `torque_n_m`. On a rotary axis the
motor side is in rad and N m; a linear axis (one mass, newtons and metres) has `motor_position_m`,
`force_n` and `force_command_n` in their place. One line here is all that a new channel needs.
"""

from collections.abc import Container
from dataclasses import dataclass
from enum import StrEnum


class AxisKind(StrEnum):
    """Units of the motor side: rad and N m (rotary), or m and N (linear)."""

    ROTARY = "rotary"
    LINEAR = "linear"

    @classmethod
    def of(cls, names: Container[str]) -> "AxisKind":
        """The kind of axis that channels of these names describe."""
        return cls.LINEAR if "motor_position_m" in names or "motor_velocity_m_s" in names else cls.ROTARY


@dataclass(frozen=True)
class Channel:
    """A column: its name, SI unit ("1" without dimension), meaning, and the meaning of a positive value."""

    name: str
    unit: str
    meaning: str
    sign: str = ""

    @property
    def quantity(self) -> str:
        """The name without its unit, as words."""
        unit = self.unit.replace("^", "").replace("/", "_").replace(" ", "_").lower()
        return self.name.removesuffix(f"_{unit}").replace("_", " ")


SPEED_SET_POINT = "velocity_reference_m_s"

_TABLE = (
    Channel("time_s", "s", "time of the sample, tick x period"),
    Channel("position_command_m", "m", "position set-point of the table", "away from home"),
    Channel("velocity_command_m_s", "m/s", "velocity set-point of the table", "away from home"),
    Channel("acceleration_command_m_s2", "m/s^2", "acceleration set-point of the table", "away from home"),
    Channel("motor_position_rad", "rad", "motor encoder", "table moves away from home"),
    Channel("motor_position_m", "m", "motor encoder of a linear axis", "away from home"),
    Channel("motor_velocity_rad_s", "rad/s", "velocity of the motor", "table moves away from home"),
    Channel("motor_velocity_m_s", "m/s", "velocity of the motor of a linear axis", "away from home"),
    Channel("table_position_m", "m", "linear encoder", "away from home"),
    Channel(
        "torque_command_n_m",
        "N m",
        "output of the velocity loop, held for the next period",
        "accelerates away from home",
    ),
    Channel(
        "torque_n_m",
        "N m",
        "motor current x nominal torque constant, mean over the next period",
        "accelerates away from home",
    ),
    Channel(
        "force_command_n",
        "N",
        "output of the velocity loop of a linear axis, held for the next period",
        "accelerates away from home",
    ),
    Channel("force_n", "N", "motor force of a linear axis, mean over the next period", "accelerates away from home"),
    Channel(SPEED_SET_POINT, "m/s", "output of the position loop", "away from home"),
    Channel("compensation_position_m", "m", "what the compensation adds to the position set-point", "away from home"),
    Channel("compensation_velocity_m_s", "m/s", "and to the velocity set-point", "away from home"),
    Channel("compensation_torque_n_m", "N m", "torque that the compensation adds", "accelerates away from home"),
    Channel("compensation_force_n", "N", "force that the compensation adds, linear axis", "accelerates away from home"),
    Channel("twin_motor_position_rad", "rad", "motor position of the live twin", "as motor_position_rad"),
    Channel("twin_motor_position_m", "m", "motor position of the live twin, linear axis", "as motor_position_m"),
    Channel("twin_table_position_m", "m", "table position of the live twin", "as table_position_m"),
    Channel("twin_torque_n_m", "N m", "torque of the live twin", "as torque_n_m"),
    Channel("twin_force_n", "N", "force of the live twin, linear axis", "as force_n"),
    Channel("drive_state", "1", "CiA 402 state of the drive, as its number in drivers.cia402"),
    Channel("drive_error_code", "1", "last CiA 301 emergency error code, 0 without one"),
    Channel("segment", "1", "index of the profile segment"),
    Channel("lateness_s", "s", "start of the cycle after its deadline", "late"),
    Channel("cycle_s", "s", "time the cycle took"),
)

CHANNELS: dict[str, Channel] = {channel.name: channel for channel in _TABLE}


@dataclass(frozen=True)
class AxisChannels:
    """Names of the channels that the twin predicts and the controller uses, for one kind of axis."""

    motor_position: str
    torque_command: str
    torque: str
    motor_velocity: str
    table_position: str = "table_position_m"
    position_command: str = "position_command_m"
    velocity_command: str = "velocity_command_m_s"

    @property
    def predicted(self) -> tuple[str, str, str, str]:
        """The four channels a twin answers with."""
        return self.motor_position, self.table_position, self.torque_command, self.torque


AXIS_CHANNELS: dict[AxisKind, AxisChannels] = {
    AxisKind.ROTARY: AxisChannels("motor_position_rad", "torque_command_n_m", "torque_n_m", "motor_velocity_rad_s"),
    AxisKind.LINEAR: AxisChannels("motor_position_m", "force_command_n", "force_n", "motor_velocity_m_s"),
}
