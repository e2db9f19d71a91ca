"""Draft a bench file from a recording: kind of axis, masses, friction, lead, gains, encoders, each with its error."""

from dataclasses import dataclass, field, replace
from math import hypot, log2, pi, sqrt

from hil.bench.control_section import MOST_TORQUE_DELAY_S, delay_in_words
from hil.channels import AxisKind
from hil.drafting.bench_notes import bench_notes
from hil.drafting.bench_value import BenchValue
from hil.drafting.identifiable import refuse_untold
from hil.drafting.loop_values import loop_values
from hil.drafting.plant_told import moving_parts, plant_told
from hil.drafting.plant_values import PlantValues, TransmissionValues
from hil.drafting.ratio_values import gear_of
from hil.drafting.sensor_values import noise_of
from hil.identification.derived_channels import rows_are_ticks
from hil.identification.law.result import sure
from hil.identification.least_squares import Estimate
from hil.importing.by_map import STEP
from hil.quantities import ROTARY_LEAD_M, digits, unit_of
from hil.recording.quantum import count_of, is_decimal
from hil.recording.recording import Recording
from hil.twin.mechanisms import constant_load, gravity_torque

_FINEST_M, _COARSEST_M = 1e-12, 1e-3  # resolution of a second encoder that a bench file takes
_MOST_COUNTS = 2**31  # per revolution: noise below a count of this encoder is that of numbers
# Least deflection over acceleration that is a spring: a mode at 5 kHz, beyond any control loop.
_STIFFEST_S2 = (2.0 * pi * 5e3) ** -2
_GAINS = ("position_gain_1_s", "velocity_feedforward", "velocity_gain_n_m_s_rad", "velocity_gain_n_s_m")
_STEPS_PER_NOISE = sqrt(12.0)  # a count of q has noise of q / sqrt(12)


@dataclass
class BenchDraft:
    """Sections of a drafted bench file; `notes` is what the recording tells beside them, `unsure` what to check."""

    name: str
    kind: AxisKind
    model: str
    axis: list[BenchValue] = field(default_factory=list)
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
    plant, transmission, turns, ratio = told.plant, told.transmission, told.turns, 1.0
    volts = False
    draft = BenchDraft(recording.name, recording.kind, "one_mass")
    if told.lead is None:
        draft.axis.append(_value("mass_kg", plant.inertia, "kg"))
        draft.axis += [_friction("coulomb_force_n", plant.coulomb), _friction("viscous_force_n_s_m", plant.viscous)]
    else:
        lead, ratio = told.lead, told.lead.value / (2.0 * pi)
        deflection = None if transmission is None else _deflection_s2(transmission)
        sag = _sagging(plant, transmission)
        volts = turns and deflection is None and _in_volts(recording) and plant.viscous.significant
        if volts:
            draft.model = "dc_motor"
            _dc_motor(draft, plant, lead)
        elif turns:
            _turning(draft, plant, deflection, sag, lead)
        else:
            _screw(draft, plant, deflection, lead)
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
    notes, unsure = bench_notes(recordings, plant, transmission, "V" if volts else None, turns)
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


def _deflection_s2(transmission: TransmissionValues) -> Estimate | None:
    """Deflection of the transmission over the load's acceleration [s^2]; None where it is not told: a rigid axis.

    A rigid axis has lead errors and play too. A spring has to be told, beside the delay of an encoder.
    """
    stretch = transmission.compliance_s2.scaled(-1.0)
    if stretch.significant and stretch.value > _STIFFEST_S2:
        return replace(stretch, how="deflection over acceleration")
    return None


def _screw(draft: BenchDraft, plant: PlantValues, deflection: Estimate | None, lead: Estimate) -> None:
    mass = plant.inertia.scaled((2.0 * pi / lead.value) ** 2)
    inertia = f"motor and screw included: inertia {digits(plant.inertia.value)} kg m^2 at the motor"
    draft.model = "rigid" if deflection is None else "two_mass"
    draft.axis.append(BenchValue("lead_m", lead.value, f"m per revolution, {_error(lead)}", lead.how))
    if deflection is None:
        draft.axis.append(_value("mass_kg", mass, "kg", inertia))
    else:
        half, rotor = _guess(mass.scaled(0.5)), digits(1e-4 * (2.0 * pi / lead.value) ** 2)
        split = f"half of {digits(mass.value)} kg: the split is not told; a rotor of 1e-4 kg m^2 counts {rotor} kg"
        draft.axis += [
            _value("motor_mass_kg", half, "kg", split),
            _value("table_mass_kg", half, "kg", f"the other half; {inertia}"),
            _value("stiffness_n_m", _stiffness(half, deflection), "N/m", "for this split"),
        ]
        draft.unsure.append(
            "motor_mass_kg, table_mass_kg, stiffness_n_m: told are the sum of the masses and table mass over stiffness"
        )
    draft.axis += _rotary_friction(plant)


