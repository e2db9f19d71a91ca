"""Edits of what encoders and time stamps say: under a known control law only of channels that the law does not read."""

from collections.abc import Callable, Mapping
from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.recording.recording import Recording
from hil.twin.mechanisms import (
    channel_time_skew,
    cumulative_lead_error,
    encoder_eccentricity,
    periodic_lead_error,
    scale_interpolation_error,
    thermal_growth,
)
from hil.validation.proof.conceal.edit import Edit, later
from hil.validation.proof.conceal.half import EditedChannel, Half, rows_of
from hil.validation.proof.conceal.torque_edits import MOMENTS, Drawn, Rng

_LATEST_S = 8e-3  # of a channel
_SCALE = 2e-3  # largest relative error of a scale
_FASTEST_S = 2.0  # time constant of a growth: what grows faster is another scale
_TURNS = 1.5  # of the travel, least for an error once per turn
_LOST = (0.005, 0.03)  # share of the rows that are lost
_COARSER = (4.0, 100.0)  # factor of the counts


def _table_late(half: Half, rng: Rng) -> Edit | None:
    table, period_s = half.table, half.recording.period_s
    if table is None:
        return None
    return Edit(
        EditedChannel.TABLE, lambda late_s: later(table, late_s / period_s), _LATEST_S, channel_time_skew.MECHANISM,
        told=(0,), instead="late", adds=True, whole=period_s,
    )  # fmt: skip


def _motor_late(half: Half, rng: Rng) -> Edit | None:
    motor, period_s = half.motor, half.recording.period_s
    if half.table is None or half.law_known:
        return None
    return Edit(
        EditedChannel.MOTOR, lambda late_s: later(motor, late_s / period_s), _LATEST_S, channel_time_skew.MECHANISM,
        variant=2, instead="late", adds=True, whole=period_s,
    )  # fmt: skip


def _torque_late(half: Half, rng: Rng) -> Edit | None:
    torque, period_s = half.torque, half.recording.period_s
    if half.command is None or not half.law_known:
        return None

    def delayed(late_s: float) -> FloatArray:
        """Means over each period of a held torque (n,), which a delay mixes without error."""
        whole, part = divmod(late_s / period_s, 1.0)
        longer = np.pad(torque, (int(whole) + 1, 0), mode="edge")
        return np.asarray((1.0 - part) * longer[1 : 1 + torque.size] + part * longer[: torque.size])

    mechanism = channel_time_skew.MECHANISM
    return Edit(EditedChannel.CURRENT, delayed, _LATEST_S, mechanism, variant=1, told=(0,), adds=True, whole=period_s)


def _clock_set(half: Half, rng: Rng) -> Edit | None:
    """The torque is later from a moment on, as where the logger of one channel lost rows."""
    torque, period_s = half.torque, half.recording.period_s
    if half.law_known:
        return None
    moment_s = float(half.time_s[-1] * rng.uniform(*MOMENTS))
    after = half.time_s >= moment_s

    def delayed(late_s: float) -> FloatArray:
        return np.where(after, later(torque, late_s / period_s), torque)

    return Edit(EditedChannel.TORQUE, delayed, _LATEST_S, signed=True, whole=period_s, moment_s=moment_s)


def _scaled(half: Half, rng: Rng) -> Edit | None:
    table = half.table
    if table is None:
        return None
    mechanism = cumulative_lead_error.MECHANISM
    return Edit(
        EditedChannel.TABLE,
        lambda s: (1.0 + s) * table,
        _SCALE,
        mechanism,
        told=(0,),
        instead="ratio",
        signed=True,
        adds=True,
    )


def _growing(half: Half, rng: Rng) -> Edit | None:
    table, whole_s = half.table, half.time_s[-1]
    if table is None or whole_s < _FASTEST_S:
        return None
    time_s = max(whole_s * rng.uniform(0.2, 1.0), _FASTEST_S)
    grown = -np.expm1(-half.time_s / time_s)
    bearing_m = float(np.median(table) + rng.uniform(-1.0, 1.0) * np.ptp(table))
    mechanism, from_bearing = thermal_growth.MECHANISM, table - bearing_m
    return Edit(
        EditedChannel.TABLE,
        lambda g: table + g * grown * from_bearing,
        _SCALE,
        mechanism,
        lambda g: (g, time_s, bearing_m),
    )


