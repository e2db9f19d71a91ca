"""Draw cases: an axis with concealed effects, its recordings, and the truth, which is kept apart.

A case folder holds train_1, train_2 and holdout as Parquet and the owner's bench.yaml. The truth is returned to the
caller and never written beside them.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import yaml
from pydantic import TypeAdapter

from drivers.sim.effects import Effect
from drivers.sim.reality import record
from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS, AxisKind
from hil.motion.trajectory import Trajectory
from hil.recording.recording import Recording, write_parquet
from hil.twin.library import names_of
from hil.twin.parameter import Role
from hil.validation.proof.draw import expected
from hil.validation.proof.draw.axes import DrawnAxis
from hil.validation.proof.draw.axis_kinds import Kind
from hil.validation.proof.draw.cases import CaseDraft
from hil.validation.proof.draw.effects import LIBRARY
from hil.validation.proof.draw.less_known import forget
from hil.validation.proof.draw.tiers import RECIPES
from hil.validation.proof.draw.unknown_effects import NOVEL

TIERS = tuple(RECIPES)
BALANCED = {**dict.fromkeys(("single", "ladder", "pair", "masked", "less_known"), LIBRARY), "novel": NOVEL}
RECORDINGS = ("train_1", "train_2", "holdout")
_AXES = 300  # draws before a request counts as impossible
# An engineer would stop an axis with more than this following error beyond that of the law, or share of limited torque.
_STOPPED_M, _LIMITED = 3e-3, 0.05


@dataclass(frozen=True)
class Concealed:
    """A concealed effect as drawn, its size in units of noise, and the right answer about it."""

    effect: str
    form: str
    parameters: Mapping[str, float]
    size: float
    same_law: tuple[str, ...]  # ids of the library for the same law; empty if the library lacks it
    block: str
    place: Mapping[str, float | tuple[float, float]]
    compared: Mapping[str, float]  # true values of the parameters of the library's law

    @property
    def free_period_m(self) -> float | None:
        """Spatial period [m] if it is a parameter of the effect."""
        free = set(names_of(Role.PERIOD, Role.ORDER)) & set(self.parameters)
        return cast(float, self.place["period_m"]) if free else None

    @property
    def mode_hz(self) -> float | None:
        """Frequency [Hz] if it is a parameter of the library's law."""
        return self.compared.get("frequency_hz") and cast(float, self.place["frequency_hz"])

    @property
    def window_s(self) -> tuple[float, float] | None:
        """Begin and end [s] of the effect if it is transient."""
        return cast("tuple[float, float] | None", self.place.get("window_s"))