def _in_volts(recording: Recording) -> bool:
    """True if the torque is a voltage whose torque per volt is not known: 1 N m stands for 1 V."""
    origins, names = recording.metadata.get("channels", {}), recording.axis
    origin = origins.get(names.torque) or origins.get(names.torque_command) or {}
    return bool(origin.get("unit") == "V" and origin.get("si_per_volt") == 1.0)


def _dc_motor(draft: BenchDraft, plant: PlantValues, lead: Estimate) -> None:
    """Values of a motor driven by a voltage, which stands in the place of the torque."""
    inertia, slope = plant.inertia, plant.viscous
    time_s = inertia.value / slope.value
    error_s = abs(time_s) * hypot(inertia.std_error / inertia.value, slope.std_error / slope.value)
    draft.axis += [
        _value("gear_ratio", Estimate(ROTARY_LEAD_M / lead.value, 0.0, lead.how), "motor per load"),
        _value("time_constant_s", Estimate(time_s, error_s, inertia.how), "s"),
        _friction("coulomb_voltage_v", plant.coulomb),
        _value("voltage_constant_v_s_rad", slope, "V s/rad"),
    ]
    draft.notes.append("the voltage stands in the torque channels, 1 N m for 1 V: torques of a diagnosis are volts")


def _loads(draft: BenchDraft, plant: PlantValues) -> None:
    """Constant torque, and gravity over the angle, as mechanisms of the bench: both are as common as friction."""
    if plant.offset_told:
        (name,) = (parameter.name for parameter in constant_load.MECHANISM.parameters)
        held = "a load, friction that differs by direction, or a zero of the drive"
        draft.mechanisms[constant_load.MECHANISM.id] = [_value(name, plant.offset, "at the motor", held)]
    if plant.gravity is not None and plant.gravity_angle is not None and plant.gravity.significant:
        torque, angle = (parameter.name for parameter in gravity_torque.MECHANISM.parameters)
        draft.mechanisms[gravity_torque.MECHANISM.id] = [
            _value(torque, plant.gravity, "N m at the load"),
            _value(angle, plant.gravity_angle, "rad: the angle of the load is seen from straight down"),
        ]


def _turning(
    draft: BenchDraft, plant: PlantValues, deflection: Estimate | None, sag: Estimate | None, lead: Estimate
) -> None:
    gear = gear_of(lead)
    draft.axis.append(_value("gear_ratio", gear, "motor per load"))
    motor = _guess(plant.inertia.scaled(0.5))
    load = motor.scaled(gear.value**2)
    stiffness = sag or (None if deflection is None else _stiffness(load, deflection))
    draft.model = "rotary" if stiffness is None else "rotary_two_mass"
    if stiffness is None:
        draft.axis.append(_value("inertia_kg_m2", plant.inertia, "kg m^2 at the motor"))
    else:
        draft.axis += [
            _value("motor_inertia_kg_m2", motor, "kg m^2 at the motor", "half of the sum: the split is not told"),
            _value("load_inertia_kg_m2", load, "kg m^2 at the load", "the other half"),
            _value("stiffness_n_m_rad", stiffness, "N m/rad"),
        ]
        draft.unsure.append(
            "motor_inertia_kg_m2, load_inertia_kg_m2, stiffness_n_m_rad: told are the sum of the inertias at the "
            "motor and load inertia over stiffness"
        )
    draft.axis += _rotary_friction(plant)


def _guess(half: Estimate) -> Estimate:
    """Half of a sum whose split is not identifiable; its standard error is the half itself."""
    return replace(half, std_error=half.value)


def _stiffness(mass: Estimate, deflection: Estimate) -> Estimate:
    stiffness = mass.value / deflection.value
    return Estimate(stiffness, stiffness * deflection.std_error / deflection.value, deflection.how)


def _sagging(plant: PlantValues, transmission: TransmissionValues | None) -> Estimate | None:
    """Stiffness from the deflection under gravity [N m/rad]; None where one of the two is not told."""
    weight, sag = plant.gravity, transmission.sag_m if transmission else None
    if weight is None or sag is None or not (weight.significant and sag.significant):
        return None
    error = hypot(weight.std_error / weight.value, sag.std_error / sag.value)
    stiffness = weight.value / sag.value
    return Estimate(stiffness, error * stiffness, "deflection under gravity")


def _error(estimate: Estimate) -> str:
    return f"+-{estimate.std_error:.2g}"


def _value(key: str, estimate: Estimate, unit: str, more: str = "") -> BenchValue:
    return BenchValue(key, estimate.value, f"{unit}, {_error(estimate)}", "; ".join(filter(None, (estimate.how, more))))


def _rotary_friction(plant: PlantValues) -> list[BenchValue]:
    return [_friction("coulomb_torque_n_m", plant.coulomb), _friction("viscous_torque_n_m_s_rad", plant.viscous)]


def _friction(key: str, estimate: Estimate) -> BenchValue:
    sure = "" if estimate.significant else "not identifiable from this motion; "
    how = sure + estimate.how
    if not estimate.value > 0.0:
        how = f"not identifiable from this motion: {estimate.value:.3g} is below 0; {estimate.how}"
    return BenchValue(key, max(estimate.value, 0.0), f"{unit_of(key)}, {_error(estimate)}", how)


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
