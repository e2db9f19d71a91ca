"""Draw axes: true parameters, control loop, sensors, and the parameters in the owner's bench file.

Bandwidths follow the reference axis (velocity loop at about a quarter of the first resonance, position loop at about a
quarter of the velocity loop); an axis whose loop rings without friction is drawn again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isfinite, pi, sqrt
from typing import Any, Literal, cast

import numpy as np

from drivers.sim.axis import AxisTruth
from drivers.sim.reality import record
from drivers.sim.sensors import Sensors
from drivers.sim.servo import Servo, VelocityEstimate
from hil.bench.bench_file import Bench
from hil.validation.proof.draw.axis_kinds import KINDS, PARAMETERS, Kind, Rng, log_uniform, rigid_inertia, truth_of

Belief = Literal["exact", "wrong"]

JERK_M_S3 = 100.0  # of the moves: full acceleration of some 2 m/s^2 within 20 ms, as of a machine tool
WRONG_BY = 1.3  # largest factor between a true parameter and the owner's
STEP_S = 2e-5  # internal step: 1 to 4 % of a loop period, and below half a radian of the fastest mode
_TABLE_COUNTS_M = (0.1e-6, 0.2e-6, 0.5e-6, 1e-6)
_COARSE_COUNTS_M = (1e-6, 2e-6, 5e-6)
_SPARE_M = 0.01  # travel beyond the strokes
_RINGING = 0.01  # of the largest torque: limit at rest for an axis without friction


@dataclass(frozen=True, eq=False)
class DrawnAxis:
    """An axis with its loop. `true` and `believed` have the keys of the section `axis` of a bench file."""

    kind: Kind
    true: Mapping[str, Any]
    believed: Mapping[str, Any]
    servo: Servo
    sensors: Sensors
    period_s: float
    travel_m: float
    feed_m_s: float  # highest
    acceleration_m_s2: float

    @cached_property
    def truth(self) -> AxisTruth:
        """The true axis."""
        return self.with_parameters({})

    def with_parameters(self, changes: Mapping[str, float]) -> AxisTruth:
        """Return the axis with other true parameters."""
        return truth_of(self.kind, {**self.true, **changes})

    @property
    def nominal(self) -> tuple[str, ...]:
        """Names of the parameters that may be wrong."""
        return self.bench.axis.NOMINAL

    @property
    def has_table(self) -> bool:
        """True if there is a linear encoder."""
        return not self.truth.linear

    @property
    def coulomb(self) -> float:
        """Coulomb friction [N m, N]."""
        return self.truth.coulomb_torque_n_m

    @property
    def table_noise_m(self) -> float:
        """Standard deviation of table less r x motor position, of counting and noise."""
        motor_m = 2 * pi / self.sensors.motor_counts_per_rev * self.truth.screw_ratio_m_rad
        return sqrt((self.sensors.table_resolution_m**2 + motor_m**2) / 12 + self.sensors.table_noise_m**2)

    @cached_property
    def bench(self) -> Bench:
        """The bench as in the owner's file."""
        servo, linear = self.servo, self.kind == "one_mass"
        control = {
            "position_gain_1_s": servo.position_gain_1_s,
            "velocity_feedforward": servo.velocity_feedforward,
            "position_period_s": servo.position_every * self.period_s,
            "velocity_period_s": self.period_s,
            "velocity_gain_n_s_m" if linear else "velocity_gain_n_m_s_rad": servo.velocity_gain_n_m_s_rad,
            "force_limit_n" if linear else "torque_limit_n_m": servo.torque_limit_n_m,
            "velocity_estimate": str(servo.velocity_estimate),
        }
        if isfinite(servo.velocity_integral_time_s):
            control["velocity_integral_time_s"] = servo.velocity_integral_time_s
        if linear:
            motor: dict[str, Any] = {"resolution_m": self.true["screw_lead_m"] / self.sensors.motor_counts_per_rev}
        else:
            motor = {"counts_per_rev": int(self.sensors.motor_counts_per_rev)}
        table = None if linear else {"resolution_m": self.sensors.table_resolution_m}
        return Bench.model_validate(
            {
                "name": "axis",
                "axis": {"model": self.kind, **self.believed},
                "control": control,
                "encoders": {"motor": motor, "table": table},
                # the owner knows the limits of the axis even if a recording does not reach them
                "drive": {
                    "travel_m": [-_SPARE_M, self.travel_m + _SPARE_M],
                    "limits": {
                        "velocity_m_s": self.feed_m_s,
                        "acceleration_m_s2": self.acceleration_m_s2,
                        "jerk_m_s3": JERK_M_S3,
                    },
                },
            }
        )


def draw_axis(rng: Rng, kind: Kind | None = None, belief: Belief = "wrong", hard: bool = False) -> DrawnAxis:
    """Draw an axis with a stable loop. `hard`: more noise, coarser encoders, jitter."""
    if kind is None:
        kind = cast(Kind, str(rng.choice(list(KINDS), p=list(KINDS.values()))))
    while True:
        axis = _drawn(rng, kind, belief, hard)
        if _settles(axis):
            return axis