def _interpolated(half: Half, rng: Rng) -> Edit | None:
    table, resolution = half.table, half.bench.encoders.table
    if table is None or resolution is None:
        return None
    shortest, longest = max(20.0 * resolution.resolution_m, 1e-5), min(0.2 * float(np.ptp(table)), 8e-3)
    if shortest >= longest:
        return None
    period, phase = float(np.exp(rng.uniform(np.log(shortest), np.log(longest)))), float(rng.uniform(-pi, pi))
    wave = np.sin(2.0 * pi * table / period + phase)
    mechanism = scale_interpolation_error.MECHANISM
    return Edit(
        EditedChannel.TABLE,
        lambda a: table + a * wave,
        0.2 * period,
        mechanism,
        lambda a: (a, period, phase),
        told=(0,),
    )


def _once_per_turn(channel: EditedChannel) -> Drawn:
    def draw(half: Half, rng: Rng) -> Edit | None:
        table, motor, physics = half.table, half.motor, half.bench.axis.physics()
        if table is None or not physics.turn_known or np.ptp(half.angle_rad) < 2.0 * pi * _TURNS:
            return None
        if channel is EditedChannel.MOTOR and half.law_known:
            return None
        phase = float(rng.uniform(-pi, pi))
        wave = np.sin(half.angle_rad + phase)
        eccentric, lead = encoder_eccentricity.MECHANISM, periodic_lead_error.MECHANISM
        if channel is EditedChannel.MOTOR:
            largest = 3e-3 * half.lead / abs(half.ratio)
            return Edit(
                channel, lambda a: motor + a * wave, largest, eccentric, lambda a: (a, phase), told=(0,), rivals=(lead,)
            )
        return Edit(
            channel, lambda a: table + a * wave, 3e-3 * half.lead, lead, lambda a: (a, phase), told=(0,),
            rivals=(eccentric,),
        )  # fmt: skip

    return draw


def rows_lost(half: Half, rng: Rng) -> Recording:
    """The half without some single rows, in motion or at rest."""
    keep = np.ones(len(half.recording), dtype=bool)
    rows = np.arange(2, keep.size - 2)
    keep[rng.choice(rows, round(rng.uniform(*_LOST) * keep.size), replace=False)] = False
    return rows_of(half.recording, keep)


def coarser_counts(half: Half, rng: Rng) -> Recording:
    """The half with coarser counts of its positions."""
    names, columns = half.recording.axis, dict(half.recording.columns)
    factor = float(np.exp(rng.uniform(*np.log(_COARSER))))
    table = half.bench.encoders.table
    steps = {names.motor_position: half.bench.motor_count, names.table_position: table.resolution_m if table else 0.0}
    for name, step in steps.items():
        if name in columns and step > 0.0:
            columns[name] = np.round(columns[name] / (factor * step)) * factor * step
    return rows_of(
        Recording(half.recording.name, columns, half.recording.period_s, half.recording.metadata), slice(None)
    )


SENSOR_EDITS: Mapping[str, Drawn] = {
    "second encoder late": _table_late,
    "motor encoder late": _motor_late,
    "torque late": _torque_late,
    "torque later from a moment on": _clock_set,
    "scale of the second encoder": _scaled,
    "scale over time": _growing,
    "second encoder within a short period": _interpolated,
    "second encoder once per turn": _once_per_turn(EditedChannel.TABLE),
    "motor encoder once per turn": _once_per_turn(EditedChannel.MOTOR),
}
# Less is recorded; nothing is missing in the model.
LOSSES: Mapping[str, Callable[[Half, Rng], Recording]] = {"rows lost": rows_lost, "coarser counts": coarser_counts}
