"""The terms of the equations of one recording, block by block, and the mechanisms that each may come from.

What is not linear in a parameter stands on a grid of it; orders, periods and the window of a force are those that stand
out of the residuals of the refitted twin.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.identification.dataset import Measured
from hil.proof.peers import signals
from hil.twin.mechanisms import (
    asymmetric_friction,
    backlash,
    channel_time_skew,
    cogging_torque,
    constant_load,
    cumulative_lead_error,
    current_loop_lag,
    encoder_eccentricity,
    external_force,
    friction_drift,
    nonlinear_viscous_friction,
    periodic_lead_error,
    position_dependent_friction,
    position_dependent_stiffness,
    preload_loss,
    presliding_hysteresis,
    scale_interpolation_error,
    spring_load,
    stribeck_friction,
    structural_mode,
    table_side_friction,
    thermal_growth,
    torque_constant_saturation,
    torque_dead_zone,
    torque_ripple,
    torque_saturation,
    transport_delay,
    velocity_filter_lag,
)
from hil.twin.scene import Scene

Effects = tuple[str, ...]

_DELAYS_S = (0.25e-3, 0.5e-3, 1e-3, 2e-3)
_STRIBECK_M_S = (1.5e-3, 5e-3, 15e-3)
_BRISTLES_M = (1e-6, 4e-6, 16e-6)
_WARMING_S = (2.0, 6.0, 20.0)
_LIMITS = (0.65, 0.75, 0.85, 0.95)  # of the largest torque
_DEAD_ZONES = (0.03, 0.1, 0.3)  # of Coulomb friction
_MODES_HZ = (15.0, 22.0, 32.0, 47.0, 68.0, 100.0)
_PLAY = (0.02, 0.1, 0.5)  # of the largest acceleration; the last is a soft zone


@dataclass
class Draft:
    """An equation of one run: its target (n,), the columns that the nominal axis has, and those of mechanisms.

    Target and terms are smoothed where `smooth` says so; the nominal columns are smooth already.
    """

    target: FloatArray
    noise: float
    nominal: list[FloatArray]
    rows: NDArray[np.bool_]
    smooth: bool = True
    columns: list[FloatArray] = field(default_factory=list)
    effects: list[tuple[Effects, Effects]] = field(default_factory=list)

    def add(self, values: FloatArray, *effects: str, negative: Effects = ()) -> None:
        """A term and the mechanisms that it may come from."""
        self.columns.append(values)
        self.effects.append((effects, negative or effects))

    def add_wave(self, phase: FloatArray, scale: FloatArray | float, *effects: str) -> None:
        """Sine and cosine of a phase."""
        self.add(scale * np.sin(phase), *effects)
        self.add(scale * np.cos(phase), *effects)

    def table(self, period_s: float) -> FloatArray:
        """Target, nominal columns and terms side by side, of the rows that count."""

        def shown(values: FloatArray) -> FloatArray:
            return signals.smooth(values, period_s) if self.smooth else values

        return np.stack([shown(self.target), *self.nominal, *map(shown, self.columns)], axis=1)[self.rows]


def _controller(run: Measured, bench: Bench, scene: Scene) -> Draft:
    law = signals.law(run, bench)
    nominal = law(run.motor, 0.0)
    velocity = signals.smooth(run.motor, run.period_s, 1)
    draft = Draft(run.torque_command - nominal, run.noise.torque, [], _judged(run), smooth=False)
    for time_s in _DELAYS_S:
        draft.add(law(run.motor, time_s) - nominal, velocity_filter_lag.MECHANISM.id)
        draft.add(law(run.motor + time_s * velocity, 0.0) - nominal, channel_time_skew.MECHANISM.id)
    return draft


def _drive(run: Measured, bench: Bench, scene: Scene) -> Draft:
    draft = Draft(run.torque - run.torque_command, run.noise.torque, [], _judged(run), smooth=False)
    _add_torque_path(
        draft, run, run.torque_command, scene, -1.0, transport_delay.MECHANISM.id, channel_time_skew.MECHANISM.id
    )
    return draft


def _add_torque_path(
    draft: Draft, run: Measured, torque: FloatArray, scene: Scene, sign: float, *late: str, negative: Effects = ()
) -> None:
    """What does not come through of a torque: late, behind a lag, beyond a limit, within a dead zone.

    Made of the command: the measured torque would explain its own noise.
    """
    for time_s in _DELAYS_S:
        draft.add(sign * (torque - signals.delayed(torque, time_s, run.period_s)), *late, negative=negative)
        draft.add(
            sign * (torque - signals.lagged(torque, time_s, run.period_s)),
            current_loop_lag.MECHANISM.id,
            negative=negative,
        )
    for share in _LIMITS:
        limit = share * scene.peak_torque
        draft.add(sign * (torque - np.clip(torque, -limit, limit)), torque_saturation.MECHANISM.id)
    for share in _DEAD_ZONES:
        width = share * scene.coulomb
        draft.add(sign * np.clip(torque, -width, width), torque_dead_zone.MECHANISM.id)


def _motor(run: Measured, bench: Bench, scene: Scene) -> Draft:
    period_s, motor, ratio, time_s = run.period_s, run.motor, scene.ratio, run.time_s
    position, angle = ratio * motor, bench.axis.physics().angle_per_unit * motor
    velocity, acceleration = (signals.smooth(motor, period_s, order) for order in (1, 2))
    way = signals.direction(ratio * velocity)
    speed, friction = np.abs(ratio * velocity), way + velocity / scene.peak_speed
    command = signals.at_rows(run.torque_command)
    nominal = [acceleration, velocity, signals.smooth(way, period_s)]
    if run.table_m.size:  # and what the modes of a longer chain add to first order
        nominal += [signals.smooth(run.table_m, period_s, order) for order in (2, 4)]
    draft = Draft(
        signals.at_rows(run.torque),
        run.noise.torque,
        nominal,
        _judged(run) & signals.sliding(ratio * velocity, period_s),
    )
    draft.add(np.ones(motor.size), asymmetric_friction.MECHANISM.id, constant_load.MECHANISM.id)
    draft.add(speed, asymmetric_friction.MECHANISM.id)
    draft.add(position, spring_load.MECHANISM.id)
    draft.add(_window(time_s, scene), external_force.MECHANISM.id)
    for slow_m_s in _STRIBECK_M_S:
        draft.add(way * np.exp(-((speed / slow_m_s) ** 2)), stribeck_friction.MECHANISM.id)
        draft.add(way * np.exp(-speed / slow_m_s), stribeck_friction.MECHANISM.id)
    distance = signals.since_reversal(position, way)
    for length_m in _BRISTLES_M:
        draft.add(way * np.exp(-distance / length_m), presliding_hysteresis.MECHANISM.id)
    draft.add(velocity * np.abs(velocity), nonlinear_viscous_friction.MECHANISM.id)
    draft.add(way * np.sqrt(speed), nonlinear_viscous_friction.MECHANISM.id)
    for tau_s in _WARMING_S:
        draft.add(friction * (1.0 - np.exp(-time_s / tau_s)), friction_drift.MECHANISM.id)
    for period_m in scene.friction_periods:
        draft.add_wave(2.0 * pi * position / period_m, way, position_dependent_friction.MECHANISM.id)
    for order in scene.orders:
        draft.add_wave(order * angle, 1.0, cogging_torque.MECHANISM.id)
    for order in dict.fromkeys((*scene.ripple_orders, *scene.orders)):
        draft.add_wave(order * angle, command, torque_ripple.MECHANISM.id)
    draft.add(command**3, torque_constant_saturation.MECHANISM.id)
    _add_torque_path(
        draft, run, command, scene, 1.0, transport_delay.MECHANISM.id, negative=(channel_time_skew.MECHANISM.id,)
    )
    for wave in (np.sin(angle), np.cos(angle)):
        draft.add(signals.curvature(wave, period_s), encoder_eccentricity.MECHANISM.id)
    for frequency_hz in _MODES_HZ if run.table_m.size else ():
        draft.add(
            signals.swayed(signals.curvature(run.table_m, period_s), frequency_hz, period_s),
            structural_mode.MECHANISM.id,
        )
    return draft


def _transmission(run: Measured, bench: Bench, scene: Scene) -> Draft:
    period_s, table, time_s = run.period_s, run.table_m, run.time_s
    angle = bench.axis.physics().angle_per_unit * run.motor
    velocity, acceleration, jerk = (signals.smooth(table, period_s, order) for order in (1, 2, 3))
    nominal = [np.ones(table.size), acceleration, jerk, signals.smooth(table, period_s, 4)]
    draft = Draft(table - scene.ratio * run.motor, run.noise.table_m, nominal, _judged(run))
    draft.add(velocity, channel_time_skew.MECHANISM.id)
    draft.add(table, cumulative_lead_error.MECHANISM.id, spring_load.MECHANISM.id)
    for tau_s in _WARMING_S:
        draft.add(table * (1.0 - np.exp(-time_s / tau_s)), thermal_growth.MECHANISM.id)
    draft.add_wave(angle, 1.0, periodic_lead_error.MECHANISM.id, encoder_eccentricity.MECHANISM.id)
    for harmonic in (2.0, 3.0):
        draft.add_wave(harmonic * angle, 1.0, periodic_lead_error.MECHANISM.id)
    for period_m in scene.scale_periods:
        draft.add_wave(2.0 * pi * table / period_m, 1.0, scale_interpolation_error.MECHANISM.id)
    draft.add(table * acceleration, position_dependent_stiffness.MECHANISM.id)
    draft.add(signals.direction(velocity), table_side_friction.MECHANISM.id)
    draft.add(_window(time_s, scene), external_force.MECHANISM.id)
    for share in _PLAY:
        width = share * float(np.max(np.abs(acceleration)))
        draft.add(
            np.clip(acceleration, -width, width) / width,
            preload_loss.MECHANISM.id if share == _PLAY[-1] else backlash.MECHANISM.id,
        )
    for frequency_hz in _MODES_HZ:
        draft.add(
            signals.swayed(signals.curvature(table, period_s), frequency_hz, period_s), structural_mode.MECHANISM.id
        )
    return draft


def _window(time_s: FloatArray, scene: Scene) -> FloatArray:
    start_s, end_s, _ = scene.window
    return np.asarray((time_s >= start_s) & (time_s < end_s), dtype=np.float64)


def _judged(run: Measured) -> NDArray[np.bool_]:
    rows = np.zeros(run.motor.size, dtype=bool)
    rows[run.judged] = True
    return rows


MAKERS: Mapping[str, Callable[[Measured, Bench, Scene], Draft]] = {
    "controller": _controller,
    "drive": _drive,
    "motor": _motor,
    "transmission": _transmission,
}