def _drawn(rng: Rng, kind: Kind, belief: Belief, hard: bool) -> DrawnAxis:
    true = PARAMETERS[kind](rng)
    period_s = 0.5e-3 if rng.random() < 0.15 else 1e-3
    position_every = int(rng.choice((1, 2, 4)))
    feed_m_s = min(rng.uniform(0.15, 0.35) * sqrt(true.get("lead_m", 0.01) / 0.01), 0.45)
    acceleration = rng.uniform(1.0, 3.0)
    truth = truth_of(kind, true)
    servo = _servo(rng, truth, feed_m_s, acceleration, period_s, position_every)
    sensors = Sensors(
        motor_counts_per_rev=2.0 ** int(rng.integers(15, 18) if hard else rng.integers(17, 24)),
        table_resolution_m=float(rng.choice(_COARSE_COUNTS_M if hard else _TABLE_COUNTS_M)),
        torque_noise_n_m=truth.coulomb_torque_n_m * log_uniform(rng, *((0.01, 0.05) if hard else (0.003, 0.02))),
        torque_noise_correlation=rng.uniform(0.0, 0.5),
        sampling_jitter_s=rng.uniform(0.0, 3e-6) if hard else 0.0)  # fmt: skip
    drawn = DrawnAxis(kind, true, true, servo, sensors, period_s, rng.uniform(0.2, 0.4), feed_m_s, acceleration)
    if belief == "exact":
        return drawn
    believed = dict(true)
    for name in drawn.nominal:
        believed[name] = true[name] * log_uniform(rng, 1.0 / WRONG_BY, WRONG_BY)
    return replace(drawn, believed=believed)


def _servo(
    rng: Rng, truth: AxisTruth, feed_m_s: float, acceleration_m_s2: float, period_s: float, position_every: int
) -> Servo:
    """Draw gains by bandwidth: whole inertia below the first resonance, motor alone below the limit of the delay."""
    ratio = truth.drive_ratio_m_rad
    inertia = rigid_inertia(truth)
    elastic = truth.frequencies_hz()[1:]
    bandwidth = rng.uniform(120.0, 220.0)
    if elastic.size:
        bandwidth = min(bandwidth, rng.uniform(0.18, 0.30) * 2 * pi * float(elastic[0]))
    else:
        bandwidth = min(bandwidth, 160.0)
    motor_inertia = truth.mass_kg[0] * ratio**2
    gain = min(bandwidth * inertia, rng.uniform(200.0, 320.0) * 1e-3 / period_s * motor_inertia)
    bandwidth = gain / inertia
    position_gain = min(rng.uniform(0.16, 0.27) * bandwidth, 0.2 / (position_every * period_s))
    needed = (inertia * acceleration_m_s2 + truth.viscous_torque_n_m_s_rad * feed_m_s) / ratio
    plain = truth.linear and rng.random() < 0.5  # as on EMPS: P velocity loop, no feed-forward
    return Servo(
        position_gain_1_s=_rounded(position_gain * (2.0 if plain else 1.0)),
        velocity_feedforward=0.0 if plain else 1.0,
        velocity_gain_n_m_s_rad=_rounded(gain),
        velocity_integral_time_s=inf if plain else _rounded(rng.uniform(0.9, 2.0) / bandwidth),
        torque_limit_n_m=_rounded(rng.uniform(2.0, 3.5) * (needed + truth.coulomb_torque_n_m), 2),
        position_every=position_every,
        velocity_estimate=VelocityEstimate(rng.choice(list(VelocityEstimate), p=[0.7, 0.3])))  # fmt: skip


def _settles(axis: DrawnAxis) -> bool:
    """Check that the loop comes to rest without friction."""
    names = ("coulomb_torque_n_m", "viscous_torque_n_m_s_rad", "coulomb_force_n", "viscous_force_n_s_m")
    free = axis.with_parameters({name: 0.0 for name in names if name in axis.true})
    count = round(1.0 / axis.period_s)
    time_s = np.arange(count) * axis.period_s
    turn = np.minimum(time_s / 0.2, 1.0) * 2 * pi
    position = 0.01 * (turn - np.sin(turn)) / (2 * pi)
    velocity = 0.01 * (1.0 - np.cos(turn)) / 0.2
    perfect = Sensors(motor_counts_per_rev=0, table_resolution_m=0, torque_noise_n_m=0)
    rows = record(free, perfect, [], axis.servo, position, velocity, axis.period_s, step_s=STEP_S)
    torque = np.abs(rows["force_n" if axis.truth.linear else "torque_n_m"])
    return bool(np.max(torque[-count // 5 :]) < _RINGING * np.max(torque))


def _rounded(value: float, digits: int = 4) -> float:
    """Round to significant digits, as gains are entered in a drive."""
    return float(f"{value:.{digits}g}")
