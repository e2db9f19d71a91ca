"""Control section of a bench file: the law of `hil.control.cascade` with its gains, or that it is not known.

Without a known law the plant is judged alone: measured torque in, measured motion out.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from hil.bench.axis_fields import BenchSection, NotNegative, Positive
from hil.control.cascade import INFINITE, Gains, make_gains
from hil.errors import FieldError
from hil.quantities import digits

_MA_PER_RPM = 1e-3 * 60.0 / (2.0 * math.pi)  # mA/rpm in A s/rad
UNKNOWN = "unknown"
MOST_TORQUE_DELAY_S = 0.5  # either way: a mean over a row of 300 ms, and the filter of a current

# a period in milliseconds is refused
Period = Annotated[float, Field(gt=0.0, le=0.1, allow_inf_nan=False, description="period of the loop [s]")]


class Control(BenchSection):
    """The control law of `hil.control.cascade`, gains in SI or in the units of the source."""

    law: Literal["cascade"] = "cascade"
    position_gain_1_s: Positive = Field(description="Kv [1/s]")
    velocity_feedforward: NotNegative = Field(1.0, description="share of the velocity set-point fed forward, 1: all")
    position_period_s: Period = 0.004
    velocity_gain_n_m_s_rad: Positive | None = Field(None, description="Kp [N m s/rad]; or the next two")
    velocity_gain_n_s_m: Positive | None = Field(None, description="Kp of a linear axis [N s/m]")
    velocity_gain_ma_rpm: Positive | None = Field(None, description="Kp [mA/rpm], with torque_constant_n_m_a")
    torque_constant_n_m_a: Positive | None = Field(None, description="Kt [N m/A]")
    velocity_integral_time_s: Positive | None = Field(None, description="Ti [s]; absent: a P velocity loop")
    velocity_integral_time_ms: Positive | None = Field(None, description="Ti [ms]")
    velocity_period_s: Period = 0.001
    torque_limit_n_m: Positive | None = Field(None, description="limit of the torque command; absent: none")
    force_limit_n: Positive | None = Field(
        None, description="limit of the force command of a linear axis; absent: none"
    )
    position_feedback: Literal["motor", "table"] = Field("motor", description="encoder of the position loop")
    velocity_estimate: Literal["backward_difference", "two_sample_mean"] = Field(
        "backward_difference", description="how the velocity follows from the motor encoder"
    )
    velocity_filter_time_constant_s: NotNegative = Field(0.0, description="low-pass of that velocity; 0: none")
    velocity_setpoint: Literal["recorded", "backward_difference"] = Field(
        "recorded", description="of the feed-forward, in a recording; or the last difference of its position set-points"
    )
    setpoint_delay_s: float = Field(
        0.0, ge=-10.0, le=10.0, description="the loop uses the set-points of a recording so much later [s]"
    )

    @model_validator(mode="after")
    def _one_gain(self) -> Self:
        given = [self.velocity_gain_n_m_s_rad, self.velocity_gain_n_s_m, self.velocity_gain_ma_rpm]
        if sum(value is not None for value in given) != 1:
            raise FieldError(
                ("velocity_gain_n_m_s_rad",),
                "give the velocity gain once: velocity_gain_n_m_s_rad, "
                "velocity_gain_n_s_m (linear axis) or velocity_gain_ma_rpm",
            )
        if self.velocity_gain_ma_rpm is not None and self.torque_constant_n_m_a is None:
            raise FieldError(
                ("torque_constant_n_m_a",), "given nothing, allowed a value in N m/A: velocity_gain_ma_rpm needs it"
            )
        if self.velocity_integral_time_s is not None and self.velocity_integral_time_ms is not None:
            raise FieldError(("velocity_integral_time_ms",), "given twice; remove it or velocity_integral_time_s")
        ticks = round(self.position_period_s / self.velocity_period_s)
        if ticks < 1 or abs(ticks * self.velocity_period_s - self.position_period_s) > 1e-9:
            raise FieldError(
                ("position_period_s",),
                f"given {self.position_period_s}, allowed a whole multiple of "
                f"velocity_period_s = {self.velocity_period_s}",
            )
        return self

    def gains(self, ratio_m_rad: float) -> Gains:
        """Return the constants of the control law for an axis with this ratio [m/rad]."""
        if self.velocity_gain_ma_rpm is not None and self.torque_constant_n_m_a is not None:
            gain = self.velocity_gain_ma_rpm * _MA_PER_RPM * self.torque_constant_n_m_a
        else:
            gain = self.velocity_gain_n_m_s_rad or self.velocity_gain_n_s_m or 0.0
        integral = self.velocity_integral_time_s
        if self.velocity_integral_time_ms is not None:
            integral = 1e-3 * self.velocity_integral_time_ms
        return make_gains(
            position_gain_1_s=self.position_gain_1_s,
            velocity_gain_n_m_s_rad=gain,
            ratio_m_rad=ratio_m_rad,
            velocity_feedforward=self.velocity_feedforward,
            velocity_integral_time_s=integral,
            velocity_period_s=self.velocity_period_s,
            position_period_s=self.position_period_s,
            torque_limit_n_m=self.torque_limit_n_m or self.force_limit_n or INFINITE,
            position_from_table=self.position_feedback == "table",
            two_sample_mean=self.velocity_estimate == "two_sample_mean",
            velocity_filter_time_constant_s=self.velocity_filter_time_constant_s,
        )

    @property
    def gain_names(self) -> tuple[str, str, str, str]:
        """Keys of position gain, velocity feed-forward, velocity gain and integral time that the section uses."""
        keys = ("velocity_gain_n_m_s_rad", "velocity_gain_n_s_m", "velocity_gain_ma_rpm")
        velocity = next(key for key in keys if getattr(self, key) is not None)
        in_ms = self.velocity_integral_time_ms is not None
        integral = "velocity_integral_time_ms" if in_ms else "velocity_integral_time_s"
        return "position_gain_1_s", "velocity_feedforward", velocity, integral

    def with_gains(self, gains: Gains) -> Self:
        """The section with position gain, feed-forward, velocity gain and integral time of `gains`, in its units."""
        before = self.gains(gains.ratio_m_rad)
        position, feedforward, velocity, integral = self.gain_names
        factor = gains.velocity_gain_n_m_s_rad / before.velocity_gain_n_m_s_rad
        changed = {
            position: gains.position_gain_1_s,
            feedforward: gains.velocity_feedforward,
            velocity: getattr(self, velocity) * factor,
        }
        if gains.integral_gain_n_m_rad > 0.0:
            time_s = gains.velocity_gain_n_m_s_rad / gains.integral_gain_n_m_rad
            changed[integral] = 1e3 * time_s if integral.endswith("_ms") else time_s
        return self.model_copy(update=changed)


def delay_in_words(delay_s: float) -> str:
    """A torque delay [s] as text: positive if the recorded torque acts later, negative if it has acted before."""
    shown = f"{digits(1e3 * abs(delay_s))} ms"
    return f"torque acts {shown} after its row" if delay_s >= 0.0 else f"torque is recorded {shown} after it acts"


class UnknownControl(BenchSection):
    """A control law that is not known. It is not simulated, and no mismatch is assigned to it."""

    law: Literal["unknown"]
    velocity_period_s: Period | None = Field(None, description="absent: the period of the recording")
    torque_delay_s: float | None = Field(
        None,
        ge=-MOST_TORQUE_DELAY_S,
        le=MOST_TORQUE_DELAY_S,
        description="the recorded torque acts so much later, negative: has acted so much before; estimated from this "
        "value; absent: 0 [s]",
    )
    position_feedback: Literal["motor", "table"] = Field("motor", description="encoder of the position loop")
    torque_limit_n_m: Positive | None = Field(None, description="limit of the torque command; absent: none")
    force_limit_n: Positive | None = Field(
        None, description="limit of the force command of a linear axis; absent: none"
    )

    def gains(self, ratio_m_rad: float) -> Gains:
        """Return period, ratio and limit, with gains of 0: a controller that commands nothing.

        Raises FieldError without a period.
        """
        if self.velocity_period_s is None:
            raise FieldError(
                ("control", "velocity_period_s"), "given nothing, allowed a value in s; a recording gives it"
            )
        return make_gains(
            position_gain_1_s=0.0,
            velocity_gain_n_m_s_rad=0.0,
            ratio_m_rad=ratio_m_rad,
            velocity_period_s=self.velocity_period_s,
            position_period_s=self.velocity_period_s,
            torque_limit_n_m=self.torque_limit_n_m or self.force_limit_n or INFINITE,
            position_from_table=self.position_feedback == "table",
        )


def without_law(control: Control) -> UnknownControl:
    """Return the section without its law; position feedback and torque limit are kept."""
    kept = control.model_dump(include={"position_feedback", "torque_limit_n_m", "force_limit_n"})
    return UnknownControl(law="unknown", **kept)


ControlSection = Annotated[Control | UnknownControl, Field(discriminator="law")]


def with_law(given: Any) -> Any:
    """Add the key `law` to a control section: unknown if the section, or a value in it, is absent or `unknown`.

    Of a law that is known in part the keys of `UnknownControl` are kept. Raises FieldError for a key that neither has.
    """
    if given is None or given == UNKNOWN:
        return {"law": UNKNOWN}
    if not isinstance(given, dict) or UNKNOWN not in given.values():
        return {"law": "cascade", **given} if isinstance(given, dict) else given
    known = tuple(dict.fromkeys((*Control.model_fields, *UnknownControl.model_fields)))
    for key in given:
        if key not in known:
            raise FieldError(("control", key), f"given an unknown key, allowed one of {', '.join(known)}; remove it")
    kept = {key: value for key, value in given.items() if key in UnknownControl.model_fields and value != UNKNOWN}
    return {**kept, "law": UNKNOWN}
