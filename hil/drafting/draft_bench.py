"""Draft a bench file from a recording: kind of axis, masses, friction, lead, gains, encoders, each with its error."""

from dataclasses import dataclass, field, replace
from math import log2, pi, sqrt

from hil.bench.control_section import MOST_TORQUE_DELAY_S, delay_in_words
from hil.channels import AxisKind
from hil.drafting.axis_section import AxisDraft, draft_axis
from hil.drafting.bench_notes import bench_notes
from hil.drafting.bench_value import BenchValue, estimated
from hil.drafting.identifiable import refuse_untold
from hil.drafting.loop_values import loop_values
from hil.drafting.plant_told import moving_parts, plant_told
from hil.drafting.plant_values import PlantValues
from hil.drafting.sensor_values import noise_of
from hil.identification.derived_channels import rows_are_ticks
from hil.identification.law.result import sure
from hil.identification.least_squares import Estimate
from hil.importing.by_map import STEP
from hil.recording.quantum import count_of, is_decimal
from hil.recording.recording import Recording
from hil.twin.mechanisms import constant_load, gravity_torque, table_side_friction, table_side_viscous_friction

_FINEST_M, _COARSEST_M = 1e-12, 1e-3  # resolution of a second encoder that a bench file takes
_MOST_COUNTS = 2**31  # per revolution: noise below a count of this encoder is that of numbers
_GAINS = ("position_gain_1_s", "velocity_feedforward", "velocity_gain_n_m_s_rad", "velocity_gain_n_s_m")
_STEPS_PER_NOISE = sqrt(12.0)  # a count of q has noise of q / sqrt(12)


@dataclass
class BenchDraft:
    """Sections of a drafted bench file; `notes` is what the recording tells beside them, `unsure` what to check."""

    name: str
    kind: AxisKind
    axis: AxisDraft
    control: list[BenchValue] = field(default_factory=list)  # empty: unknown
    control_why: str = ""
    torque_delay: BenchValue | None = None  # beside an unknown control law
    mechanisms: dict[str, list[BenchValue]] = field(default_factory=dict)  # by effect
    motor_encoder: BenchValue | None = None
    table_encoder: BenchValue | None = None
    notes: list[str] = field(default_factory=list)
    unsure: list[str] = field(default_factory=list)


def draft_bench(*recordings: Recording) -> BenchDraft:
    """Draft the bench of one axis from its recordings, cut at gaps in time.

    Masses and friction are those of all parts together, of which one tells what another does not; ratio, control law
    and encoders are those of the longest part that moves.
    Raises InputError if masses and friction cannot be told: neither torque nor a second encoder, no part that slides, a
    wrong sign, errors above all values without another one that is told; and for recordings of different kinds or
    channels.
    """
    parts = moving_parts(recordings)
    longest = parts[0]
    draft = _draft_parts(parts)
    draft.name = recordings[0].name
    if len(parts) > 1:
        seconds = len(longest) * longest.period_s
        draft.notes.insert(
            0,
            f"masses and friction of {len(parts)} parts together; ratio, control and encoders from {longest.name}, "
            f"{seconds:.4g} s long",
        )
    return draft


def _draft_parts(recordings: tuple[Recording, ...]) -> BenchDraft:
    """Draft the bench from recordings without gaps, the first of which tells all but masses and friction."""
    recording, told = recordings[0], plant_told(recordings)
    plant, transmission, turns = told.plant, told.transmission, told.turns
    ratio = 1.0 if told.lead is None else told.lead.value / (2.0 * pi)
    axis = draft_axis(recording, plant, transmission, turns, told.lead)
    draft = BenchDraft(recording.name, recording.kind, axis, unsure=[*axis.unsure])
    if axis.model == "dc_motor":
        draft.notes.append("the voltage stands in the torque channels, 1 N m for 1 V: torques of a diagnosis are volts")
    draft.control, draft.control_why, close = loop_values(recording, ratio)
    if close and _is_sampled(recording, plant):
        gains = ", ".join(f"{one.key} {one.shown}" for one in draft.control if one.key in _GAINS)
        draft.notes.append(f"gains of a loop in steps of the rows that come close: {gains}")
        draft.control, draft.control_why = [], "torque is not held from row to row: a faster loop, or recorded late"
    if not draft.control:
        draft.torque_delay = _torque_delay(recording, plant)
    if transmission is None and not draft.control:
        refuse_untold(draft.name, draft.kind, plant)
    _encoders(draft, recording)
    _loads(draft, plant)
    notes, unsure = bench_notes(recordings, plant, transmission, "V" if axis.model == "dc_motor" else None, turns)
    draft.notes += notes
    draft.unsure += unsure
    return draft


