"""Simulated servo axis: chain of masses, sensors and effects, advanced in time."""

from collections.abc import Sequence
from math import ceil, isfinite

import numpy as np
from numpy.typing import NDArray

from drivers.port import DriverError
from drivers.sim.axis import GROUND, AxisTruth
from drivers.sim.contact import lead_error
from drivers.sim.effects import Effect, by_id
from drivers.sim.kernel import advance_period, begin
from drivers.sim.layout import LINES, STATE, one
from drivers.sim.packing import pack
from drivers.sim.sensors import Sensors


class Plant:
    """One axis with its sensors, integrated in internal steps of `step_s`.

    After advance(): motor_position_rad, table_position_m and torque_n_m are what the devices report, torque being the
    mean of the measured current (x nominal torque constant) over that period. A linear axis reports m and N.
    Raises ValueError for an effect that the axis cannot have, or a step too long for stability.
    """

    motor_position_rad: float
    table_position_m: float
    torque_n_m: float

    def __init__(
        self,
        axis: AxisTruth,
        sensors: Sensors | None = None,
        effects: Sequence[Effect] = (),
        seed: int = 0,
        step_s: float = 1e-5,
    ) -> None:
        if not (isfinite(step_s) and step_s > 0):
            raise ValueError(f"step_s: must be finite and > 0, got {step_s!r}")
        self.axis, self.step_s, self.seed = axis, step_s, seed
        self.sensors = Sensors() if sensors is None else sensors
        self.effects = by_id(effects)
        self.parameters = pack(axis, self.sensors, self.effects, step_s)
        self.state = one(STATE)
        longest_s = max((e.parameters.get("delay_s", 0.0) for e in self.effects.values()), default=0.0)
        self.lines = np.zeros((LINES, ceil(longest_s / step_s) + 3))
        self._period_s, self._steps = 0.0, 0
        self.reset()

    def reset(self, position_m: float = 0.0) -> None:
        """Set the axis to rest without load at time 0; the motor encoder reads `position_m` (table motion)."""
        s, count, nut = self.state[0], len(self.axis.mass_kg), self.axis.nut
        self.state[:] = np.zeros(1, STATE)
        s["random"] = np.random.SeedSequence(self.seed).generate_state(1, np.uint64)[0]
        motor_m = position_m - self.sensors.motor_offset_rad * self.axis.drive_ratio_m_rad
        s["position"][:count] = motor_m
        if nut is not None:
            s["position"][nut.table_side : count] += lead_error(self.parameters[0], motor_m, 0.0)[0]
            if nut.axial != GROUND:
                s["position"][nut.axial] = 0.0
        if self.parameters["masses"][0] > count and self.parameters["base"][0] == GROUND:
            s["position"][count] = s["position"][count - 1]  # the mass attached to the table
        self.lines[...] = 0.0
        begin(self.parameters, self.state, self.lines)
        self.motor_position_rad, self.table_position_m = float(s["motor_recorded"]), float(s["table_recorded"])
        self.torque_n_m = 0.0

    def advance(self, torque_command_n_m: float, period_s: float) -> None:
        """Hold the command for one period, a whole multiple of step_s (else ValueError).

        Raises DriverError for an axis whose position grows without bound.
        """
        if period_s != self._period_s:
            self._steps, self._period_s = self.steps_in(period_s), period_s
        self.motor_position_rad, self.table_position_m, self.torque_n_m = advance_period(
            self.parameters, self.state, self.lines, torque_command_n_m, self._steps
        )
        if not isfinite(self.motor_position_rad):
            raise DriverError(
                "the simulated axis is unstable: its position is no number; correct its parameters", where="simulation"
            )

    def steps_in(self, period_s: float) -> int:
        """Return the internal steps in a period. Raises ValueError if that is no whole number."""
        steps = round(period_s / self.step_s)
        if steps < 1 or abs(steps * self.step_s - period_s) > 1e-6 * self.step_s:
            raise ValueError(f"period_s: must be a whole multiple of step_s {self.step_s:g}, got {period_s!r}")
        return steps

    @property
    def time_s(self) -> float:
        """Time since reset."""
        return int(self.state["tick"][0]) * self.step_s

    @property
    def motor_true_rad(self) -> float:
        """Motor position without encoder (rad; m on a linear axis)."""
        return float(self.state["position"][0, 0]) / self.axis.drive_ratio_m_rad

    @property
    def motor_velocity_true_rad_s(self) -> float:
        """Motor velocity half an internal step ago (rad/s; m/s on a linear axis)."""
        return float(self.state["velocity"][0, 0]) / self.axis.drive_ratio_m_rad

    @property
    def table_true_m(self) -> float:
        """Table position without encoder."""
        return float(self.positions_m[len(self.axis.mass_kg) - 1])

    @property
    def positions_m(self) -> NDArray[np.float64]:
        """View of every mass's position (N,), as translation; writing sets the state."""
        return self._view("position")

    @property
    def velocities_m_s(self) -> NDArray[np.float64]:
        """View of every mass's velocity (N,) half an internal step ago; writing sets the state."""
        return self._view("velocity")

    def _view(self, name: str) -> NDArray[np.float64]:
        view: NDArray[np.float64] = self.state[name][0, : int(self.parameters["masses"][0])]
        return view
