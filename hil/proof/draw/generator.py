"""The case generator: an axis, what is concealed in it, recordings of it - and the truth, kept apart.

A case folder holds train_1, train_2 and holdout as Parquet and bench.yaml as the owner has it. The truth is returned to
whoever seals it and never written beside them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drivers.sim.effects import Effect
from drivers.sim.reality import record
from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS, AxisKind
from hil.motion.trajectory import Trajectory
from hil.proof.draw import expected
from hil.proof.draw.axes import DrawnAxis
from hil.proof.draw.axis_kinds import Kind
from hil.proof.draw.cases import Draft
from hil.proof.draw.effects import LIBRARY
from hil.proof.draw.tiers import RECIPES
from hil.proof.draw.unknown_effects import NOVEL
from hil.recording.recording import Recording, write_parquet

TIERS = tuple(RECIPES)
BALANCED = {"single": LIBRARY, "ladder": LIBRARY, "pair": LIBRARY, "masked": LIBRARY, "novel": NOVEL}
RECORDINGS = ("train_1", "train_2", "holdout")
_AXES = 300  # drawn before it is clear that the tier cannot have what was asked for
_STOPPED_M = 3e-3  # following error, beyond that of the law, and share of torque at its limit at which an
_LIMITED = 0.05  # engineer would have stopped the axis


@dataclass(frozen=True)
class Concealed:
    """One concealed effect: as drawn, its size in units of noise, and what is right to answer about it."""

    effect: str
    form: str
    parameters: Mapping[str, float]
    size: float
    same_law: tuple[str, ...]  # ids of the library that say the same; none: the library has it not
    block: str
    place: Mapping[str, float | tuple[float, float]]
    compared: Mapping[str, float]  # parameters of the library's law that the recordings have


@dataclass(frozen=True)
class Truth:
    """What a case conceals and what is right to answer.

    `effects`: the concealed ones, that which the tier is about first. `rivals`: ids that these motions cannot tell from
    it. `not_testable`: ids that must be reported so. `noise`: standard deviations of the channels; `table_m` is that of
    table less r x motor.
    """

    name: str
    tier: str
    number: int
    seed: int
    axis: Kind
    verdict: str
    effects: tuple[Concealed, ...]
    rivals: tuple[str, ...]
    not_testable: tuple[str, ...]
    true_parameters: Mapping[str, Any]
    believed_parameters: Mapping[str, Any]
    noise: Mapping[str, float]

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Case:
    """A case: what the diagnosis gets, the truth, and the axis itself for another run."""

    name: str
    recordings: tuple[Recording, ...]
    bench: Bench
    truth: Truth
    draft: Draft


def draw(tier: str, number: int, seed: int, effect: str | None = None, axis: Kind | None = None) -> Case:
    """The case of a tier, number and seed; always the same one.

    `effect` and `axis` force what is drawn, where the tier has a choice. Without them, consecutive numbers of a tier
    take all its effects equally often. Raises ValueError for an unknown tier, and
    for an effect that the tier or this kind of axis cannot show.
    """
    if tier not in RECIPES:
        raise ValueError(f"tier: must be one of {', '.join(TIERS)}, got {tier!r}")
    rng = np.random.default_rng([seed, number, TIERS.index(tier)])
    if effect is None and axis is None and tier in BALANCED:
        effect = _turn(BALANCED[tier], number, seed)
    for _ in range(_AXES):
        draft = RECIPES[tier](rng, effect, axis)
        if draft is None:
            continue
        recordings = [
            rerun(draft, run, int(rng.integers(2**31)), name) for name, run in zip(RECORDINGS, draft.runs, strict=True)
        ]
        if all(_sound(recording, draft.axis) for recording in recordings):
            name = f"case_{number:04d}"
            return Case(name, tuple(recordings), draft.axis.bench, truth_of(name, tier, number, seed, draft), draft)
    raise ValueError(
        f"tier {tier}: given {effect} on {axis or 'any axis'}, which came to no case on {_AXES} axes; "
        "leave the effect or the axis out"
    )


def rerun(draft: Draft, run: Trajectory, seed: int, name: str = "run") -> Recording:
    """A recording of the axis with what it conceals over any motion: those of the case, or one asked for later."""
    axis = draft.axis
    effects = [effect for effect, _ in draft.effects if isinstance(effect, Effect)]
    columns = record(
        axis.truth,
        axis.sensors,
        effects,
        axis.servo,
        np.array(run.position_m),
        np.array(run.velocity_m_s),
        axis.period_s,
        seed,
    )
    faults = np.random.default_rng(seed)
    for fault, _ in draft.effects:
        if not isinstance(fault, Effect):
            table_m = columns["table_position_m"]
            columns["table_position_m"] = table_m + fault.change_m(table_m, axis, faults)
    return Recording(name, columns, axis.period_s)


def write(case: Case, folder: str | Path) -> Path:
    """Write recordings and bench into folder/NAME; returns that folder. Raises InputError if a file exists."""
    place = Path(folder) / case.name
    place.mkdir(parents=True, exist_ok=True)
    for recording in case.recordings:
        write_parquet(recording, place / f"{recording.name}.parquet")
    plain = case.bench.model_dump(mode="json", exclude_defaults=True)
    (place / "bench.yaml").write_text(yaml.safe_dump(plain, sort_keys=False), encoding="utf-8")
    return place


def truth_of(name: str, tier: str, number: int, seed: int, draft: Draft) -> Truth:
    """What a draft conceals and what is right to answer about it."""
    axis = draft.axis
    noise = {"torque": axis.sensors.torque_noise_n_m} | ({"table_m": axis.table_noise_m} if axis.has_table else {})
    concealed = tuple(
        Concealed(
            effect.id,
            effect.form,
            dict(effect.parameters),
            size,
            expected.same_law(effect.id),
            expected.block(effect.id),
            expected.place(effect, axis),
            expected.compared(effect, axis),
        )
        for effect, size in draft.effects
    )
    return Truth(
        name,
        tier,
        number,
        seed,
        axis.kind,
        draft.verdict,
        concealed,
        draft.rivals,
        draft.not_testable,
        dict(axis.true),
        dict(axis.believed),
        noise,
    )


def _turn(names: tuple[str, ...], number: int, seed: int) -> str:
    """Every name once in each round of numbers, in another order each time."""
    turn, at = divmod(number, len(names))
    return names[int(np.random.default_rng([seed, turn]).permutation(len(names))[at])]


def _sound(recording: Recording, axis: DrawnAxis) -> bool:
    names = AXIS_CHANNELS[AxisKind.LINEAR if axis.truth.linear else AxisKind.ROTARY]
    error = recording[names.position_command] - axis.truth.drive_ratio_m_rad * recording[names.motor_position]
    limited = np.abs(recording[names.torque_command]) >= axis.servo.torque_limit_n_m
    lag_m = axis.feed_m_s * (1.0 - axis.servo.velocity_feedforward) / axis.servo.position_gain_1_s
    return bool(np.max(np.abs(error)) < _STOPPED_M + 1.5 * lag_m and np.mean(limited) < _LIMITED)
