"""What a compensation changes, by the twin of the diagnosed bench: errors of a motion before and after it.

The uncertainty is that of the parameters: the tables stay, and the axis is drawn again within the standard errors of
the diagnosis, each parameter on its own.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.control.compensation import follow
from hil.control.compensation_tables import Adds, Compensation, pack
from hil.diagnosis.result import Result
from hil.motion.trajectory import Trajectory
from hil.twin.axis import Start
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage


class Errors(NamedTuple):
    """Root mean square of the following error, and of the positioning error without its mean [m]."""

    following_m: float
    positioning_m: float

    def of(self, adds: Adds) -> float:
        """The error that a table is for: of the motor for a torque, of the table for a position."""
        return self.following_m if adds is Adds.TORQUE else self.positioning_m


class Gain(NamedTuple):
    """Errors before and after, and those of the draws of the axis; none without standard errors."""

    before: Errors
    after: Errors
    draws: tuple[tuple[Errors, Errors], ...]

    def interval(self, adds: Adds) -> tuple[float, float]:
        """Smallest and largest share of an error that is left, over the draws and the estimate."""
        shares = [after.of(adds) / before.of(adds) for before, after in ((self.before, self.after), *self.draws)]
        return min(shares), max(shares)


class Simulated(NamedTuple):
    """Following error of the motor to the corrected set-points, and place of the table less the set-point [m], (n,)."""

    following_m: FloatArray
    place_m: FloatArray


def predict(bench: Bench, motion: Trajectory, compensation: Compensation, fade_in_s: float) -> Errors:
    """Errors of the twin of a bench in closed loop, after the fade-in. Raises FieldError without a control law."""
    found, first = in_closed_loop(bench, motion, compensation), round(fade_in_s / bench.period_s)
    return Errors(float(np.sqrt(np.mean(found.following_m[first:] ** 2))), float(np.std(found.place_m[first:])))


def in_closed_loop(bench: Bench, motion: Trajectory, compensation: Compensation) -> Simulated:
    """Errors of the twin of a bench in closed loop. Raises FieldError without a control law."""
    gains, twin = bench.known_control.gains(bench.axis.ratio_m_rad), bench.twin()
    if not gains.position_from_table:  # what only the linear encoder misreads is no error of the table
        twin = replace(twin, active=tuple(one for one in twin.active if one.form.stage is not Stage.TABLE_READING))
    position, velocity, acceleration = (
        np.array(one) for one in (motion.position_m, motion.velocity_m_s, motion.acceleration_m_s2)
    )
    added = follow(pack(compensation, gains.period_s), position, velocity, acceleration)
    response = twin.simulate(
        position + added.position_m,
        velocity + added.velocity_m_s,
        Start(float(position[0])),
        feedforward=added.torque,
    )
    table = response.table_position_m
    fed_back = table if gains.position_from_table else gains.ratio_m_rad * response.motor_position
    return Simulated(position + added.position_m - fed_back, table - position)


def drawn_benches(bench: Bench, result: Result, count: int, seed: int = 1) -> Iterator[Bench]:
    """Draw benches with parameters within the standard errors of a diagnosis, kept within their bounds."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        axis = {
            name: max(getattr(bench.axis, name) + one.std * rng.standard_normal(), 0.01 * getattr(bench.axis, name))
            for name, one in result.parameter_corrections.items()
            if hasattr(bench.axis, name)
        }
        findings, entries = list(result.findings), []
        for entry in bench.mechanisms:
            found = next((one for one in findings if one.effect == entry.effect), None)
            if found is None:
                entries.append(entry)
                continue
            findings.remove(found)
            errors: Mapping[str, float] = {name: value.std for name, value in found.parameters.items()}
            drawn = {
                one.name: min(
                    max(entry.parameters[one.name] + errors.get(one.name, 0.0) * rng.standard_normal(), one.low),
                    one.high,
                )
                for one in BY_ID[entry.effect].parameters
                if one.name in entry.parameters
            }
            entries.append(entry.model_copy(update={"parameters": drawn}))
        yield bench.model_copy(update={"axis": bench.axis.model_copy(update=axis), "mechanisms": tuple(entries)})


def gain_of(
    bench: Bench, motion: Trajectory, compensation: Compensation, drawn: tuple[Bench, ...], fade_in_s: float
) -> Gain:
    """Errors without and with a compensation, for the estimate and for each drawn bench."""
    off = replace(compensation, tables=())

    def both(one: Bench) -> tuple[Errors, Errors]:
        return predict(one, motion, off, fade_in_s), predict(one, motion, compensation, fade_in_s)

    return Gain(*both(bench), tuple(both(one) for one in drawn))
