"""A hypothesis: nominal parameters and mechanisms of the twin as one vector, and its residuals.

Residuals come in two kinds. Block by block (`loops.observe`), each block is fed measured inputs: the kind that
searches are made with, because a mismatch shows only where it acts and nothing piles up. In closed loop the twin
gets the set-points and nothing else: the kind that a result is confirmed with. Stick-slip and play make the
closed loop chaotic, so that there even the truth does not repeat a recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.estimation.terms import Term, repeats
from hil.identification.dataset import Measured
from hil.identification.residuals import differences
from hil.twin.axis import Response, Twin
from hil.twin.library import BY_ID
from hil.twin.mechanism import Parameter, Role
from hil.twin.physics import Active

# Torque that the motor channel is trusted to tell, over the noise of the torque channel. A fine encoder tells much
# less, but details that no owner asks for lie there too: how friction meets zero speed, the side force of a lead error.
# The way there is another matter: with all that the encoder tells, the valleys of stick-slip are convex.
TORQUE_ACCURACY, SEARCH_ACCURACY = 1.0, 0.2
# Time constants of the motor's observer. Fast: stick-slip is forgotten within a few ticks, so that even a poor start
# leads to the right valley; faster than two ticks, the sampled observer is unstable on an elastic axis. Slow: a coarse
# encoder still tells the torque.
FASTEST_OBSERVER_TICKS, FASTEST_OBSERVER_S, SLOWEST_OBSERVER_S = 2.0, 0.002, 0.008
# Differences by which the edges of a window are moved: first wide, then by a tick.
EDGE_STEP_S, LAST_EDGE_STEP_S = 0.03, 0.001
# A light nut chatters in its gap: contacts come and go with the least change, and only a wide difference sees past them
# (Moré and Wild 2012: the step grows with the noise of a function). Relative; of 1e-4, 0.01 and 0.03, only the last led
# on from an owner's values that were 20 % wrong.
CHATTER_STEP = 0.03
# An owner who believes a mass or a stiffness is not wrong by more than this factor: beyond it lie the valleys in which
# a wrong structure is mended with absurd parameters.
TRUST = 3.0
_LOST = 1e6  # residuals beyond say no more than that the hypothesis is lost


@dataclass(frozen=True)
class Coordinate:
    """One entry of the parameter vector: value = scale exp(x) if logarithmic, else scale x."""

    name: str
    scale: float
    logarithmic: bool
    low: float
    high: float
    step: float
    role: Role | None = None  # of a mechanism's parameter

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
    observer_s: float = FASTEST_OBSERVER_S
    edge_step_s: float = EDGE_STEP_S
    torque_accuracy: float = TORQUE_ACCURACY

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Nominal parameters first, then those of each term."""
        axis = self.bench.axis
        step = CHATTER_STEP if self._chatters else 1e-4
        found = []
        for name in axis.NOMINAL:
            value = float(getattr(axis, name))
            if name == "damping_ratio":
                found.append(Coordinate(name, max(value, 0.01), True, 1e-4, 0.9, max(step, 1e-3)))
                continue
            scale = value if value > 0.0 else 1e-3
            found.append(Coordinate(name, scale, True, scale / TRUST, scale * TRUST, step))
        for index, term in enumerate(self.terms):
            for parameter, start in zip(BY_ID[term.effect].parameters, term.values, strict=True):
                found.append(self._coordinate(f"{index}.{parameter.name}", parameter, start))
        return tuple(found)

    def _coordinate(self, name: str, parameter: Parameter, start: float) -> Coordinate:
        step = CHATTER_STEP if self._chatters else 1e-4
        if parameter.role is Role.PERIOD:
            step = 0.01 * start / (2.0 * np.pi * max(self.travel_m, start))
        elif parameter.role is Role.EDGE:
            # an edge is seen only where it lies: a wide difference sees it coming
            step = self.edge_step_s / max(abs(start), EDGE_STEP_S)
        elif parameter.role is Role.ORDER:
            angle_rad = self.travel_m / self.bench.axis.ratio_m_rad * self.bench.axis.physics().angle_per_unit
            step = 0.01 / (start * max(angle_rad, 1.0))
        if parameter.low > 0.0:
            return Coordinate(name, start, True, parameter.low, parameter.high, step, parameter.role)
        scale = abs(start) or 1.0
        linear_step = step if parameter.role is Role.EDGE else max(step, 1e-3)
        return Coordinate(
            name,
            scale,
            False,
            parameter.low,
            parameter.high,
            min(linear_step, 0.1 * (parameter.high - parameter.low) / scale),
            parameter.role,
        )

    @property
    def _chatters(self) -> bool:
        """Whether there is play, in which a nut may chatter."""
        return any(
            variant.play
            for effect in (*(term.effect for term in self.terms), *(entry.effect for entry in self.bench.mechanisms))
            for variant in BY_ID[effect].variants
        )

    @property
    def nominal_count(self) -> int:
        """How many entries of the vector are nominal parameters."""
        return len(self.bench.axis.NOMINAL)

    def initial(self) -> FloatArray:
        """The vector of the bench's nominal values and the terms' starting values."""
        starts = [float(getattr(self.bench.axis, name)) or None for name in self.bench.axis.NOMINAL]
        values = [*starts, *(value for term in self.terms for value in term.values)]
        return np.array(
            [c.x(c.scale if value is None else value) for c, value in zip(self.coordinates, values, strict=True)]
        )

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the vector."""
        pairs = np.array([c.bounds for c in self.coordinates])
        return pairs[:, 0], pairs[:, 1]

    def values(self, x: FloatArray) -> list[float]:
        """Physical values of a vector, kept inside their bounds."""
        return [min(max(c.value(v), c.low), c.high) for c, v in zip(self.coordinates, x, strict=True)]

    @cached_property
    def kept(self) -> tuple[MechanismEntry, ...]:
        """The mechanisms of the bench whose place no term has taken."""
        kept = []
        taken = [term.effect for term in self.terms]
        for entry in self.bench.mechanisms:
            again = any(repeats(entry.active(), term) for term in self.terms)
            if not again and taken.count(entry.effect) < BY_ID[entry.effect].most:
                kept.append(entry)
                taken.append(entry.effect)
        return tuple(kept)

    def twin(self, x: FloatArray) -> Twin:
        """The twin of a vector."""
        bench, terms = self.resolved(x)
        active = tuple(entry.active() for entry in self.kept)
        added = tuple(Active(term.effect, term.values, term.variant) for term in terms)
        return Twin(bench.axis.physics(), bench.gains, active + added, observer_s=self.observer_s)

    def resolved(self, x: FloatArray) -> tuple[Bench, tuple[Term, ...]]:
        """Bench with the nominal parameters of a vector, and the terms with theirs."""
        values = self.values(x)
        nominal = dict(zip(self.bench.axis.NOMINAL, values, strict=False))
        rest = values[len(nominal) :]
        terms = []
        for term in self.terms:
            count = len(term.values)
            terms.append(replace(term, values=tuple(rest[:count])))
            rest = rest[count:]
        return self.bench.model_copy(update={"axis": self.bench.axis.model_copy(update=nominal)}), tuple(terms)

    def respond(self, x: FloatArray, run: Measured) -> Response:
        """The twin's answer to the set-points of a run, in closed loop."""
        return self.twin(x).simulate(run.position_command_m, run.velocity_command_m_s, run.start, run.table_m)

    def closed_loop(self, x: FloatArray, run: Measured) -> dict[str, FloatArray]:
        """Measured minus twin in closed loop, per channel (n,)."""
        return differences(run.response, self.respond(x, run), self.bench, run.judged)

    def blocks(self, x: FloatArray, run: Measured) -> dict[str, FloatArray]:
        """Measured minus twin with each block fed measured inputs, per channel (n,)."""
        twin = self.twin(x)
        measured = twin.undelayed(run.response)
        predicted = twin.observe(run.position_command_m, run.velocity_command_m_s, measured, run.start)
        found = differences(measured, predicted, self.bench, run.judged)
        found["command"] = measured.torque_command - predicted.torque_command
        return found

    def weighted(self, differences: dict[str, FloatArray], run: Measured) -> dict[str, FloatArray]:
        """Differences over their scales, of the rows that count: of size one or less at the noise floor."""
        scale = scales(run, self.bench, self.observer_s, self.torque_accuracy)
        rows = run.judged
        with np.errstate(over="ignore"):  # a hypothesis may be unstable
            return {
                name: np.clip(np.nan_to_num(value[rows] / scale[name][rows], nan=_LOST), -_LOST, _LOST)
                for name, value in differences.items()
            }

    def residuals(self, x: FloatArray, runs: Sequence[Measured], closed: bool = False) -> FloatArray:
        """All weighted residuals, run after run, channel after channel."""
        difference = self.closed_loop if closed else self.blocks
        return np.concatenate([part for run in runs for part in self.weighted(difference(x, run), run).values()])


