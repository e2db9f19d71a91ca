"""What recordings show at once, before any twin: motion, plain model, second encoder, lateness behind set-points."""

from collections.abc import Sequence
from math import pi

import numpy as np

from hil.channels import AxisKind
from hil.drafting.assumed_plant import ASSUMED
from hil.drafting.plant_told import PlantTold, moving_parts, plant_told
from hil.errors import InputError
from hil.identification.following import following
from hil.identification.least_squares import Estimate
from hil.identification.turn_waves import turn_waves
from hil.quantities import digits, percent, quantity
from hil.recording.recording import Recording


def first_look(recordings: Sequence[Recording], turns_told: bool = True) -> list[str]:
    """Lines on recordings of one axis: duration and speed, plain model with standard errors, waves of the torque over
    a turn, second encoder, lateness behind the set-points. `turns_told`: the angle of the motor is known.

    What cannot be told is said with its reason; nothing is raised.
    """
    try:
        parts = moving_parts(recordings)
        lines = [_moves(parts)]
        told = plant_told(parts)
    except InputError as error:
        return [f"No plain model: {error}"]
    return [
        *lines,
        *_plain(told, parts[0]),
        *(_over_turn(parts, told) if turns_told else []),
        *_second_encoder(told),
        *_following(told, parts[0]),
    ]


def _moves(parts: Sequence[Recording]) -> str:
    seconds = sum(len(part) * part.period_s for part in parts)
    names, unit = parts[0].axis, "m" if parts[0].kind is AxisKind.LINEAR else "rad"
    travel = max(float(np.ptp(part[names.motor_position])) for part in parts)
    return (
        f"{sum(map(len, parts))} rows, {digits(seconds)} s at {digits(1e3 * parts[0].period_s)} ms; "
        f"the motor travels {quantity(travel, unit)}"
    )


def _plain(told: PlantTold, recording: Recording) -> list[str]:
    """The plain model in units of the motor; nothing where it was assumed."""
    plant = told.plant
    if plant.inertia.how == ASSUMED:
        return ["No torque is recorded: masses and friction cannot be told."]
    linear = recording.kind is AxisKind.LINEAR
    effort = "force" if linear else "torque"
    units = ("kg", "N s/m", "N", "N") if linear else ("kg m^2", "N m s/rad", "N m", "N m")
    named = {
        "mass" if linear else "inertia at the motor": plant.inertia,
        "viscous friction": plant.viscous,
        "Coulomb friction": plant.coulomb,
        "constant load": plant.offset,
    }
    values = ", ".join(f"{name} {_shown(one, unit)}" for (name, one), unit in zip(named.items(), units, strict=True))
    return [
        f"Plain model: {values}; it leaves {percent(plant.left)} of the "
        f"{effort} (share of its standard deviation){_when(plant.early_s, effort)}."
    ]


def _over_turn(parts: Sequence[Recording], told: PlantTold) -> list[str]:
    """One line with the waves of the torque over a turn; none for a linear motor, or without a torque."""
    names, early = parts[0].axis, told.plant.early_s
    if parts[0].kind is AxisKind.LINEAR or names.torque not in parts[0].columns:
        return []
    ratio = told.lead.value / (2.0 * pi) if told.lead and told.turns else None
    waves = turn_waves(
        [(part[names.motor_position], part[names.torque]) for part in parts],
        parts[0].period_s,
        early.value if early else 0.0,
        ratio,
    )
    each = ", ".join(
        f"{'once' if wave.order == 1 else f'{wave.order} times'} with {quantity(wave.amplitude, 'N m')}"
        for wave in waves
    )
    causes = "cogging, ripple, an encoder, or moves that repeat with the turn"
    return [f"Over a turn of the motor the torque repeats {each}: {causes}."] if each else []


def _when(early_s: Estimate | None, effort: str) -> str:
    if early_s is None or not early_s.value:
        return ""
    way = "early" if early_s.value > 0.0 else "late"
    return f"; the {effort} is recorded {quantity(abs(early_s.value), 's')} {way}"


def _second_encoder(told: PlantTold) -> list[str]:
    if told.transmission is None or told.lead is None:
        return []
    unit = "rad" if told.turns else "m"
    lead, seen = told.lead, told.transmission
    line = f"Second encoder: {_shown(lead, unit)} per revolution of the motor, {quantity(seen.left_m, unit)} rms left"
    if seen.delay_s.significant:
        late = seen.delay_s.value
        line += f", {quantity(abs(late), 's')} {'late' if late > 0.0 else 'early'}"
    if seen.friction_m.significant:
        line += f", {quantity(2.0 * abs(seen.friction_m.value), unit)} between directions"
    return [f"{line}."]


def _following(told: PlantTold, recording: Recording) -> list[str]:
    """How the motion follows its set-points, by the encoder that leaves less; nothing where none are recorded."""
    names, columns = recording.axis, recording.columns
    if names.position_command not in columns:
        return []
    measured = [columns[name] for name in (names.motor_position, names.table_position) if name in columns]
    found = [following(columns[names.position_command], one, recording.period_s) for one in measured]
    best = min((one for one in found if one), key=lambda one: one.left, default=None)
    return [best.in_words("rad" if told.turns else "m")] if best else []


def _shown(one: Estimate, unit: str) -> str:
    return f"{digits(one.value)} {unit} +-{one.std_error:.2g}"
