"""Complete the channels of a recording for a plant whose control law is unknown.

    position   = trapezoidal sum of the measured velocity, where no position was recorded
    set-points = measured motion, smoothed, where none were recorded; 0 speed at rest
    torque     = its command or the reverse; where neither was recorded, J a + D v + Fc sign(v) of the bench

The set-points then only tell motion from rest; nothing is simulated from them. A torque that the bench gives is an
input for the twin and no measurement: the residuals of motor and torque are left out (`Observability.hidden`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.identification.derivatives import motion, window_rows
from hil.identification.sensor_noise import white_noise
from hil.recording.recording import RESAMPLED, Recording

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench

_REST = 5.0  # speed at rest in standard deviations of its noise: one row in a million is above
_SLOW = 1e-3  # of the top speed: below lies rest, as for set-points (`sensor_noise.moving`)
DERIVED = "derived"  # key of the metadata: channel -> how it was derived
FROM_BENCH = "inertia and friction of the bench over the measured motion; not measured"


def completed(recording: Recording, bench: Bench) -> Recording:
    """Add missing channels to a recording if the control law of its bench is unknown, and list them in the metadata.

    Raises InputError if neither position nor velocity of the motor was recorded.
    """
    if bench.law_known:
        return recording
    recording = with_position(recording)
    names, columns = recording.axis, dict(recording.columns)
    derived: dict[str, str] = {}

    def add(name: str, values: FloatArray, how: str) -> None:
        if name not in columns:
            columns[name], derived[name] = values, how

    motor = columns[names.motor_position]
    velocity = motion(motor, recording.period_s).velocity
    ratio = bench.axis.ratio_m_rad
    add(names.position_command, ratio * motor, f"measured {names.motor_position}")
    add(names.velocity_command, ratio * without_rest(velocity, motor, bench, recording.period_s), "measured motion")
    for name, other in ((names.torque, names.torque_command), (names.torque_command, names.torque)):
        if other in columns and other not in derived:
            add(name, columns[other].copy(), f"copy of {other}, the only one recorded")
    if names.torque not in columns:
        physics = bench.axis.physics()
        acceleration = motion(motor, recording.period_s, smooth_s=0.0).acceleration  # the shortest parabola
        friction = physics.coulomb_n_m * np.sign(without_rest(velocity, motor, bench, recording.period_s))
        torque = (
            float(physics.chain.inertia_kg_m2.sum()) * acceleration + physics.viscous_n_m_s_rad * velocity + friction
        )
        for name in (names.torque, names.torque_command):
            add(name, torque, FROM_BENCH)
    known = recording.metadata.get(DERIVED, {})
    return replace(recording, columns=columns, metadata={**recording.metadata, DERIVED: {**known, **derived}})


def with_position(recording: Recording) -> Recording:
    """Add the motor position as the sum of the motor velocity where it was not recorded, and say so in the metadata.

    Raises InputError if neither of them was recorded.
    """
    names, columns = recording.axis, recording.columns
    if names.motor_position in columns:
        return recording
    if names.motor_velocity not in columns:
        raise InputError(
            f"{recording.name}: {names.motor_position} is not recorded, allowed are recordings with it or with "
            f"{names.motor_velocity}; record one of them"
        )
    from scipy.integrate import cumulative_trapezoid  # rarely needed, and slow to load

    travelled = cumulative_trapezoid(columns[names.motor_velocity], dx=recording.period_s, initial=0.0)
    position = {names.motor_position: np.asarray(travelled, dtype=np.float64)}
    derived = {**recording.metadata.get(DERIVED, {}), names.motor_position: f"sum of {names.motor_velocity}"}
    return replace(recording, columns={**columns, **position}, metadata={**recording.metadata, DERIVED: derived})


def reduced(bench: Bench, recordings: Sequence[Recording]) -> Bench:
    """The part of a bench without a control law that recordings can judge.

    It has the period of the recordings, and the delay of the torque is estimated unless rows are ticks. It has no table
    encoder unless all recordings have both positions: the sum of a velocity drifts, so that it cannot be compared with
    the table.
    """
    if bench.law_known or not recordings:
        return bench
    if not all({run.axis.motor_position, run.axis.table_position} <= set(run.columns) for run in recordings):
        bench = bench.model_copy(update={"encoders": bench.encoders.model_copy(update={"table": None})})
    bench = bench.sampled(recordings[0].period_s)
    if bench.torque_delay_s is None and not all(rows_are_ticks(run) for run in recordings):
        bench = bench.model_copy(update={"control": bench.control.model_copy(update={"torque_delay_s": 0.0})})
    return bench


def rows_are_ticks(recording: Recording) -> bool:
    """True if the rows are the ticks of the drive, so that the torque of a row acts until the next one.

    Rows of an imported file, or rows that were interpolated or left out, are samples of a torque that changes between
    them.
    """
    return "source" not in recording.metadata and not recording.metadata.get(RESAMPLED)


def torque_is_measured(recording: Recording) -> bool:
    """False if the torque of a completed recording comes from the bench."""
    return bool(recording.metadata.get(DERIVED, {}).get(recording.axis.torque) != FROM_BENCH)


def position_is_measured(recording: Recording) -> bool:
    """False if the motor position of a completed recording is the sum of its velocity."""
    return recording.axis.motor_position not in recording.metadata.get(DERIVED, {})


def without_rest(velocity: FloatArray, position: FloatArray, bench: Bench, period_s: float) -> FloatArray:
    """Velocity (n,) of `motion` with 0 where it is noise or below 1/1000 of the top speed."""
    window = window_rows(period_s)
    # standard deviation of the slope of a parabola or a line through `window` points with white noise
    slope = np.sqrt(12.0 / (window * (window**2 - 1.0))) / period_s
    noise = max(white_noise(position), bench.motor_count / np.sqrt(12.0)) * slope
    least = max(_REST * noise, _SLOW * float(np.max(np.abs(velocity), initial=0.0)))
    return np.where(np.abs(velocity) > least, velocity, 0.0)
