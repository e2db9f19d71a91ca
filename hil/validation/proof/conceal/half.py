"""One half of a real recording: its channels and motion, and how well least squares tell an effect in them."""

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from math import inf, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.bench.control_section import Control, without_law
from hil.identification.derivatives import MeasuredMotion, motion
from hil.identification.derived_channels import DERIVED, with_position
from hil.identification.least_squares import Columns, Estimate, LinearFit, least_squares
from hil.identification.plain_model import MOTION, fit_plain_model, motion_data, plain_columns
from hil.recording.recording import RESAMPLED, Recording

# Of the metadata a case keeps what a reader uses: anything else may tell where the recording comes from.
_KEPT = ("source", "channels", "lead_m", DERIVED, RESAMPLED)
_CUTS = np.linspace(0.3, 0.7, 41)  # shares of the recording at which it may be cut, the nearest to its middle first
_AS_FAR = 0.8  # of the farthest travel both ways that a cut leaves to its lesser half
_ITSELF = 0.1  # of what the other regressors leave: a shape that leaves less is made of the channel itself
_FEW = 0.1  # of the rows
_SLIDING = 0.02  # of the top speed: below, an axis may stick, and its torque is not that of its friction


class EditedChannel(StrEnum):
    """Channel that an edit changes, and the raw channels in which least squares tell it."""

    TORQUE = "torque"  # in the torque that the motion needs
    TABLE = "table"  # in the difference of the encoders
    MOTOR = "motor"  # the same
    CURRENT = "current"  # in the difference of torque and its command


@dataclass(frozen=True, eq=False)
class Half:
    """A half of a recording with the bench of the axis, `part` 0 or 1; `source` is the name of the whole.

    Without a known control law the recording has one torque channel, which is the input of the plant.
    """

    recording: Recording
    bench: Bench
    source: str
    part: int

    @property
    def law_known(self) -> bool:
        """True if the control law of the bench must go on to reproduce the commands."""
        return self.bench.law_known

    @property
    def time_s(self) -> FloatArray:
        """Time (n,) since the first row of the half [s]."""
        return np.asarray(np.arange(len(self.recording)) * self.recording.period_s, dtype=np.float64)

    @cached_property
    def motor(self) -> FloatArray:
        """Motor position (n,) [rad, linear axis m]."""
        return with_position(self.recording)[self.recording.axis.motor_position]

    @property
    def motor_measured(self) -> bool:
        """True if the motor position was recorded."""
        return self.recording.axis.motor_position in self.recording.columns

    @property
    def table(self) -> FloatArray | None:
        """Position of the second encoder (n,) [m, of a load that turns rad].

        None without both encoders, and where a known law reads it.
        """
        read = self.law_known and self.bench.control.position_feedback == "table"
        free = self.bench.has_table_encoder and self.motor_measured and not read
        return self.recording.columns.get(self.recording.axis.table_position) if free else None

    @property
    def torque(self) -> FloatArray:
        """Measured torque (n,) in the unit of the motor side."""
        return self.recording[self.recording.axis.torque]

    @property
    def command(self) -> FloatArray | None:
        """Torque command (n,) beside a torque of its own; None if one stands for the other."""
        command = self.recording.columns.get(self.recording.axis.torque_command)
        return None if command is None or np.array_equal(command, self.torque) else command

    @cached_property
    def moved(self) -> MeasuredMotion:
        """Smoothed motion of the motor."""
        return motion(self.motor, self.recording.period_s)

    @property
    def ratio(self) -> float:
        """Table travel per unit of the motor."""
        return self.bench.axis.ratio_m_rad

    @property
    def position_m(self) -> FloatArray:
        """Position (n,) of the load by the motor encoder [m, of a load that turns rad]."""
        return np.asarray(self.ratio * self.motor)

    @property
    def angle_rad(self) -> FloatArray:
        """Angle of the motor (n,)."""
        return np.asarray(self.bench.axis.physics().angle_per_unit * self.motor)

    @property
    def lead(self) -> float:
        """Travel of the load per turn of the motor [m, of a load that turns rad]."""
        return abs(self.ratio) * 2.0 * pi / self.bench.axis.physics().angle_per_unit

    @cached_property
    def _torque_columns(self) -> Columns:
        """Regressors (n,) of the plain model that the half earns."""
        load_ratio = self.ratio if getattr(self.bench.axis, "turns", False) else None
        data = motion_data(self.motor, self.torque, self.recording.period_s)
        plain = fit_plain_model([data], load_ratio, spring=True)
        names = plain.fit.names if plain is not None else MOTION
        columns = plain_columns(self.moved, load_ratio, spring=True)
        return {name: columns[name] for name in names}

    @cached_property
    def sliding(self) -> NDArray[np.bool_]:
        """Rows (n,) in which the axis slides; all where it hardly does."""
        speed = np.abs(self.moved.velocity)
        rows = speed > _SLIDING * float(np.max(speed))
        return rows if np.mean(rows) > _FEW else np.ones(rows.size, dtype=bool)

    @cached_property
    def plain(self) -> LinearFit:
        """Plain model of the raw torque on sliding rows, with errors that count correlated residuals."""
        columns = {name: column[self.sliding] for name, column in self._torque_columns.items()}
        return least_squares(columns, self.torque[self.sliding])

    def told(self, channel: EditedChannel, shape: FloatArray, instead: str = "") -> Estimate:
        """Coefficient of a shape (n,), the change of a channel for a strength of 1, in the raw channels.

        It is fitted beside the plain model of the torque, or ratio, datum, delay and stretch of the encoders; `instead`
        is the name of the regressor that it takes the place of.
        """
        rows = self.sliding if channel is EditedChannel.TORQUE else np.ones(shape.size, dtype=bool)
        if channel is EditedChannel.TORQUE:
            columns, target = dict(self._torque_columns), self.torque
        elif channel is EditedChannel.CURRENT:
            assert self.command is not None
            columns, target = {"offset": np.ones(shape.size)}, self.torque - self.command
        else:
            assert self.table is not None
            moved = self.moved
            columns = {"ratio": self.motor, "late": moved.velocity, "stretch": moved.acceleration}
            columns["offset"], target = np.ones(shape.size), self.table - self.position_m
            shape = shape if channel is EditedChannel.TABLE else -self.ratio * shape
        columns.pop(instead, None)
        columns, target = {name: column[rows] for name, column in columns.items()}, target[rows]
        fit = least_squares({**columns, "shape": shape[rows]}, target)
        if fit.left < _ITSELF * least_squares(columns, target).left:  # it is the channel that it should explain
            return Estimate(fit["shape"].value, inf)
        return fit["shape"]