@dataclass(frozen=True)
class Truth:
    """The concealed effects of a case and the right answer.

    `effects`: the one to be found first. `rivals`: ids that these motions cannot separate from it. `not_testable`: ids
    that must be reported as such. `noise`: standard deviations of the channels; `table_m`: table less r x motor.
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
    forgotten: str = ""  # what is not known, of `less_known.WAYS`

    @property
    def lead_m(self) -> float:
        """Lead of the screw [m], also of that behind a one-mass axis."""
        return float(self.true_parameters.get("lead_m") or self.true_parameters["screw_lead_m"])

    def as_json(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Truth":
        """Return the truth from plain data."""
        return TypeAdapter(cls).validate_python(data)


@dataclass(frozen=True, eq=False)
class DrawnCase:
    """A case: recordings and bench for the diagnosis, the truth, and the draft for further runs."""

    name: str
    recordings: tuple[Recording, ...]
    bench: Bench
    truth: Truth
    draft: CaseDraft


def draw(tier: str, number: int, seed: int, effect: str | None = None, axis: Kind | None = None) -> DrawnCase:
    """Draw the case of a tier, number and seed; the same arguments give the same case.

    `effect` and `axis` fix what the tier would choose. Without them, consecutive numbers of a tier take all its effects
    equally often. Raises ValueError for an unknown tier, for an effect that the tier or kind of axis lacks, and if no
    axis gave a case.
    """
    if tier not in RECIPES:
        raise ValueError(f"tier: must be one of {', '.join(TIERS)}, got {tier!r}")
    allowed = () if tier in ("null", "parameters_only") else BALANCED.get(tier, LIBRARY)
    if effect is not None and effect not in allowed:
        raise ValueError(f"effect: must be one of {', '.join(allowed) or 'none'} in the tier {tier}, got {effect!r}")
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
            name, bench = f"case_{number:04d}", draft.axis.bench
            if draft.forgotten:
                recordings, bench = forget(draft.forgotten, recordings, bench, rng)
            return DrawnCase(name, tuple(recordings), bench, truth_of(name, tier, number, seed, draft), draft)
    raise ValueError(
        f"tier {tier}: given {effect} on {axis or 'any axis'}, which gave no case on {_AXES} axes; "
        "leave the effect or the axis out"
    )


def rerun(draft: CaseDraft, run: Trajectory, seed: int, name: str = "run") -> Recording:
    """Record the axis with its concealed effects over a motion of the case or a proposed one."""
    axis = draft.axis
    effects = [effect for effect, _ in draft.effects if isinstance(effect, Effect)]
    motion = np.array(run.position_m), np.array(run.velocity_m_s)
    columns = record(axis.truth, axis.sensors, effects, axis.servo, *motion, axis.period_s, seed)
    faults = np.random.default_rng(seed)
    for fault, _ in draft.effects:
        if not isinstance(fault, Effect):
            table_m = columns["table_position_m"]
            columns["table_position_m"] = table_m + fault.change_m(table_m, axis, faults)
    return Recording(name, columns, axis.period_s)


def write(case: DrawnCase, folder: str | Path) -> Path:
    """Write recordings and bench into folder/NAME and return that folder. Raises InputError if a file exists."""
    place = Path(folder) / case.name
    place.mkdir(parents=True, exist_ok=True)
    for recording in case.recordings:
        write_parquet(recording, place / f"{recording.name}.parquet")
    plain = case.bench.model_dump(mode="json", exclude_defaults=True)
    (place / "bench.yaml").write_text(yaml.safe_dump(plain, sort_keys=False), encoding="utf-8")
    return place


def truth_of(name: str, tier: str, number: int, seed: int, draft: CaseDraft) -> Truth:
    """Return the truth of a draft."""
    axis = draft.axis
    noise = {"torque": axis.sensors.torque_noise_n_m} | ({"table_m": axis.table_noise_m} if axis.has_table else {})
    concealed = []
    for effect, size in draft.effects:
        drawn = effect.id, effect.form, dict(effect.parameters), size
        right = expected.same_law(effect.id), expected.block(effect.id), expected.place(effect, axis)
        concealed.append(Concealed(*drawn, *right, expected.compared(effect, axis)))
    answer = draft.verdict, tuple(concealed), draft.rivals, draft.not_testable
    parameters = dict(axis.true), dict(axis.believed), noise
    return Truth(name, tier, number, seed, axis.kind, *answer, *parameters, draft.forgotten)


def _turn(names: tuple[str, ...], number: int, seed: int) -> str:
    """Return every name once in each round of numbers, in another order each round."""
    turn, at = divmod(number, len(names))
    return names[int(np.random.default_rng([seed, turn]).permutation(len(names))[at])]


def _sound(recording: Recording, axis: DrawnAxis) -> bool:
    names = AXIS_CHANNELS[AxisKind.LINEAR if axis.truth.linear else AxisKind.ROTARY]
    error = recording[names.position_command] - axis.truth.drive_ratio_m_rad * recording[names.motor_position]
    limited = np.abs(recording[names.torque_command]) >= axis.servo.torque_limit_n_m
    lag_m = axis.feed_m_s * (1.0 - axis.servo.velocity_feedforward) / axis.servo.position_gain_1_s
    return bool(np.max(np.abs(error)) < _STOPPED_M + 1.5 * lag_m and np.mean(limited) < _LIMITED)
