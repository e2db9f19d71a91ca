"""Traces of the scope: what is drawn of a row, in SI units, with panel and role. Computed from all rows, then reduced.

A motor position is shown at the table, by the ratio of the bench, so that it stands beside command and table; without
a bench it is shown as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS, CHANNELS, SPEED_SET_POINT, AxisKind
from hil.scope.rows import ScopeRows

Columns = Mapping[str, FloatArray]
BEFORE = 1  # rows before the first one that a trace needs: velocities are differences


@dataclass(frozen=True)
class Trace:
    """A trace: name, label, SI unit, panel, role (commanded, measured, twin, residual, loop), and its values (n,)."""

    name: str
    label: str
    unit: str
    panel: str
    role: str
    values: Callable[[Columns], FloatArray]

    @property
    def described(self) -> dict[str, str]:
        """What the page knows of it."""
        return {key: getattr(self, key) for key in ("name", "label", "unit", "panel", "role")}


class Feedback(NamedTuple):
    """Table travel per unit of the motor (None: unknown), and whether the position loop uses the table's encoder."""

    ratio: float | None
    from_table: bool


def feedback(channels: tuple[str, ...], metadata: Mapping[str, Any]) -> Feedback:
    """Read from the metadata of a run."""
    if AxisKind.of(channels) is AxisKind.LINEAR:
        ratio: float | None = 1.0
    else:
        lead_m = metadata.get("lead_m")
        ratio = lead_m / (2.0 * pi) if isinstance(lead_m, int | float) else None
    try:
        bench = Bench.model_validate(metadata.get("bench"))
    except ValidationError:  # none, or one of another version
        return Feedback(ratio, False)
    return Feedback(bench.axis.ratio_m_rad, bench.control.position_feedback == "table")


def traces_of(channels: tuple[str, ...], metadata: Mapping[str, Any]) -> dict[str, Trace]:
    """Traces of a run with these channels, by name, in the order of the panels."""
    known = feedback(channels, metadata)
    made = [trace for trace, needed in _drawn(channels, known) if set(needed) <= set(channels)]
    used = {trace.name for trace in made} | {"time_s"}
    rest = [name for name in channels if name not in used and name in CHANNELS]
    made += [
        Trace(name, name.replace("_", " "), CHANNELS[name].unit, f"other, {CHANNELS[name].unit}", "loop", _column(name))
        for name in rest
    ]
    return {trace.name: trace for trace in made}


def compute(rows: ScopeRows, first: int, end: int, traces: Sequence[Trace]) -> tuple[int, FloatArray]:
    """Time and traces (1 + traces, n) of those of the rows first .. end - 1 that are there; number of the first one."""
    block = rows.read(first - BEFORE, end)
    skip = max(0, min(first - block.first, len(block)))
    values = [block.columns["time_s"], *(trace.values(block.columns) for trace in traces)]
    return block.first + skip, np.stack(values)[:, skip:]


def _drawn(channels: tuple[str, ...], known: Feedback) -> Iterator[tuple[Trace, tuple[str, ...]]]:
    """Every trace there may be, with the channels that it needs."""
    axis = AXIS_CHANNELS[AxisKind.of(channels)]
    motor, table, command = axis.motor_position, axis.table_position, axis.position_command
    twin_motor, twin_table, twin_torque = f"twin_{motor}", f"twin_{table}", f"twin_{axis.torque}"
    ratio, unit = (known.ratio, "m") if known.ratio is not None else (1.0, CHANNELS[motor].unit)
    at_table = unit == "m"
    positions, effort = ("position" if at_table else "motor position"), CHANNELS[axis.torque].unit
    pull = "torque" if effort == "N m" else "force"

    def one(
        name: str, label: str, unit: str, panel: str, role: str, values: Callable[[Columns], FloatArray], *needs: str
    ) -> tuple[Trace, tuple[str, ...]]:
        return Trace(name, label, unit, panel, role, values), needs or (name,)

    yield one(command, "commanded", "m", "position", "commanded", _column(command))
    yield one(table, "table", "m", "position", "measured", _column(table))
    yield one(motor, "motor", unit, positions, "measured 2", _column(motor, ratio))
    yield one(twin_table, "twin, table", "m", "position", "twin", _column(twin_table))
    yield one(twin_motor, "twin, motor", unit, positions, "twin 2", _column(twin_motor, ratio))
    if known.from_table or at_table:
        fed_back, factor = (table, 1.0) if known.from_table else (motor, ratio)
        yield one("following_error_m", "following error", "m", "following error", "commanded",
                  _difference((command, 1.0), (fed_back, factor)), command, fed_back)  # fmt: skip
    yield one("residual_table_m", "table", "m", "position, measured less twin", "measured",
              _difference((table, 1.0), (twin_table, 1.0)), table, twin_table)  # fmt: skip
    panel = "position, measured less twin" if at_table else "motor position, measured less twin"
    yield one("residual_motor", "motor", unit, panel, "measured 2",
              _difference((motor, ratio), (twin_motor, ratio)), motor, twin_motor)  # fmt: skip
    yield one(axis.torque_command, "commanded", effort, pull, "commanded", _column(axis.torque_command))
    yield one(axis.torque, "measured", effort, pull, "measured", _column(axis.torque))
    yield one(twin_torque, "twin", effort, pull, "twin", _column(twin_torque))
    yield one("residual_torque", pull, effort, f"{pull}, measured less twin", "measured",
              _difference((axis.torque, 1.0), (twin_torque, 1.0)), axis.torque, twin_torque)  # fmt: skip
    speed, speeds = f"{unit}/s", ("velocity" if at_table else "motor velocity")
    yield one(axis.velocity_command, "commanded", "m/s", "velocity", "commanded", _column(axis.velocity_command))
    yield one(SPEED_SET_POINT, "output of the position loop", "m/s", "velocity", "loop", _column(SPEED_SET_POINT))
    yield one(axis.motor_velocity, "motor", speed, speeds, "measured", _column(axis.motor_velocity, ratio))
    if axis.motor_velocity not in channels:
        yield one("difference_motor", "motor, difference of positions", speed, speeds, "measured",
                  _rate(motor, ratio), motor)  # fmt: skip
    yield one("difference_twin_motor", "twin, motor", speed, speeds, "twin", _rate(twin_motor, ratio), twin_motor)
    yield one("lateness_s", "lateness of the tick", "s", "loop", "measured", _column("lateness_s"))
    yield one("cycle_s", "time the cycle took", "s", "loop", "loop", _column("cycle_s"))
    yield one("drive_state", "state of the drive", "1", "state", "measured", _column("drive_state"))


def _column(name: str, factor: float = 1.0) -> Callable[[Columns], FloatArray]:
    return lambda columns: columns[name] if factor == 1.0 else factor * columns[name]


def _difference(one: tuple[str, float], other: tuple[str, float]) -> Callable[[Columns], FloatArray]:
    return lambda columns: one[1] * columns[one[0]] - other[1] * columns[other[0]]


def _rate(name: str, factor: float) -> Callable[[Columns], FloatArray]:
    """Difference to the row before, by time; that of the first row is taken from the second one."""

    def values(columns: Columns) -> FloatArray:
        if len(columns[name]) < 2:
            return np.zeros(len(columns[name]))
        rates = factor * np.diff(columns[name]) / np.diff(columns["time_s"])
        return np.concatenate((rates[:1], rates))

    return values
