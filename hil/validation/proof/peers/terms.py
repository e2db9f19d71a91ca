"""Terms of the equations of one recording, block by block. traces.json lists the mechanisms behind each kind of term.

Terms that are not linear in a parameter are repeated on a grid of it; orders, periods and the window of a force are
estimated from the residuals of the refitted twin, by the functions of the diagnosis.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import exp, pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.identification.measured import Measured
from hil.twin.axis import Twin
from hil.twin.scene import Scene
from hil.validation.proof.peers import signals

Effects = tuple[str, ...]
TRACES: Mapping[str, list[str]] = json.loads(Path(__file__).with_name("traces.json").read_text(encoding="utf-8"))

_DELAYS_S = (0.25e-3, 0.5e-3, 1e-3, 2e-3)
_STRIBECK_M_S = (1.5e-3, 5e-3, 15e-3)
_BRISTLES_M = (1e-6, 4e-6, 16e-6)
_WARMING_S = (2.0, 6.0, 20.0)
_LIMITS = (0.65, 0.75, 0.85, 0.95)  # of the largest torque
_DEAD_ZONES = (0.03, 0.1, 0.3)  # of Coulomb friction
_MODES_HZ = (15.0, 22.0, 32.0, 47.0, 68.0, 100.0)
_PLAY = (0.02, 0.1, 0.5)  # of the largest acceleration; the last is a soft zone


@dataclass
class BlockEquation:
    """An equation of one run: target (n,), columns of the nominal axis, and terms of mechanisms.

    Target and terms are smoothed if `smooth` is set; the nominal columns are smooth already.
    """

    target: FloatArray
    noise: float
    nominal: list[FloatArray]
    rows: NDArray[np.bool_]
    smooth: bool = True
    columns: list[FloatArray] = field(default_factory=list)
    effects: list[tuple[Effects, Effects]] = field(default_factory=list)

    def add(self, values: FloatArray, trace: str) -> None:
        """Add a term (n,) of a kind in traces.json, where a negative coefficient may have an entry of its own."""
        positive = TRACES[trace]
        self.columns.append(values)
        self.effects.append((tuple(positive), tuple(TRACES.get(f"{trace}, negative", positive))))

    def add_wave(self, phase: FloatArray, scale: FloatArray | float, trace: str) -> None:
        """Add sine and cosine of a phase [rad] (n,)."""
        self.add(scale * np.sin(phase), trace)
        self.add(scale * np.cos(phase), trace)

    def table(self, period_s: float) -> FloatArray:
        """Return target, nominal columns and terms side by side (m, columns), of the evaluated rows."""

        def shown(values: FloatArray) -> FloatArray:
            return signals.smooth(values, period_s) if self.smooth else values

        return np.stack([shown(self.target), *self.nominal, *map(shown, self.columns)], axis=1)[self.rows]


def _controller(run: Measured, bench: Bench, scene: Scene) -> BlockEquation:
    def law(motor: FloatArray, filter_s: float = 0.0) -> FloatArray:
        """Return the command (n,) of the law with a motor position (n,) and a filter of the velocity."""
        gains = bench.gains
        if filter_s > 0.0:
            gains = gains._replace(filter_coefficient=1.0 - exp(-gains.period_s / filter_s))
        seen = run.response._replace(motor_position=motor)
        return Twin(bench.axis.physics(), gains).command(
            run.position_command_m, run.velocity_command_m_s, seen, run.start
        )

    nominal = law(run.motor)
    velocity = signals.smooth(run.motor, run.period_s, 1)
    equation = BlockEquation(run.torque_command - nominal, run.noise.torque, [], _judged(run), smooth=False)
    for time_s in _DELAYS_S:
        equation.add(law(run.motor, time_s) - nominal, "filtered velocity")
        equation.add(law(run.motor + time_s * velocity) - nominal, "late motor position")
    return equation


def _drive(run: Measured, bench: Bench, scene: Scene) -> BlockEquation:
    equation = BlockEquation(run.torque - run.torque_command, run.noise.torque, [], _judged(run), smooth=False)
    _add_torque_path(equation, run, run.torque_command, scene, -1.0, "drive")
    return equation


def _add_torque_path(
    equation: BlockEquation, run: Measured, torque: FloatArray, scene: Scene, sign: float, block: str
) -> None:
    """Add losses of a commanded torque by delay, lag, limit and dead zone.

    Computed from the command: the measured torque would explain its own noise.
    """
    for time_s in _DELAYS_S:
        equation.add(sign * (torque - signals.delayed(torque, time_s, run.period_s)), f"late torque, {block}")
        equation.add(sign * (torque - signals.lagged(torque, time_s, run.period_s)), f"lagging torque, {block}")
    for share in _LIMITS:
        limit = share * scene.peak_torque
        equation.add(sign * (torque - np.clip(torque, -limit, limit)), "torque limit")
    for share in _DEAD_ZONES:
        width = share * scene.coulomb
        equation.add(sign * np.clip(torque, -width, width), "dead zone")


def _motor(run: Measured, bench: Bench, scene: Scene) -> BlockEquation:
    period_s, motor, ratio, time_s = run.period_s, run.motor, scene.ratio, run.time_s
    position, angle = ratio * motor, bench.axis.physics().angle_per_unit * motor
    velocity, acceleration = (signals.smooth(motor, period_s, order) for order in (1, 2))
    way = signals.direction(ratio * velocity)
    speed, friction = np.abs(ratio * velocity), way + velocity / scene.peak_speed
    command = signals.at_rows(run.torque_command)
    nominal = [acceleration, velocity, signals.smooth(way, period_s)]
    if run.table_m.size:  # and the modes of a longer chain to first order
        nominal += [signals.smooth(run.table_m, period_s, order) for order in (2, 4)]
    equation = BlockEquation(
        signals.at_rows(run.torque),
        run.noise.torque,
        nominal,
        _judged(run) & signals.sliding(ratio * velocity, period_s),
    )
    equation.add(np.ones(motor.size), "offset")
    equation.add(speed, "speed")
    equation.add(position, "position")
    equation.add(_window(time_s, scene), "window")
    for slow_m_s in _STRIBECK_M_S:
        equation.add(way * np.exp(-((speed / slow_m_s) ** 2)), "falling friction")
        equation.add(way * np.exp(-speed / slow_m_s), "falling friction")
    distance = signals.since_reversal(position, way)
    for length_m in _BRISTLES_M:
        equation.add(way * np.exp(-distance / length_m), "bristles")
    equation.add(velocity * np.abs(velocity), "drag")
    equation.add(way * np.sqrt(speed), "drag")
    for tau_s in _WARMING_S:
        equation.add(friction * (1.0 - np.exp(-time_s / tau_s)), "warming friction")
    for period_m in scene.friction_periods:
        equation.add_wave(2.0 * pi * position / period_m, way, "friction wave")
    for order in scene.orders:
        equation.add_wave(order * angle, 1.0, "torque wave")
    for order in dict.fromkeys((*scene.ripple_orders, *scene.orders)):
        equation.add_wave(order * angle, command, "command wave")
    equation.add(command**3, "cubed command")
    _add_torque_path(equation, run, command, scene, 1.0, "motor")
    for wave in (np.sin(angle), np.cos(angle)):
        equation.add(signals.curvature(wave, period_s), "eccentric encoder")
    for frequency_hz in _MODES_HZ if run.table_m.size else ():
        equation.add(signals.swayed(signals.curvature(run.table_m, period_s), frequency_hz, period_s), "swaying mass")
    return equation


def _transmission(run: Measured, bench: Bench, scene: Scene) -> BlockEquation:
    period_s, table, time_s = run.period_s, run.table_m, run.time_s
    angle = bench.axis.physics().angle_per_unit * run.motor
    velocity, acceleration, jerk = (signals.smooth(table, period_s, order) for order in (1, 2, 3))
    nominal = [np.ones(table.size), acceleration, jerk, signals.smooth(table, period_s, 4)]
    equation = BlockEquation(table - scene.ratio * run.motor, run.noise.table_m, nominal, _judged(run))
    equation.add(velocity, "late table position")
    equation.add(table, "growing stretch")
    for tau_s in _WARMING_S:
        equation.add(table * (1.0 - np.exp(-time_s / tau_s)), "warming screw")
    equation.add_wave(angle, 1.0, "stretch once per revolution")
    for harmonic in (2.0, 3.0):
        equation.add_wave(harmonic * angle, 1.0, "stretch harmonic")
    for period_m in scene.scale_periods:
        equation.add_wave(2.0 * pi * table / period_m, 1.0, "scale wave")
    equation.add(table * acceleration, "varying stiffness")
    equation.add(signals.direction(velocity), "table direction")
    equation.add(_window(time_s, scene), "window")
    for share in _PLAY:
        width = share * float(np.max(np.abs(acceleration)))
        equation.add(np.clip(acceleration, -width, width) / width, "soft zone" if share == _PLAY[-1] else "play")
    for frequency_hz in _MODES_HZ:
        equation.add(signals.swayed(signals.curvature(table, period_s), frequency_hz, period_s), "swaying mass")
    return equation


def _window(time_s: FloatArray, scene: Scene) -> FloatArray:
    start_s, end_s, _ = scene.windows[0]
    return np.asarray((time_s >= start_s) & (time_s < end_s), dtype=np.float64)


def _judged(run: Measured) -> NDArray[np.bool_]:
    rows = np.zeros(run.motor.size, dtype=bool)
    rows[run.evaluated] = True
    return rows


MAKERS: Mapping[str, Callable[[Measured, Bench, Scene], BlockEquation]] = {
    "controller": _controller,
    "drive": _drive,
    "motor": _motor,
    "transmission": _transmission,
}
