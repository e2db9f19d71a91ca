"""Hypothesis: nominal parameters and mechanisms of the twin as one vector, and its residuals.

Residuals exist in two kinds. Block by block (`loops.observe`), each block is fed measured inputs: a mismatch shows only
in its own block and does not accumulate; searches use this kind. In closed loop the twin is fed the set-points alone;
results are confirmed with this kind. With stick-slip or play the closed loop may be chaotic: then even the true
hypothesis does not reproduce a recording.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench, MechanismEntry
from hil.identification.coordinates import (
    CHATTER_STEP,
    DELAY,
    Coordinate,
    MotionRange,
    axis_coordinate,
    coordinate_of,
    delay_coordinate,
    known_coordinates,
    known_values,
    with_values,
)
from hil.identification.dataset import FASTEST_OBSERVER_S, Dataset
from hil.identification.followed import behind_motor, second_encoder
from hil.identification.measured import Measured
from hil.identification.residual_scales import inertia
from hil.identification.residuals import Residuals, differences
from hil.identification.standstill import resting
from hil.identification.terms import Term, push_n, repeats
from hil.twin.axis import TWIN_STEPS, Response, Steps, Twin, taken_back
from hil.twin.library import BY_ID
from hil.twin.mechanism import Contact
from hil.twin.mechanisms.channel_time_skew import delayed
from hil.twin.physics import Active


class Resolved(NamedTuple):
    """Bench and terms with the values of a hypothesis."""

    bench: Bench
    terms: tuple[Term, ...]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """The axis of a bench with mechanisms added, at a point x of their parameters.

    x (p,) has the nominal parameters first, then those of each term. Without x it is at the bench's values and the
    terms' starting values. The values in `bench` and `terms` scale the coordinates and do not change with x.
    """

    bench: Bench
    terms: tuple[Term, ...] = ()
    x: FloatArray = field(default_factory=lambda: np.empty(0))
    _done: dict[tuple[Dataset, bool, bool], Residuals] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.x.size:
            object.__setattr__(self, "x", self._initial)

    # --- other hypotheses ---

    def moved(self, x: FloatArray) -> "Hypothesis":
        """The same mechanisms at another point x (p,)."""
        there = replace(self, x=x)
        vars(there).update(coordinates=self.coordinates, _known=self._known)  # alike at every point
        return there

    def with_term(self, term: Term) -> "Hypothesis":
        """The hypothesis with one more term, at that term's values."""
        longer = Hypothesis(self.bench, (*self.terms, term))
        return replace(longer, x=np.concatenate([self.x, longer.x[self.x.size :]]))

    def without(self, *indices: int) -> "Hypothesis":
        """The hypothesis without the terms of these indices, the others at their values."""
        kept = np.ones(self.x.size, dtype=bool)
        for index in indices:
            kept[self.columns(index)] = False
        terms = tuple(term for index, term in enumerate(self.terms) if index not in indices)
        return Hypothesis(self.bench, terms, self.x[kept])

    def replaced(self, index: int, term: Term) -> "Hypothesis":
        """The hypothesis with another term in the place of one, at that term's values."""
        index %= len(self.terms)
        terms = (*self.terms[:index], term, *self.terms[index + 1 :])
        columns, start = self.columns(index), Hypothesis(self.bench, terms)
        return start.moved(
            np.concatenate([self.x[: columns.start], start.x[start.columns(index)], self.x[columns.stop :]])
        )

    @cached_property
    def rebased(self) -> "Hypothesis":
        """The same values with the coordinates of the terms scaled by them."""
        start = Hypothesis(self.bench, self.resolved.terms)
        return start.moved(np.concatenate([self.x[: self.nominal_count], start.x[self.nominal_count :]]))

    @property
    def given(self) -> "Hypothesis":
        """The hypothesis with the nominal parameters of the bench file, but for a delay that it leaves open."""
        told = [name != DELAY or bool(self.bench.torque_delay_s) for name in self.nominal]
        from_file = np.array(told + [False] * (self.x.size - self.nominal_count))
        return self.moved(np.where(from_file, self._initial, self.x))

    # --- parameters ---

    @property
    def nominal_count(self) -> int:
        """Number of nominal parameters at the beginning of x."""
        return len(self.nominal)

    @property
    def nominal(self) -> tuple[str, ...]:
        """Names of the nominal parameters: of the axis, of the delay of the torque where the bench leaves it open, and
        of the bench's mechanisms (`known_coordinates`).
        """
        delay = () if self.bench.torque_delay_s is None else (DELAY,)
        return (*self.bench.axis.refitted, *delay, *(coordinate.name for coordinate in self._known))

    @property
    def free(self) -> int:
        """Number of free values: x, and those of each further window of an event."""
        return self.x.size + sum(term.free - len(term.values) for term in self.terms)

    def columns(self, index: int) -> slice:
        """Entries of x that belong to a term."""
        first = self.nominal_count + sum(len(term.values) for term in self.terms[:index])
        return slice(first, first + len(self.terms[index].values))

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Coordinates of x."""
        axis, inertia = self.bench.axis, float(self.bench.axis.physics().chain.inertia_kg_m2.sum())
        coordinates = [axis_coordinate(name, float(getattr(axis, name)), inertia) for name in axis.refitted]
        if DELAY in self.nominal:
            coordinates.append(delay_coordinate(self.bench.torque_delay_s or 0.0, self.bench.period_s))
        coordinates += self._known
        for index, term in enumerate(self.terms):
            for parameter, start in zip(BY_ID[term.effect].parameters, term.values, strict=True):
                coordinates.append(coordinate_of(f"{index}.{parameter.name}", parameter, start))
        return tuple(coordinates)

    @cached_property
    def _known(self) -> tuple[Coordinate, ...]:
        return known_coordinates(self.bench.mechanisms)

    @property
    def bench_values(self) -> list[float]:
        """Nominal parameters (`nominal_count`,) as the bench file gives them."""
        delay_s = self.bench.torque_delay_s
        return [
            *(float(getattr(self.bench.axis, name)) for name in self.bench.axis.refitted),
            *([] if delay_s is None else [delay_s]),
            *(value for _, _, value in known_values(self.bench.mechanisms)),
        ]

    @cached_property
    def _initial(self) -> FloatArray:
        values = [*self.bench_values, *(value for term in self.terms for value in term.values)]
        return np.array([c.x(value) for c, value in zip(self.coordinates, values, strict=True)])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds (p,) of x."""
        pairs = np.array([c.bounds for c in self.coordinates])
        return pairs[:, 0], pairs[:, 1]

    def steps(self, travel_m: float, duration_s: float, edge_step_s: float) -> FloatArray:
        """Steps (p,) of x for forward differences; `travel_m` and `duration_s` of the recordings."""
        step = CHATTER_STEP if self._chatters else 1e-4
        angle_rad = travel_m / self.bench.axis.ratio_m_rad * self.bench.axis.physics().angle_per_unit
        motion, of_axis = MotionRange(travel_m, angle_rad, duration_s), self.nominal_count - len(self._known)
        steps = [max(step, one.least_step) for one in self.coordinates[:of_axis]]
        starts = [*self.bench_values[of_axis:], *(value for term in self.terms for value in term.values)]
        of_mechanisms = zip(self.coordinates[of_axis:], starts, strict=True)
        return np.array([*steps, *(one.step(start, step, edge_step_s, motion) for one, start in of_mechanisms)])

    @property
    def _chatters(self) -> bool:
        """True with play, in which a nut may chatter."""
        effects = (*(term.effect for term in self.terms), *(entry.effect for entry in self.bench.mechanisms))
        return any(variant.contact is Contact.PLAY for effect in effects for variant in BY_ID[effect].variants)

    @cached_property
    def values(self) -> list[float]:
        """Physical values of x, kept inside their bounds."""
        return [min(max(c.value(v), c.low), c.high) for c, v in zip(self.coordinates, self.x, strict=True)]

    @cached_property
    def resolved(self) -> Resolved:
        """Bench and terms with the values of x."""
        nominal = dict(zip(self.bench.axis.refitted, self.values, strict=False))
        terms = tuple(
            replace(term, values=tuple(self.values[self.columns(index)])) for index, term in enumerate(self.terms)
        )
        known = self.values[self.nominal_count - len(self._known) : self.nominal_count]
        changed: dict[str, object] = {
            "axis": self.bench.axis.model_copy(update=nominal),
            "mechanisms": with_values(self.bench.mechanisms, known),
        }
        if DELAY in self.nominal:
            delay_s = self.values[len(self.bench.axis.refitted)]
            changed["control"] = self.bench.control.model_copy(update={DELAY: delay_s})
        return Resolved(self.bench.model_copy(update=changed), terms)

    @cached_property
    def kept(self) -> tuple[MechanismEntry, ...]:
        """Mechanisms of the bench that no term replaces."""
        kept = []
        taken = [term.effect for term in self.terms]
        for entry in self.resolved.bench.mechanisms:
            again = any(repeats(entry.active(), term) for term in self.terms)
            if not again and taken.count(entry.effect) < BY_ID[entry.effect].most:
                kept.append(entry)
                taken.append(entry.effect)
        return tuple(kept)

    def twin(
        self, observer_s: float = FASTEST_OBSERVER_S, steps: Steps = TWIN_STEPS, run: Measured | None = None
    ) -> Twin:
        """The twin, with the time constant of its observer, its internal steps and the events of a run."""
        bench, terms = self.resolved
        active = tuple(entry.active() for entry in self.kept)
        added = tuple(Active(term.effect, term.values, term.variant) for term in terms if not term.windows)
        push = np.empty(0) if run is None else push_n(terms, run.name, run.time_s, run.period_s)
        return Twin(bench.axis.physics(), bench.gains, active + added, None, steps, observer_s, push)

    def respond(self, run: Measured) -> Response:
        """Response of the twin in closed loop to the set-points of a run. Raises FieldError without a control law."""
        _ = self.bench.known_control  # raises
        return self.twin(run=run).simulate(
            run.position_command_m, run.velocity_command_m_s, run.start, run.table_m, feedforward=run.feedforward
        )

    def undelayed(self, twin: Twin, run: Measured) -> Response:
        """Measured channels without the lateness that terms, and a delay of the torque, give them."""
        return _undelayed(run, twin.late, (self.resolved.bench.torque_delay_s or 0.0) / run.period_s)

    def blocks(
        self, run: Measured, observer_s: float, steps: Steps = TWIN_STEPS, rests: Measured | None = None
    ) -> dict[str, FloatArray]:
        """Measured less twin, blocks fed measured inputs, per channel (n,); 0: hidden. At rest where `rests` is."""
        return self.driven(run, observer_s, steps, rests) | behind_motor(self, run, observer_s, steps, rests)

    def driven(
        self, run: Measured, observer_s: float, steps: Steps = TWIN_STEPS, rests: Measured | None = None
    ) -> dict[str, FloatArray]:
        """The same where the measured torque drives the axis in each block."""
        twin = self.twin(observer_s, steps, run)
        measured, rest = self.undelayed(twin, run), resting(rests or run, twin.slow_velocity)
        predicted = twin.observe(
            run.position_command_m, run.velocity_command_m_s, measured, run.start, rest, run.feedforward
        )
        residuals = differences(measured, predicted, self.bench, run.evaluated)
        residuals["command"] = measured.torque_command - predicted.torque_command
        return residuals | {name: np.zeros(run.motor.size) for name in run.observability.hidden}

    def residuals(self, data: Dataset, closed: bool = False, fast: bool = False) -> Residuals:
        """Residuals on a data set, block by block or in closed loop; `fast`: with the steps of a search."""
        key = (data, closed, fast)
        if key not in self._done:
            runs, bench, steps = data.runs, self.bench, data.steps_of(fast)
            if closed:
                channels = [differences(run.response, self.respond(run), bench, run.evaluated) for run in runs]
            elif data.apart:
                own = inertia(self.resolved.bench)
                channels = [
                    {name: one.of(name, values, own) for name, values in free.items()}
                    | second_encoder(self, run, data.observer_s, steps)
                    for one, run in zip(data.apart, runs, strict=True)
                    for free in [self.driven(one.smooth, data.observer_s, steps, rests=run)]
                ]
            else:
                channels = [self.blocks(run, data.observer_s, steps) for run in runs]
            self._done[key] = Residuals(data, tuple(channels))
        return self._done[key]


@lru_cache(maxsize=32)  # most parameters of a fit leave the lateness as it is
def _undelayed(run: Measured, late: tuple[Active, ...], torque_periods: float) -> Response:
    """Measured channels without the lateness that mechanisms, and a delay of the torque in rows, give them."""
    channels = taken_back(run.response, late, run.period_s)
    if not torque_periods:
        return channels
    command, torque = (delayed(part, torque_periods) for part in (channels.torque_command, channels.torque))
    return channels._replace(torque_command=command, torque=torque)
