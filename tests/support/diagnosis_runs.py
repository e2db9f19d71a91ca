"""Recordings for the diagnosis: the twin itself, with sensor noise, so that every truth is known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.preparation.usable_law import LawCheck
from hil.diagnosis.stages import Prepared, Searched
from hil.identification.dataset import Dataset
from hil.identification.estimator import Estimator, Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.terms import Term
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.recording.recording import Recording
from hil.twin.axis import Start

SEGMENTS = [
    {"kind": "dwell", "duration_s": 0.2},
    {"kind": "sine_squared", "to_m": 0.06, "feed_m_s": 0.1},
    {"kind": "dwell", "duration_s": 0.1},
    {"kind": "sine_squared", "to_m": 0.0, "feed_m_s": 0.25},
    {"kind": "dwell", "duration_s": 0.1},
    {"kind": "sine_squared", "to_m": 0.0015, "feed_m_s": 0.004},
    {"kind": "sine_squared", "to_m": 0.0, "feed_m_s": 0.004},
    {"kind": "dwell", "duration_s": 0.1},
]


def bench(**axis: float) -> Bench:
    """The reference bench, with parameters of its axis replaced."""
    reference = load_bench("reference")
    return reference.model_copy(update={"axis": reference.axis.model_copy(update=axis)})


def moves(segments: list[dict[str, Any]], times: int = 1) -> Profile:
    """A profile of segments, `times` times over."""
    return Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": 0.4, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
            "segments": [{"kind": "repeat", "times": times, "segments": segments}],
        }
    )


def recorded(
    truth: Bench,
    *terms: Term,
    seed: int = 1,
    times: int = 1,
    name: str = "run",
    profile: Profile | None = None,
    torque_noise_n_m: float = 0.01,
) -> Recording:
    """Record an axis `truth` with `terms` over a profile, by default over the segments, `times` times."""
    trajectory = plan(profile or moves(SEGMENTS, times), truth.gains.period_s)
    twin = Hypothesis(truth, terms).twin()
    answer = twin.simulate(trajectory.position_m, trajectory.velocity_m_s, Start())
    noise = np.random.default_rng(seed)
    count = 2.0 * np.pi / truth.encoders.motor.counts_per_rev
    n = answer.torque.size
    return Recording(
        name,
        {
            "time_s": np.arange(n) * truth.gains.period_s,
            "position_command_m": trajectory.position_m,
            "velocity_command_m_s": trajectory.velocity_m_s,
            "motor_position_rad": np.round(answer.motor_position / count) * count,
            "table_position_m": np.round(answer.table_position_m / 0.5e-6) * 0.5e-6,
            "torque_command_n_m": answer.torque_command,
            "torque_n_m": answer.torque + noise.normal(0.0, torque_noise_n_m, n),
        },
        truth.gains.period_s,
    )


def changed(recording: Recording, **columns: object) -> Recording:
    """A recording with columns multiplied by a factor, replaced by an array, or left out (None)."""
    new = dict(recording.columns)
    for name, change in columns.items():
        if change is None:
            del new[name]
        else:
            new[name] = change if isinstance(change, np.ndarray) else change * new[name]  # type: ignore[operator]
    return replace(recording, columns=new)


def one_way(owner: Bench, truth: Term, feed_m_s: float, seed: int) -> Recording:
    """A stroke forwards, recorded until shortly before its end: at rest friction holds, and cogging does not."""
    rest, stroke = {"kind": "dwell", "duration_s": 0.2}, {"kind": "sine_squared", "to_m": 0.08, "feed_m_s": feed_m_s}
    whole = recorded(owner, truth, seed=seed, profile=moves([rest, stroke]))
    rows = slice(0, round(0.95 * len(whole)))
    return replace(whole, columns={name: values[rows] for name, values in whole.columns.items()})


def dataset(runs: Sequence[Measured], owner: Bench, **settings: float) -> Dataset:
    """A data set with the default observer unless `settings` say otherwise."""
    return Dataset(tuple(runs), owner, **settings)


def evaluated(hypothesis: Hypothesis, runs: Sequence[Measured] | Dataset, **settings: float) -> Fit:
    """A hypothesis evaluated on runs, not fitted."""
    data = runs if isinstance(runs, Dataset) else dataset(runs, hypothesis.bench, **settings)
    return Estimator(data).evaluate(hypothesis)


def fitted(hypothesis: Hypothesis, runs: Sequence[Measured] | Dataset, evaluations: int = 30) -> Fit:
    """A hypothesis fitted to runs."""
    data = runs if isinstance(runs, Dataset) else dataset(runs, hypothesis.bench)
    return Estimator(data).fit(hypothesis, evaluations=evaluations)


def rows_of(run: Measured, rows: slice | NDArray[np.bool_]) -> Measured:
    """Return these rows of a recording, as if nothing else had been recorded."""
    arrays = {field.name: getattr(run, field.name) for field in fields(run)}
    return replace(
        run, **{name: value[rows] for name, value in arrays.items() if isinstance(value, np.ndarray) and value.size}
    )


def prepared(train: Dataset, held_out: Dataset | None = None) -> Prepared:
    """Data sets as a diagnosis prepares them, with the bench of the first as it stands in its file."""
    return Prepared(train, held_out or train.over([]), train.bench, train.bench, LawCheck(train.bench))


def searched(given: Fit, nominal: Fit, final: Fit, *found: Any) -> Searched:
    """Result of a search on the data set of the final fit; `found`: rivals, and the need of each term."""
    return Searched(prepared(final.data), given, nominal, final, *found)