def halves(recording: Recording) -> tuple[Recording, Recording]:
    """Cut the longest part of a recording where both halves move both ways as far as can be; both begin at time 0."""
    whole = max(recording.parts(), key=len)
    at = with_position(whole)[whole.axis.motor_position]
    cuts = sorted((round(share * len(whole)) for share in _CUTS), key=lambda cut: abs(cut - len(whole) // 2))
    both = [min(_both_ways(at[:cut]), _both_ways(at[cut:])) for cut in cuts]
    cut = next(cut for cut, far in zip(cuts, both, strict=True) if far >= _AS_FAR * max(both))
    metadata = {key: value for key, value in whole.metadata.items() if key in _KEPT}
    one, other = (rows_of(replace(whole, metadata=metadata), rows) for rows in (slice(0, cut), slice(cut, None)))
    return one, other


def _both_ways(position: FloatArray) -> float:
    """Travel forwards or backwards, the lesser, in the unit of the position (n,)."""
    forwards = float(np.max(position - np.minimum.accumulate(position)))
    return min(forwards, float(np.max(np.maximum.accumulate(position) - position)))


def rows_of(recording: Recording, rows: slice | NDArray[Any]) -> Recording:
    """Some rows of a recording, the first one at time 0."""
    columns = {name: values[rows].copy() for name, values in recording.columns.items()}
    columns["time_s"] = columns["time_s"] - columns["time_s"][0]
    return replace(recording, columns=columns, start_s=0.0)


def as_plant(half: Half) -> Half:
    """The half for which no control law is known: the torque is the input, the set-points only tell motion."""
    names, bench = half.recording.axis, half.bench
    columns = dict(half.recording.columns)
    command = columns.pop(names.torque_command, None)
    if names.torque not in columns and command is not None:
        columns[names.torque] = command
    if isinstance(bench.control, Control):
        bench = bench.model_copy(update={"control": without_law(bench.control)})
    return replace(half, recording=replace(half.recording, columns=columns), bench=bench)


def rigid(half: Half) -> bool:
    """True if the axis is one mass: a force on its load is a torque of its motor."""
    return half.bench.axis.physics().chain.inertia_kg_m2.size == 1
