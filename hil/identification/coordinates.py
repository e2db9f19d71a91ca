"""Coordinates of the parameter vector of a hypothesis: scales, bounds and steps of the forward difference."""

from dataclasses import dataclass

import numpy as np

from hil.twin.parameter import Parameter, Role

# Steps of the forward difference for the edges of a window: first wide, to reach the edge, at last one tick at 1 kHz.
EDGE_STEP_S, LAST_EDGE_STEP_S = 0.03, 0.001
# Relative step with play: a light nut chatters in its gap, so residuals are noisy functions of the parameters, and only
# a wide step averages them (Moré and Wild 2012). Of 1e-4, 0.01 and 0.03 only the last converged from values 20 % wrong.
CHATTER_STEP = 0.03
# Bound of nominal parameters over the bench file, as a factor: beyond it lie minima in which implausible parameters
# compensate for a wrong structure.
TRUST = 3.0
# Delay of a recorded torque whose rows are not the ticks of the drive. A mean over the tick before or after a row, or
# a sample of it, shifts it by up to a row and a half.
DELAY, MOST_DELAY = "torque_delay_s", 1.5


@dataclass(frozen=True)
class Coordinate:
    """One entry of the parameter vector: value = scale exp(x) if logarithmic, else scale x."""

    name: str
    scale: float
    logarithmic: bool
    low: float
    high: float
    parameter: Parameter | None = None  # of a mechanism; None for a nominal parameter

    def value(self, x: float) -> float:
        """Physical value of x."""
        return float(self.scale * np.exp(x)) if self.logarithmic else float(self.scale * x)

    def x(self, value: float) -> float:
        """x of a physical value."""
        return float(np.log(value / self.scale)) if self.logarithmic else value / self.scale

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of x."""
        return self.x(self.low), self.x(self.high)

    @property
    def role(self) -> Role | None:
        """Role of a mechanism's parameter."""
        return self.parameter.role if self.parameter else None

    @property
    def edge(self) -> bool:
        """True for an instant at which a window begins or ends."""
        return self.role is Role.EDGE