def _held_late(recording: Recording, plant: PlantValues) -> Estimate | None:
    """Delay [s] of a torque that is held from row to row, negative if it has acted before; None where not told."""
    if plant.early_s is None or rows_are_ticks(recording):
        return None
    return replace(plant.early_s, value=plant.early_s.value - 0.5 * recording.period_s)


def _is_sampled(recording: Recording, plant: PlantValues) -> bool:
    """True if the torque of a row has acted before one that is held until the next row would."""
    delay = _held_late(recording, plant)
    return delay is not None and delay.value < 0.0 and _told(delay, recording.period_s)


def _told(delay: Estimate, period_s: float) -> bool:
    """True if a delay is told to differ from none."""
    return delay.std_error > 0.0 and sure(delay.value / period_s, delay.std_error / period_s)


def _torque_delay(recording: Recording, plant: PlantValues) -> BenchValue | None:
    """Delay of a torque whose rows are samples, of which the twin holds each until the next; None where not told.

    Samples of one instant act half a row before they are held.
    """
    delay = _held_late(recording, plant)
    if delay is None or plant.early_s is None or abs(delay.value) > MOST_TORQUE_DELAY_S:  # of slow rows: found from 0
        return None
    if not (plant.early_s.value or _told(delay, recording.period_s)):
        return None
    half = "of it half a row" if plant.early_s.value else "half a row"
    how = f"{delay_in_words(delay.value)}; {half}, as each value is held for one"
    return BenchValue("torque_delay_s", delay.value, f"s, +-{delay.std_error:.2g}", how)


def _loads(draft: BenchDraft, plant: PlantValues) -> None:
    """Constant torque, gravity over the angle, and friction of the load as mechanisms: as common as friction."""
    if plant.offset_told:
        (name,) = (parameter.name for parameter in constant_load.MECHANISM.parameters)
        held = "a load, friction that differs by direction, or a zero of the drive"
        draft.mechanisms[constant_load.MECHANISM.id] = [estimated(name, plant.offset, "at the motor", held)]
    _friction_of_load(draft)
    if plant.gravity is not None and plant.gravity_angle is not None and plant.gravity.significant:
        torque, angle = (parameter.name for parameter in gravity_torque.MECHANISM.parameters)
        draft.mechanisms[gravity_torque.MECHANISM.id] = [
            estimated(torque, plant.gravity, "N m at the load"),
            estimated(angle, plant.gravity_angle, "rad: the angle of the load is seen from straight down"),
        ]


def _friction_of_load(draft: BenchDraft) -> None:
    """Shares of the friction on the load: that of viscous friction counts from that of Coulomb friction on."""
    share, viscous = draft.axis.share_of_load, draft.axis.viscous_share
    if share is None:
        return
    draft.unsure.append("friction of the load: what the encoders differ between directions may be lost motion, too")
    for mechanism, one in ((table_side_friction, share), (table_side_viscous_friction, viscous)):
        if one is None:
            continue
        beyond = one.value - share.value
        rest = 1.0 - share.value if beyond > 0.0 else share.value
        part = Estimate(beyond / rest, one.std_error / rest, one.how) if rest else replace(one, value=0.0)
        more = one if one is share else part
        (name,) = (parameter.name for parameter in mechanism.MECHANISM.parameters)
        draft.mechanisms[mechanism.MECHANISM.id] = [estimated(name, more, "of the friction")]


def _encoders(draft: BenchDraft, recording: Recording) -> None:
    names, linear = recording.axis, recording.kind is AxisKind.LINEAR
    step, how = _step(recording, names.motor_position, "")
    if linear:
        draft.motor_encoder = BenchValue("resolution_m", float(f"{step:.4g}"), "m", how)
    else:
        counts = min(max(round(2.0 * pi / step), 1), _MOST_COUNTS)
        power = round(2 ** round(log2(counts)))
        draft.motor_encoder = BenchValue(
            "counts_per_rev", power if abs(counts / power - 1.0) < 0.002 else counts, "", how
        )
    if names.table_position in recording.columns and not linear:
        step, how = _step(recording, names.table_position, " m")
        step = min(max(step, _FINEST_M), _COARSEST_M)
        draft.table_encoder = BenchValue("resolution_m", float(f"{step:.4g}"), "m", how)


def _step(recording: Recording, channel: str, unit: str) -> tuple[float, str]:
    """Step of a channel in its unit, before an import interpolated it, and how it was found: seen, or from noise."""
    origin = recording.metadata.get("channels", {}).get(channel, {})
    step = float(origin[STEP]) if STEP in origin else count_of(recording[channel])
    if step is None:
        noise = noise_of(recording, channel)
        return max(noise * _STEPS_PER_NOISE, 1e-12), f"no step is seen; from the noise of {noise:.2g}{unit}"
    return step, "step of the positions" + (" (perhaps the last digit of the file)" if is_decimal(step) else "")
