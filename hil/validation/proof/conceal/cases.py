"""Cases of a proof on real recordings: halves with a bench from the other half, one edit in each, or none.

The same seed and recordings give the same cases. A half is used in two ways: with the control law of its bench, if it
has one and a channel that the law does not read, and as a plant without it. Both halves in each way are nulls.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import yaml
from pydantic import TypeAdapter

from hil.bench.bench_file import Bench
from hil.diagnosis.preparation.prepare import prepare
from hil.drafting.bench_text import bench_text
from hil.drafting.draft_bench import draft_bench
from hil.errors import InputError
from hil.recording.recording import Recording
from hil.validation.proof.conceal.edit import Edit, ends
from hil.validation.proof.conceal.half import Half, as_plant, halves, rows_of
from hil.validation.proof.conceal.sensor_edits import LOSSES, SENSOR_EDITS
from hil.validation.proof.conceal.torque_edits import TORQUE_EDITS, Rng

SIZES = (3.0, 30.0)  # standard errors
EDITS = {**TORQUE_EDITS, **SENSOR_EDITS}
_TRIES = 8  # draws of an edit in a half before another one is taken
_CASES_PER_WAY = 5  # of all cases: two of them are nulls


@dataclass(frozen=True)
class RealTruth:
    """What is concealed in a case, and the right answer.

    source, part, law_known: the half and its use; `kind` is empty for an untouched half. effect, form, parameters: of
    the library, empty for another shape. size: strength over the standard error of least squares with the true shape.
    right: ids that are right. shape_missing: the library lacks the shape, so that no name is right; nor is one of rows
    that are lost or of another torque constant, where nothing is missing. compared: true values of parameters; adds:
    an effect that is there already adds to them. moment_s, duration_s: of a change of the axis, and of the half.
    """

    name: str
    source: str
    part: int
    law_known: bool
    kind: str = ""
    effect: str = ""
    form: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    size: float = 0.0
    right: tuple[str, ...] = ()
    shape_missing: bool = False
    compared: Mapping[str, float] = field(default_factory=dict)
    adds: bool = False
    moment_s: float | None = None
    duration_s: float = 0.0

    @property
    def half(self) -> tuple[str, int, bool]:
        """The half and its use, which the case shares with its null."""
        return self.source, self.part, self.law_known

    def as_json(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "RealTruth":
        """Return the truth from plain data."""
        return TypeAdapter(cls).validate_python(data)


@dataclass(frozen=True, eq=False)
class RealCase:
    """A case: recording and bench for the diagnosis, and the truth."""

    recording: Recording
    bench: Bench
    truth: RealTruth


def ways(recording: Recording, bench: Bench | None) -> Iterator[tuple[Half, Half]]:
    """Yield both halves of a recording, with the law of their benches if both have one, and as a plant.

    `bench` is that of the axis; without one it is drafted from the other half. Raises InputError if that fails.
    """
    one, other = halves(recording)
    benches = (bench, bench) if bench is not None else (_drafted(other), _drafted(one))
    pair = tuple(
        Half(half, own, recording.name, part)
        for part, (half, own) in enumerate(zip((one, other), benches, strict=True))
    )
    lawful = all(half.law_known and (half.table is not None or half.command is not None) for half in pair)
    if lawful:
        yield pair[0], pair[1]
    yield as_plant(pair[0]), as_plant(pair[1])


def check(pair: Sequence[Half]) -> None:
    """Raise InputError if the diagnosis refuses an untouched half."""
    for half in pair:
        prepare([half.recording], [], half.bench)


def draw_cases(found: Sequence[tuple[Half, Half]], cases: int, seed: int) -> list[RealCase]:
    """Draw cases in mixed order: as many ways as give five cases each, both halves of each untouched, and edits.

    Kinds of edits are drawn about equally often.
    """
    rng = np.random.default_rng([seed, cases])
    number = min(max(cases // _CASES_PER_WAY, 1), len(found))
    chosen = [found[int(index)] for index in rng.permutation(len(found))[:number]]
    used = [half for pair in chosen for half in pair]
    drawn = [RealCase(half.recording, half.bench, _truth(half, "")) for half in used]
    times = dict.fromkeys([*EDITS, *LOSSES], 0)
    while len(drawn) < cases:
        half = used[len(drawn) % len(used)]
        order = sorted(times, key=lambda kind: (times[kind], rng.random()))
        for kind in order:
            case = conceal(half, kind, rng)
            if case is not None:
                times[kind] += 1
                drawn.append(case)
                break
    names = [f"case_{place:04d}" for place in rng.permutation(len(drawn))]
    named = [replace(case, truth=replace(case.truth, name=name)) for case, name in zip(drawn, names, strict=True)]
    return sorted(named, key=lambda case: case.truth.name)


def conceal(half: Half, kind: str, rng: Rng) -> RealCase | None:
    """Conceal an edit or a loss of a kind in a half; None if the half cannot show it at any size of `SIZES`."""
    if kind in LOSSES:
        return RealCase(LOSSES[kind](half, rng), half.bench, _truth(half, kind))
    if half.law_known and kind in TORQUE_EDITS:  # it would contradict the law
        return None
    for _ in range(_TRIES):
        edit = EDITS[kind](half, rng)
        if edit is None:
            continue
        error = edit.error or half.told(edit.channel, edit.shape, edit.instead).std_error
        strength = float(np.exp(rng.uniform(*np.log(SIZES)))) * error
        if not 0.0 < strength <= edit.largest:
            continue
        if edit.whole and rng.random() < 0.5 and strength > 0.75 * edit.whole:
            strength = edit.whole * round(strength / edit.whole)
        if edit.signed and rng.random() < 0.5:
            strength = -strength
        return RealCase(edited(half, edit, strength), half.bench, _truth(half, kind, edit, strength, error))
    return None


def edited(half: Half, edit: Edit, strength: float) -> Recording:
    """The recording of a half with an edit, without the ends that a delay has no samples for."""
    names, columns = half.recording.axis, dict(half.recording.columns)
    name = {"table": names.table_position, "motor": names.motor_position}.get(edit.channel, names.torque)
    columns[name] = edit.change(strength)
    if edit.channel == "motor":
        columns.pop(names.motor_velocity, None)  # it would give the edit away
    cut = ends(strength / edit.whole) if edit.whole else 0
    return rows_of(replace(half.recording, columns=columns), slice(cut, len(half.recording) - cut))


def bench_yaml(bench: Bench) -> str:
    """The bench as text of a file, without comments, its name, and a simulation that may tell effects."""
    bench = bench.model_copy(update={"name": "", "description": "", "simulation": None})
    return yaml.safe_dump(bench.model_dump(mode="json", exclude_defaults=True), sort_keys=False)


def _truth(half: Half, kind: str, edit: Edit | None = None, strength: float = 0.0, error: float = 1.0) -> RealTruth:
    truth = RealTruth("", half.source, half.part, half.law_known, kind)
    if edit is None:
        return truth
    mechanism = edit.mechanism
    return replace(
        truth,
        effect=mechanism.id if mechanism else "",
        form=mechanism.forms[edit.variant] if mechanism else "",
        parameters=edit.parameters(strength) or {"strength": strength},
        size=abs(strength) / error,
        right=edit.right,
        shape_missing=mechanism is None and not edit.error,
        compared=edit.compared(strength),
        adds=edit.adds,
        moment_s=None if edit.moment_s is None else half.recording.start_s + edit.moment_s,
        duration_s=float(half.time_s[-1]),
    )


def _drafted(recording: Recording) -> Bench:
    """The bench that hil identify drafts."""
    draft = draft_bench(recording)
    try:
        return Bench.model_validate(yaml.safe_load(bench_text(draft)))
    except ValueError as error:
        raise InputError(f"{recording.name}: its draft is no bench: {error}") from None
