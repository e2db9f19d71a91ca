"""Encoders and torque measurement of the simulated axis: resolution, offset, noise, sampling jitter."""

from dataclasses import dataclass, fields
from math import atan2, cos, isfinite, log, pi, sin, sqrt
from typing import Any

import numpy as np
from numba import njit

from drivers.sim.layout import CHANNEL_LINE, delayed


@dataclass(frozen=True)
class Sensors:
    """Settings of the sensors; defaults are the reference axis. A resolution or noise of 0 means none.

    motor_counts_per_rev: counts per screw revolution (on a linear axis per lead_m of travel).
    motor_offset_rad: turn-on offset of the motor encoder, in the unit of its channel.
    torque_noise_n_m: rms; torque_noise_correlation: AR(1) coefficient from one period to the next.
    sampling_jitter_s: rms of the true sampling instants of both encoders about the nominal ones.
    """

    motor_counts_per_rev: float = 2**20
    table_resolution_m: float = 0.5e-6
    motor_offset_rad: float = 0.0
    table_offset_m: float = 0.0
    motor_noise_rad: float = 0.0
    table_noise_m: float = 0.0
    torque_noise_n_m: float = 0.01
    torque_noise_correlation: float = 0.0
    sampling_jitter_s: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            offset = item.name.endswith(("offset_rad", "offset_m"))
            if not isfinite(value) or (value < 0 and not offset):
                raise ValueError(f"sensors.{item.name}: must be finite and >= 0, got {value!r}")
        if self.torque_noise_correlation >= 1:
            raise ValueError(f"sensors.torque_noise_correlation: must be < 1, got {self.torque_noise_correlation!r}")


_INCREMENT = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S11, _S27, _S30, _S31 = np.uint64(11), np.uint64(27), np.uint64(30), np.uint64(31)


@njit(cache=True)
def uniform(s: Any) -> float:
    """Next number in (0, 1) of SplitMix64 (Steele, Lea, Flood 2014), state in s.random."""
    s.random = s.random + _INCREMENT
    z = s.random
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    z = z ^ (z >> _S31)
    return (np.float64(z >> _S11) + 0.5) / 9007199254740992.0


@njit(cache=True)
def normal(s: Any) -> float:
    """Standard normal number (Box and Muller 1958)."""
    return sqrt(-2.0 * log(uniform(s))) * cos(2.0 * pi * uniform(s))


@njit(cache=True)
def quantise(value: float, resolution: float) -> float:
    """Nearest multiple of the resolution; 0 leaves the value as it is."""
    return resolution * np.floor(value / resolution + 0.5) if resolution > 0.0 else value


@njit(cache=True)
def sample(p: Any, s: Any, lines: Any) -> None:
    """Digitise both encoders at this tick into s."""
    instant = p.sampling_jitter_s * normal(s) if p.sampling_jitter_s > 0.0 else 0.0
    motor = motor_truth(p, s) + instant * s.velocity[0] / p.drive_ratio
    table = table_truth(p, s) + instant * s.velocity[p.table]
    motor_late, table_late = motor, table
    skew = p.channel_time_skew
    if skew.on and skew.form < 2:
        late = delayed(lines[CHANNEL_LINE], s.tick, skew.delay_s / p.step_s)
        if skew.form == 0:
            table_late = late
        else:
            motor_late = late
    noise_motor = p.motor_noise * normal(s) if p.motor_noise > 0.0 else 0.0
    noise_table = p.table_noise * normal(s) if p.table_noise > 0.0 else 0.0
    s.motor_seen = quantise(motor + noise_motor, p.motor_resolution)
    s.table_seen = quantise(table + noise_table, p.table_resolution)
    s.motor_recorded = quantise(motor_late + noise_motor, p.motor_resolution)
    s.table_recorded = quantise(table_late + noise_table, p.table_resolution)


@njit(cache=True)
def motor_truth(p: Any, s: Any) -> float:
    """Reading of the motor encoder without resolution and noise."""
    e = p.encoder_eccentricity
    reading: float = s.position[0] / p.drive_ratio + p.motor_offset
    if e.on:
        reading += e.amplitude_rad * sin(s.position[0] / p.screw_ratio + e.phase_rad)
    return reading


@njit(cache=True)
def table_truth(p: Any, s: Any) -> float:
    """Reading of the linear encoder, fixed to the machine base, without resolution and noise."""
    e = p.scale_interpolation_error
    reading: float = s.position[p.table] + p.table_offset
    if p.base >= 0:
        reading -= s.position[p.base]
    if p.load_encoder_eccentricity.on:
        reading += off_centre(p.load_encoder_eccentricity, s.position[p.table])
    if e.on:
        reading += e.amplitude_m * sin(2.0 * pi * reading / e.period_m + e.phase_rad)
    return reading


@njit(cache=True)
def off_centre(e: Any, angle_rad: float) -> float:
    """Error [rad] of one head on a graduation whose centre is off the axis of rotation.

    In radii of the graduation, seen from its centre: the axis is at distance a, and the head one radius from the axis.
    """
    across = e.amplitude_rad * sin(angle_rad + e.phase_rad)
    along = e.amplitude_rad * cos(angle_rad + e.phase_rad)
    return atan2(across, 1.0 + along)
