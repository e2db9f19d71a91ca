"""Result of a diagnosis: the stable interface `diagnosis.json`, as models and as a JSON Schema.

All values in SI units. `write_schema` writes `hil/diagnosis/diagnosis.schema.json` from these models.
"""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from hil.diagnosis.value import Correction, NotNegative, ResultPart, Value

SCHEMA_FILE = Path(__file__).with_name("diagnosis.schema.json")

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Verdict(StrEnum):
    """Answer: the twin explains the recordings, has wrong parameters, lacks named physics, or lacks unknown physics; or
    the parameters of the axis changed."""

    NO_MISMATCH = "no_mismatch"
    PARAMETER_ERROR = "parameter_error"
    MISSING_PHYSICS = "missing_physics"
    AXIS_CHANGED = "axis_changed"
    UNEXPLAINED = "unexplained"


class PhaseKind(StrEnum):
    """Phase of a motion, by its set-points."""

    REVERSAL = "reversal"
    CREEP = "creep"
    ACCELERATION = "acceleration"
    CONSTANT_FEED = "constant_feed"
    STANDSTILL = "standstill"


class Mode(StrEnum):
    """Simulation in which the residuals of a channel were computed."""

    CLOSED_LOOP = "closed_loop"
    BLOCKS = "blocks"


class Rival(ResultPart):
    """Another mechanism that was fitted, and the evidence against it."""

    effect: str
    evidence: str


class EventWindow(ResultPart):
    """Window of one recording in which an event acts, by the time since the first row of the whole recording."""

    recording: str
    start: Value
    end: Value
    strength: Value


class PulseTrain(ResultPart):
    """Windows of equal width at equal intervals."""

    start_s: float
    width_s: NotNegative
    period_s: NotNegative
    count: int


class Finding(ResultPart):
    """A mechanism that the twin lacks."""

    effect: str = Field(description="id in the library of mechanisms")
    variant: str = Field("", description="variant of the mechanism, if it has several")
    confidence: Share
    equivalents: tuple[str, ...] = Field((), description="mechanisms that this motion cannot distinguish from it")
    rivals: tuple[Rival, ...] = ()
    parameters: dict[str, Value]
    windows: tuple[EventWindow, ...] = Field((), description="of an event, by time; empty for permanent effects")
    train: PulseTrain | None = Field(None, description="period of the windows, if they have one")
    sentence: str
    form: str = Field("", description="term of the fit that only corrects the form of its curve")
    rate: str = Field("", description="strength per minute, of a change whose end is not told")
    needed: str = Field("", description="residual energy without it, on training and on held-out recordings")


class Phase(ResultPart):
    """Share of the mismatch's energy in a phase of motion."""

    kind: PhaseKind
    share: Share


class Location(ResultPart):
    """Location of the mismatch. Ranges and periods are null if it is not limited to one."""

    block: Literal["controller", "drive", "motor_side", "transmission", "table", "sensor"]
    element: str
    channels: tuple[str, ...] = Field(description="recorded channels with the mismatch, the strongest first")
    phases: tuple[Phase, ...] = ()
    windows_s: tuple[tuple[float, float], ...] = Field((), description="in the first recording, with most energy")
    position_m: tuple[float, float] | None = Field(None, description="range of table position")
    speed_m_s: tuple[float, float] | None = Field(None, description="range of absolute table speed")
    frequency_hz: NotNegative | None = Field(None, description="time-locked")
    period_m: NotNegative | None = Field(None, description="position-locked, or angle-locked as travel")
    order_per_rev: NotNegative | None = Field(None, description="angle-locked: periods per revolution of the screw")


class FitFigures(ResultPart):
    """Root mean square residuals in the channel's unit."""

    before_rms: NotNegative = Field(description="nominal parameters refitted, no new physics")
    after_rms: NotNegative = Field(description="with corrected parameters and the physics found")
    noise_floor_rms: NotNegative
    owner_rms: NotNegative | None = Field(
        description="parameters of the bench file; null if the twin is unstable with them"
    )

    @property
    def best_before_rms(self) -> float:
        """The smaller one of bench file and refit, without new physics."""
        return self.before_rms if self.owner_rms is None else min(self.owner_rms, self.before_rms)


class ChannelFit(ResultPart):
    """Fit of one channel before and after, on training and on held-out recordings."""

    unit: str
    mode: Mode
    floor_from: Literal["repeated_laps", "white_noise"]
    train: FitFigures
    validate_: FitFigures | None = Field(None, alias="validate", description="null without held-out recordings")

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True)


AT_FLOOR = (
    "Block by block, with measured inputs, the residuals of all channels are within the noise of positions and torque."
)
MOMENT = "moment"  # what a structure depends on where the axis is another one from a moment on
TREND = "trend"  # where a parameter of the axis changes at one rate
CLOCK = "clock"  # where the torque is recorded later and later, or earlier and earlier
NO_STRUCTURE = "(no structure)"  # behind a channel whose remainder depends on nothing


class Unexplained(ResultPart):
    """Residuals above the noise floor."""

    share: Share = Field(description="of the energy above the floor with the refitted nominal twin")
    description: str


