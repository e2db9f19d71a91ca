"""The section `drive.supervision` of a bench file: bounds of the checks in each cycle, with their defaults."""

from __future__ import annotations

from pydantic import Field

from hil.bench.axis_fields import BenchSection, NotNegative, Positive


class ResidualThresholds(BenchSection):
    """Largest differences between axis and live twin [m, m, N m or N]; from recordings without fault:
    `hil.identification.residual_thresholds.learn`."""

    motor_m: Positive = Field(description="of the motor position, at the table")
    table_m: Positive | None = Field(None, description="of the table position; absent: off")
    torque: Positive = Field(description="of the torque [N m, N]")


class SupervisionSection(BenchSection):
    """Bounds of the supervision. Absent fields have the defaults of `hil.loop.bounds`."""

    encoder_difference_m: Positive | None = Field(
        None, description="motor against table encoder since the start; absent: following_error_m"
    )
    frozen_m: Positive | None = Field(
        None,
        description="travel of one encoder while the other repeats its value: more than backlash and windup; "
        "absent: a tenth of encoder_difference_m, at least 4 counts",
    )
    frozen_torque: Positive | None = Field(
        None, description="change of the measured torque while the motor encoder repeats its value: more than "
        "stiction; absent: half of the torque limit, or of the drive's if it is lower [N m, N]"
    )  # fmt: skip
    velocity_m_s: Positive | None = Field(
        None, description="of the motor at the table; absent: 1.5 x the limit of the profile + what the position loop "
        "adds at the largest following error"
    )  # fmt: skip
    following_error_s: NotNegative = Field(
        0.0, description="allowed following error grows by this time x velocity set-point [s]"
    )
    torque: Positive | None = Field(None, description="measured; absent: 1.5 x the torque limit [N m, N]")
    torque_difference: Positive | None = Field(
        None,
        description="measured against commanded, smoothed; absent: 0.3 x the torque limit, or the "
        "drive's if it is lower [N m, N]",
    )
    load_torque: Positive | None = Field(
        None, description="of weight and process, which may drive the axis against its motor; absent: half of the "
        "torque limit, or of the drive's if it is lower [N m, N]"
    )  # fmt: skip
    continuous_torque: Positive | None = Field(None, description="torque over time (I2t); absent: off [N m, N]")
    thermal_time_s: Positive = Field(10.0, description="time constant of the torque over time [s]")
    residual: ResidualThresholds | None = Field(None, description="of the live twin; absent: off")
