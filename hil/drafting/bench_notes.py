"""Comments of a drafted bench on values that its keys cannot hold: load, noise, delays, friction at constant feeds."""

from collections.abc import Sequence

from hil.channels import AxisKind
from hil.drafting.plant_values import PlantValues, TransmissionValues
from hil.drafting.sensor_values import noise_of, torque_delay_s
from hil.errors import InputError
from hil.identification.friction import identify_friction
from hil.identification.law.result import sure
from hil.importing.by_map import ONE
from hil.quantities import digits
from hil.recording.recording import Recording

MUCH_LEFT = 0.3  # share of the torque unexplained, from which it is as large as a usual friction


def bench_notes(
    recordings: Sequence[Recording],
    plant: PlantValues,
    transmission: TransmissionValues | None,
    unit: str | None = None,
    turns: bool = False,
) -> tuple[list[str], list[str]]:
    """Notes on what the recordings tell, the first one of its sensors, and those that the user should check.

    `unit` is that of the torque if it is not the SI unit. `turns`: the load turns, its position is an angle.
    """
    notes, unsure, recording = list[str](), list[str](), recordings[0]
    names, linear = recording.axis, recording.kind is AxisKind.LINEAR
    effort, noise_unit = ("force", "N") if linear else ("voltage", unit) if unit else ("torque", "N m")
    if names.torque in recording.columns:
        _of_torque(recording, plant, effort, noise_unit, notes, unsure)
        unsure += [] if unit else _of_constant(recording)
    else:
        unsure.append(
            "masses and friction are assumed: no torque is recorded; two encoders tell the transmission, and of masses "
            "and stiffness their ratio"
        )
    position_noise = noise_of(recording, names.motor_position)
    notes.append(f"noise of {names.motor_position}: {position_noise:.3g} {'m' if linear else 'rad'} rms")
    delay_s = torque_delay_s(recording)
    if delay_s is not None:
        notes.append(f"{names.torque} follows {names.torque_command} after {1e3 * delay_s:.3g} ms (to half a row)")
    if transmission is not None:
        _of_transmission(transmission, recording.period_s, "urad" if turns else "um", notes, unsure)
    try:
        feeds = identify_friction(*recordings)
    except InputError:
        return notes, unsure
    notes.append(
        f"friction from {len(feeds.points)} constant feeds: Coulomb {feeds.coulomb:.4g} "
        f"+-{feeds.coulomb_std_error:.2g}, viscous {feeds.viscous:.4g} +-{feeds.viscous_std_error:.2g}, offset "
        f"{feeds.offset:.3g} +-{feeds.offset_std_error:.2g}"
    )
    return notes, unsure


def _of_constant(recording: Recording) -> list[str]:
    """Reminder of a torque constant that the map gives as 1, which may stand for an unknown one; empty without."""
    names, origins = recording.axis, recording.metadata.get("channels", {})
    ones = [origins[name][ONE] for name in (names.torque, names.torque_command) if ONE in origins.get(name, {})]
    what = "mass, friction" if recording.kind is AxisKind.LINEAR else "inertia, friction"
    return [
        f"the map gives {one}: 1; if that stands for an unknown value, {what}, loads and torque gains are not in SI: "
        f"multiply them by the true {one}"
        for one in ones[:1]
    ]


def _of_transmission(
    transmission: TransmissionValues, period_s: float, micro: str, notes: list[str], unsure: list[str]
) -> None:
    """Add delay, lost motion and remaining difference of the second encoder; `micro` is um or urad."""
    late = transmission.delay_s
    if sure(late.value / period_s, late.std_error / period_s):
        delay = f"{'late' if late.value > 0 else 'early'} by {1e3 * abs(late.value):.3g} ms"
        error = f"+-{1e3 * late.std_error:.2g}"
        notes.append(f"second encoder {delay} {error}, from its difference over the velocity")
        unsure.append(f"the second encoder is {delay}; the bench has no key for it")
    if transmission.friction_m.significant:
        notes.append(
            f"second encoder differs by {2e6 * abs(transmission.friction_m.value):.3g} {micro} between directions: "
            "lost motion, or friction over stiffness"
        )
    notes.append(f"ratio, delay and stretch leave {1e6 * transmission.left_m:.3g} {micro} rms of the second encoder")


def _of_torque(
    recording: Recording, plant: PlantValues, effort: str, noise_unit: str, notes: list[str], unsure: list[str]
) -> None:
    """Add what the torque tells beside inertia and friction."""
    names, linear = recording.axis, recording.kind is AxisKind.LINEAR
    over_position = "spring" if plant.spring else "gravity" if plant.gravity else ""
    explained = f"inertia, friction and {over_position}" if over_position else "inertia and friction"
    if not plant.inertia.significant:
        unsure.append("the inertia is not identifiable from this motion: record moves with more acceleration")
    left = f"{explained} leave {digits(100.0 * plant.left, 2)} % of the {effort}"
    if plant.left > MUCH_LEFT:
        unsure.append(
            f"{left}: something else acts "
            "(a flexible load, gravity, a late channel), and their values may be off by more than their errors"
        )
    notes.append(f"{left} (share of its standard deviation)")
    if plant.one_way is not None:
        unsure.append(
            f"motion one way tells Coulomb friction and load together, {plant.one_way.value:.3g} {noise_unit} "
            f"+-{plant.one_way.std_error:.2g}: record the way back"
        )
    cause = ": a load, or friction that differs by direction"
    known = f"; not in the bench{cause}" if plant.offset.significant else ", not distinguishable from 0"
    sure = f"; see mechanisms of the bench{cause}" if plant.offset_told else known
    notes.append(f"constant {effort} {plant.offset.value:.3g} {noise_unit} +-{plant.offset.std_error:.2g}{sure}")
    if plant.gravity is not None:
        sure = "" if plant.gravity.significant else ", not distinguishable from 0"
        size = f"{plant.gravity.value:.3g} {noise_unit} +-{plant.gravity.std_error:.2g}"
        notes.append(f"{effort} over the angle (gravity) {size} at the load{sure}")
        if plant.gravity.significant:
            unsure.append("the load follows the sine of its angle, as gravity does; see mechanisms of the bench")
    if plant.spring is not None:
        rate = f"{plant.spring.value:.3g} {'N/m' if linear else 'N m/rad'} +-{plant.spring.std_error:.2g} at the motor"
        notes.append(f"{effort} over the position (a spring) {rate}, not in the bench: hil diagnose tests it")
    notes.append(f"noise of {names.torque}: {noise_of(recording, names.torque):.3g} {noise_unit} rms")