def observer_time_s(runs: Sequence[Measured], bench: Bench) -> float:
    """Time constant at which the motor encoder's counts tell as much torque as the torque channel."""
    wanted = max(np.sqrt(run.noise.motor * inertia(bench) / (TORQUE_ACCURACY * run.noise.torque)) for run in runs)
    return float(np.clip(wanted, FASTEST_OBSERVER_TICKS * runs[0].period_s, SLOWEST_OBSERVER_S))


def inertia(bench: Bench) -> float:
    """Inertia of the whole axis in motor units."""
    modes = bench.twin().modal
    return float(modes.shape[modes.motor, 0] ** -2)


def scales(
    run: Measured, bench: Bench, observer_s: float, torque_accuracy: float = TORQUE_ACCURACY
) -> dict[str, FloatArray]:
    """Size of one unit of weighted residual at each row (n,), per channel.

    A torque d that the twin misses moves its motor by d tau^2 / J before the correction takes hold, with tau the
    observer's time constant: the motor counts from the torque that the torque channel can still see. White noise e
    of its encoder comes back through the observer as (1 - z^-1)^2 / (1 - a z^-1)^2 e, a = 1 - T / tau.
    """
    seen = torque_accuracy * run.noise.torque * observer_s**2 / inertia(bench)
    a = 1.0 - run.period_s / observer_s
    impulse = np.zeros(round(20.0 * observer_s / run.period_s) + 3)
    impulse[0] = 1.0
    passed = lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * a, a * a], impulse)
    rows = run.motor.shape
    table, torque = (np.broadcast_to(noise, rows) for noise in (run.noise.table_m, run.noise.torque))
    return {
        "motor": np.hypot(run.motor_noise * np.linalg.norm(passed), seen),
        "table": table,
        "torque": torque,
        "command": torque,
    }