class TorqueLeft(ResultPart):
    """Torque left on held-out recordings, predicted from the measured motion, over its standard deviation.

    The deviation is that of all recordings, training and held-out together.
    """

    owner: NotNegative | None = Field(description="parameters of the bench file; null where it cannot be computed")
    refitted: NotNegative | None = Field(description="nominal parameters refitted, no new physics")
    final: NotNegative | None = Field(description="with corrected parameters and the physics found")
    plain: NotNegative = Field(
        description="inertia, viscous and Coulomb friction and offset by least squares over the training recordings"
    )

    @property
    def before(self) -> float | None:
        """The smaller one of bench file and refit, without new physics."""
        return min((one for one in (self.owner, self.refitted) if one is not None), default=None)


class ChangedParameter(ResultPart):
    """A parameter of the axis that is another one in each part of the recordings."""

    name: str
    values: tuple[Value, ...] = Field(description="in the order of the parts")


class AxisChange(ResultPart):
    """Change of the axis between recordings, or at a moment of one."""

    recording: str | None = Field(description="in which it changed; null between recordings")
    moment_s: float | None = Field(description="by the time of that recording; null between recordings")
    parts: tuple[str, ...] = Field(description="names of the recordings, or `before` and `after`")
    parameters: tuple[ChangedParameter, ...]


class RuleAnswer(ResultPart):
    """Answer of one rule of `hil.diagnosis.acceptance` on a candidate."""

    rule: str
    accepted: bool
    text: str = Field(description="what holds, or why the candidate is not named")
    figures: dict[str, float | str | None] = Field(description="measured quantities; null where not finite")


class CandidateLedger(ResultPart):
    """A mechanism that was fitted, and its ledger: the rules in the order in which they were asked."""

    effect: str
    variant: str = ""
    beside: tuple[str, ...] = Field((), description="terms that it was added to")
    named: bool = Field(description="true if it is one of the findings")
    rules: tuple[RuleAnswer, ...]


class StructureLeft(ResultPart):
    """A dependence of what is left on a quantity, which noise does not have."""

    channel: str = Field(description="torque that the axis needs beyond the twin's, or difference of the encoders")
    over: str
    share: Share = Field(description="of the mean square of what is left")
    by_chance: Share = Field(description="probability of it without structure; errors count autocorrelation")
    text: str


class Unnamed(ResultPart):
    """A map of what has no name, as bench.diagnosed.yaml has it; motor units."""

    effect: str = Field(description="id of the map")
    parameters: dict[str, float]
    held_out_before: NotNegative = Field(description="rms on held-out recordings without it [N m, N, m or rad]")
    held_out_after: NotNegative
    nearest: str = Field("", description="mechanism of the library that was refuted last, and by what")


class NextExperiment(ResultPart):
    """Motion that separates mechanisms that the recorded motion cannot."""

    profile: str = Field(description="profile file")
    separates: tuple[str, ...]


class TimeBudget(ResultPart):
    """A search that its time budget ended: the result is the best so far."""

    budget_s: NotNegative
    stopped_before: str = Field(description="first step of the search that was not done")
    not_tried: tuple[str, ...] = Field(description="mechanisms that were not fitted beside those found")


class Result(ResultPart):
    """diagnosis.json."""

    schema_version: Literal[1] = 1
    verdict: Verdict
    statement: str = Field(description="the verdict as one sentence")
    location: Location | None = Field(description="null without a mismatch")
    missing: tuple[Finding, ...] = Field(description="physics that the twin lacks, the one with most energy first")
    partial: tuple[Finding, ...] = Field(
        (), description="only for `unexplained`: mechanisms that explain a part of the mismatch"
    )
    change: AxisChange | None = Field(None, description="for `axis_changed`; for `unexplained` one that explains most")
    parameter_corrections: dict[str, Correction]
    added_command: tuple[EventWindow, ...] = Field((), description="a command added behind the control law, by time")
    not_identifiable: tuple[str, ...] = Field((), description="parameters at the bound of their range: no correction")
    fit: dict[str, ChannelFit]
    not_testable: tuple[str, ...] = Field(description="mechanisms this motion cannot show")
    unexplained: Unexplained
    torque_left: TorqueLeft | None = Field(None, description="null without held-out motion or recorded torque")
    structure: tuple[StructureLeft, ...] = Field((), description="what is left, the strongest dependence first")
    unnamed: tuple[Unnamed, ...] = Field((), description="maps of it that improve the fit to held-out recordings")
    next_experiment: NextExperiment | None = None
    time_budget: TimeBudget | None = Field(None, description="null if the search was completed")
    considered: tuple[CandidateLedger, ...] = Field((), description="every mechanism that was fitted, in order")
    notes: tuple[str, ...] = ()
    runtime_s: NotNegative

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings that explain the mismatch, or most of it."""
        return self.missing or self.partial

    def as_json(self) -> dict[str, Any]:
        """Return the content of `diagnosis.json`."""
        return self.model_dump(mode="json", by_alias=True)


def schema() -> dict[str, Any]:
    """JSON Schema of diagnosis.json."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "diagnosis.json",
        **Result.model_json_schema(by_alias=True, mode="serialization"),
    }


def write_schema(path: Path = SCHEMA_FILE) -> None:
    """Write the JSON Schema."""
    path.write_text(json.dumps(schema(), indent=1) + "\n", encoding="utf-8")
