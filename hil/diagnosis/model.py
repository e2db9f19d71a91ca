"""A hypothesis: nominal parameters and mechanisms of the twin as one vector, and its residuals.

Residuals are taken in closed loop: the twin gets the set-points and nothing else (but for a table that
floats in a gap, see `hil.twin.kernel`), so that what it leaves is noise where it is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil.bench import Bench
from hil.diagnosis.data import Run, judged
from hil.twin.axis import Active, Response, Twin
from hil.twin.library import BY_ID
from hil.twin.mechanism import Parameter

FloatArray = NDArray[np.float64]

# Below this the motor encoder is not believed to matter [m at the table]: the twin's own step errors.
MOTOR_ACCURACY_M = 0.1e-6
CHANNELS = ("motor", "table", "torque")


@dataclass(frozen=True)
class Term:
    """A mechanism in a hypothesis, with the values it starts from."""

    effect: str
    variant: int
    values: tuple[float, ...]

    @property
    def key(self) -> tuple[str, int]:
        """Effect and variant."""
        return self.effect, self.variant


@dataclass(frozen=True)
class Coordinate:
    """One entry of the parameter vector: value = scale exp(x) if logarithmic, else scale x."""

    name: str
    scale: float
    logarithmic: bool
    low: float
    high: float
    step: float

    def value(self, x: float) -> float:
        """Physical value of x."""
        return float(self.scale * np.exp(x)) if self.logarithmic else float(self.scale * x)

    def x(self, value: float) -> float:
        """x of a physical value."""
        return float(np.log(value / self.scale)) if self.logarithmic else value / self.scale

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of x."""
        if self.logarithmic:
            return float(np.log(self.low / self.scale)), float(np.log(self.high / self.scale))
        return self.low / self.scale, self.high / self.scale


@dataclass(frozen=True)
class Model:
    """Nominal axis of a bench and the mechanisms added to it."""

    bench: Bench
    terms: tuple[Term, ...] = ()
    travel_m: float = 0.1

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Nominal parameters first, then those of each term."""
        axis = self.bench.axis
        found = []
        for name in axis.NOMINAL:
            value = float(getattr(axis, name))
            if name == "damping_ratio":
                found.append(Coordinate(name, max(value, 0.01), True, 1e-4, 0.9, 1e-3))
                continue
            scale = value if value > 0.0 else 1e-3
            # 0.02 .. 50 times what the owner believes: far beyond the 30 % he may be wrong by
            found.append(Coordinate(name, scale, True, scale / 50.0, scale * 50.0, 1e-4))
        for index, term in enumerate(self.terms):
            for parameter, start in zip(BY_ID[term.effect].parameters, term.values, strict=True):
                found.append(self._coordinate(f"{index}.{parameter.name}", parameter, start))
        return tuple(found)

    def _coordinate(self, name: str, parameter: Parameter, start: float) -> Coordinate:
        step = 1e-4
        if parameter.name == "period_m":
            step = 0.01 * start / (2.0 * np.pi * max(self.travel_m, start))
        elif parameter.name == "cycles_per_rev":
            turns = self.travel_m / self.bench.axis.ratio_m_rad
            step = 0.01 / (start * max(turns, 1.0))
        if parameter.low > 0.0:
            return Coordinate(name, start, True, parameter.low, parameter.high, step)
        return Coordinate(name, abs(start) or 1.0, False, parameter.low, parameter.high, 1e-3)

    @property
    def nominal_count(self) -> int:
        """How many entries of the vector are nominal parameters."""
        return len(self.bench.axis.NOMINAL)

    def initial(self) -> FloatArray:
        """The vector of the bench's nominal values and the terms' starting values."""
        starts = [float(getattr(self.bench.axis, name)) or None for name in self.bench.axis.NOMINAL]
        values = [*starts, *(value for term in self.terms for value in term.values)]
        return np.array([c.x(c.scale if value is None else value)
                         for c, value in zip(self.coordinates, values, strict=True)])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the vector."""
        pairs = np.array([c.bounds for c in self.coordinates])
        return pairs[:, 0], pairs[:, 1]

    def values(self, x: FloatArray) -> list[float]:
        """Physical values of a vector, kept inside their bounds."""
        return [min(max(c.value(v), c.low), c.high) for c, v in zip(self.coordinates, x, strict=True)]

    def twin(self, x: FloatArray) -> Twin:
        """The twin of a vector."""
        bench, terms = self.resolved(x)
        active = tuple(entry.active() for entry in bench.mechanisms)
        added = tuple(Active(term.effect, term.values, term.variant) for term in terms)
        return Twin(bench.axis.physics(), bench.gains, active + added)

    def resolved(self, x: FloatArray) -> tuple[Bench, tuple[Term, ...]]:
        """Bench with the nominal parameters of a vector, and the terms with theirs."""
        values = self.values(x)
        nominal = dict(zip(self.bench.axis.NOMINAL, values, strict=False))
        rest = values[len(nominal):]
        terms = []
        for term in self.terms:
            count = len(term.values)
            terms.append(replace(term, values=tuple(rest[:count])))
            rest = rest[count:]
        return self.bench.model_copy(update={"axis": self.bench.axis.model_copy(update=nominal)}), tuple(terms)

    def respond(self, x: FloatArray, run: Run) -> Response:
        """The twin's answer to the set-points of a run."""
        return self.twin(x).simulate(run.position_command_m, run.velocity_command_m_s, run.start, run.table_m)

    def observed(self, x: FloatArray, run: Run) -> Response:
        """The twin's predictions along a run, corrected by its positions."""
        return self.twin(x).observe(run.torque_command, run.motor, run.table_m, run.start)

    def innovations(self, x: FloatArray, runs: Sequence[Run]) -> FloatArray:
        """As `residuals`, of the corrected twin: what each row adds to the rows before it."""
        return np.concatenate([part for run in runs for part in weighted(self.observed(x, run), run, self.bench)])

    def residuals(self, x: FloatArray, runs: Sequence[Run]) -> FloatArray:
        """All weighted residuals, channel after channel, run after run: white of size one at best."""
        return np.concatenate([part for run in runs for part in weighted(self.respond(x, run), run, self.bench)])


def differences(response: Response, run: Run, bench: Bench) -> dict[str, FloatArray]:
    """Measured minus twin for each channel: motor [rad or m], table against motor [m], torque [N m or N]."""
    ratio = bench.axis.ratio_m_rad
    found = {"motor": run.motor - response.motor_position}
    if run.table_m.size:
        found["table"] = run.table_m - response.table_position_m - ratio * found["motor"]
    found["torque"] = run.torque - response.torque
    return found


def scales(run: Run, bench: Bench) -> dict[str, float]:
    """Size of one unit of weighted residual, per channel."""
    return {"motor": max(run.floor.motor, MOTOR_ACCURACY_M / bench.axis.ratio_m_rad), "table": run.floor.table_m,
            "torque": run.floor.torque}


def weighted(response: Response, run: Run, bench: Bench) -> list[FloatArray]:
    """Residual of each channel over its scale, of the rows that count."""
    scale = scales(run, bench)
    rows = judged(run)
    return [np.nan_to_num(value[rows] / scale[name], nan=1e6, posinf=1e6, neginf=-1e6)
            for name, value in differences(response, run, bench).items()]
