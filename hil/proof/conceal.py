"""The case generator: an axis, an effect concealed in it, recordings of it - and the truth, kept apart.

A case folder holds train_1, train_2 and holdout as Parquet and bench.yaml as the owner has it. The truth is returned to
whoever seals it and never written beside them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drivers.sim.effects import Effect
from drivers.sim.reality import record
from hil.bench import Bench
from hil.channels import AXIS_CHANNELS, AxisKind
from hil.proof import motions
from hil.proof.axes import DrawnAxis, Kind, Rng, draw_axis
from hil.proof.effects import Scene, applicable, draw_effect
from hil.proof.visibility import Visibility
from hil.recording import Recording, write_parquet
from hil.trajectory import Trajectory
from hil.twin.library import BY_ID

TIERS = ("single", "ladder", "pair", "null", "parameters_only", "masked", "novel", "ambiguous", "insufficient")
VISIBLE = (1.5, 100.0)       # sizes of a single effect, in units of noise
RECORDINGS = ("train_1", "train_2", "holdout")
_TRIES = 40                  # draws of one effect before another axis is drawn
_WORST_ERROR_M = 3e-3        # following error and share of limited torque at which an engineer would stop the axis
_MOST_LIMITED = 0.05
# Two names for one law: friction that differs by direction shifts its band as a weight does, also at standstill.
SAME_LAW = ({"asymmetric_friction", "constant_load"},)


@dataclass(frozen=True)
class Concealed:
    """One concealed effect: as drawn, its size in units of noise, and what of it can be compared."""

    effect: str
    form: str
    parameters: Mapping[str, float]
    size: float
    compared: Mapping[str, float]         # parameters of the library's law that the recordings have
    same_law: tuple[str, ...]             # ids that say the same
    block: str


@dataclass(frozen=True)
class Truth:
    """What a case conceals and what is right to answer; JSON-able by `as_json`."""

    name: str
    tier: str
    number: int
    seed: int
    axis: str
    verdict: str
    effects: tuple[Concealed, ...]
    true_parameters: Mapping[str, float]
    believed_parameters: Mapping[str, float]
    noise: Mapping[str, float]
    not_testable: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Case:
    """A case: what the diagnosis gets, and the truth."""

    name: str
    recordings: tuple[Recording, Recording, Recording]
    bench: Bench
    truth: Truth


def draw(tier: str, number: int, seed: int, effect: str | None = None, axis: Kind | None = None) -> Case:
    """The case of a tier, number and seed; always the same one. `effect` and `axis` force the draw."""
    rng = np.random.default_rng([seed, number, TIERS.index(tier)])
    return _single(rng, number, seed, effect, axis)


def write(case: Case, folder: str | Path) -> Path:
    """Write recordings and bench into folder/NAME; returns that folder. Raises InputError if a file exists."""
    place = Path(folder) / case.name
    place.mkdir(parents=True, exist_ok=True)
    for recording in case.recordings:
        write_parquet(recording, place / f"{recording.name}.parquet")
    plain = case.bench.model_dump(mode="json", exclude_defaults=True)
    plain["encoders"] = case.bench.model_dump(mode="json")["encoders"]
    (place / "bench.yaml").write_text(yaml.safe_dump(plain, sort_keys=False), encoding="utf-8")
    return place


def _single(rng: Rng, number: int, seed: int, effect: str | None, kind: Kind | None) -> Case:
    while True:
        axis = draw_axis(rng, kind)
        names = applicable(axis)
        if effect is not None and effect not in names:
            if kind is not None:
                raise ValueError(f"effect {effect}: cannot be shown on {kind}; allowed: {', '.join(names)}")
            continue
        name = effect or str(rng.choice(names))
        train = motions.training(rng, axis)
        visibility = Visibility(axis, train)
        scene = Scene(axis, visibility.peak_torque(), min(motion.duration_s for motion in train))
        for _ in range(_TRIES):
            found = draw_effect(name, scene, rng)
            size = visibility.size([found])
            if not VISIBLE[0] <= size <= VISIBLE[1]:
                continue
            recordings = _recorded(rng, axis, [found], (*train, motions.holdout(rng, axis)))
            if recordings is not None:
                truth = _truth("single", number, seed, axis, "missing_physics", [_concealed(found, size)])
                return Case(truth.name, recordings, axis.bench, truth)


def _recorded(rng: Rng, axis: DrawnAxis, effects: Sequence[Effect],
              runs: Sequence[Trajectory]) -> tuple[Recording, Recording, Recording] | None:
    """Recordings of the axis; None where an engineer would have stopped it."""
    names = AXIS_CHANNELS[AxisKind.LINEAR if axis.truth.linear else AxisKind.ROTARY]
    made = []
    for name, run in zip(RECORDINGS, runs, strict=True):
        columns = record(axis.truth, axis.sensors, effects, axis.servo, np.array(run.position_m),
                         np.array(run.velocity_m_s), axis.period_s, seed=int(rng.integers(2**31)))
        error = columns[names.position_command] - axis.truth.drive_ratio_m_rad * columns[names.motor_position]
        limited = np.abs(columns[names.torque_command]) >= axis.servo.torque_limit_n_m
        lag_m = axis.feed_m_s * (1.0 - axis.servo.velocity_feedforward) / axis.servo.position_gain_1_s
        if not np.max(np.abs(error)) < _WORST_ERROR_M + 1.5 * lag_m or np.mean(limited) > _MOST_LIMITED:
            return None
        made.append(Recording(name, columns, axis.period_s))
    return made[0], made[1], made[2]


def _concealed(effect: Effect, size: float) -> Concealed:
    same = next((law for law in SAME_LAW if effect.id in law), {effect.id})
    return Concealed(effect.id, effect.form, dict(effect.parameters), size, {}, tuple(sorted(same)),
                     str(BY_ID[effect.id].block))


def _truth(tier: str, number: int, seed: int, axis: DrawnAxis, verdict: str, effects: Sequence[Concealed]) -> Truth:
    noise = {"torque": axis.sensors.torque_noise_n_m}
    if axis.has_table:
        noise["table_m"] = axis.table_noise_m
    return Truth(f"case_{number:04d}", tier, number, seed, axis.kind, verdict, tuple(effects), dict(axis.true),
                 dict(axis.believed), noise)
