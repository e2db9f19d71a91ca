"""The section `axis` of a drafted bench file: its kind, masses, stiffness and friction, each with its error."""

from dataclasses import dataclass, replace
from math import hypot, pi

from hil.drafting.bench_value import BenchValue, estimated
from hil.drafting.plant_values import PlantValues, TransmissionValues
from hil.drafting.ratio_values import gear_of
from hil.drafting.split import Split, split_of
from hil.identification.least_squares import SIGMAS, Estimate
from hil.quantities import ROTARY_LEAD_M, digits, unit_of
from hil.recording.recording import Recording

_STIFFNESS = ("stiffness_n_m", "stiffness_n_m_rad")
# Least deflection over acceleration that is a spring: a mode at 5 kHz, beyond any control loop.
_STIFFEST_S2 = (2.0 * pi * 5e3) ** -2


@dataclass(frozen=True)
class AxisDraft:
    """A drafted section: its kind, its keys with values, what the owner of the axis should check, and keys held.

    `share_of_load` and `viscous_share` are those of Coulomb and viscous friction that act on the load of an axis with a
    spring; None: not told.
    """

    model: str
    values: list[BenchValue]
    unsure: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    share_of_load: Estimate | None = None
    viscous_share: Estimate | None = None


def draft_axis(
    recording: Recording,
    plant: PlantValues,
    transmission: TransmissionValues | None,
    turns: bool,
    lead: Estimate | None,
) -> AxisDraft:
    """Draft the section from what least squares tell; without a lead the axis is linear."""
    if lead is None:
        friction = [_friction("coulomb_force_n", plant.coulomb), _friction("viscous_force_n_s_m", plant.viscous)]
        return AxisDraft("one_mass", [estimated("mass_kg", plant.inertia, "kg"), *friction])
    deflection = None if transmission is None else _deflection_s2(transmission)
    if turns and deflection is None and _in_volts(recording) and plant.viscous.significant:
        return AxisDraft("dc_motor", _dc_motor(plant, lead))

    def drafted(split: Split) -> AxisDraft:
        if turns:
            return _turning(plant, deflection, _sagging(plant, transmission), lead, split)
        return _screw(plant, deflection, lead, split)

    split = split_of(plant.inertia, recording, lead.value, turns)
    axis = _with_friction_of_load(drafted(split), plant, transmission, lead)
    share = axis.share_of_load
    by_sag = turns and _sagging(plant, transmission) is not None  # the sag alone tells the stiffness
    if share is not None and share.value > 1.0 and not (split.told or by_sag):
        axis = _with_friction_of_load(drafted(split.lighter(0.5 / share.value)), plant, transmission, lead)
        share = axis.share_of_load
    return replace(axis, share_of_load=None if share is None else replace(share, value=min(share.value, 1.0)))


def _with_friction_of_load(
    axis: AxisDraft, plant: PlantValues, transmission: TransmissionValues | None, lead: Estimate
) -> AxisDraft:
    """The draft with the shares of the friction that acts on the load.

    By what the second encoder lags behind the motor's in each direction, and by the velocity. It is late itself where
    the viscous friction would have to be more than there is.
    """
    stiffness = next((float(one.value) for one in axis.values if one.key in _STIFFNESS), 0.0)
    if not stiffness or transmission is None or not plant.coulomb.significant:
        return axis
    at_motor = stiffness * lead.value / (2.0 * pi)
    share = transmission.friction_m.scaled(-at_motor / plant.coulomb.value)
    if not (share.significant and share.value > 0.0):
        return axis
    axis = replace(axis, share_of_load=replace(share, how="friction over stiffness, or lost motion"))
    if not plant.viscous.significant:
        return axis
    late = transmission.delay_s.scaled(at_motor * transmission.ratio.value / plant.viscous.value)
    viscous = replace(late, value=min(max(late.value, 0.0), 1.0), how="friction over stiffness, or an encoder late")
    return replace(axis, viscous_share=viscous) if abs(late.value - viscous.value) <= SIGMAS * late.std_error else axis


def _deflection_s2(transmission: TransmissionValues) -> Estimate | None:
    """Deflection of the transmission over the load's acceleration [s^2]; None where it is not told: a rigid axis.

    A rigid axis has lead errors and play too. A spring has to be told, beside the delay of an encoder.
    """
    stretch = transmission.compliance_s2.scaled(-1.0)
    if stretch.significant and stretch.value > _STIFFEST_S2:
        return replace(stretch, how="deflection over acceleration")
    return None


def _screw(plant: PlantValues, deflection: Estimate | None, lead: Estimate, split: Split) -> AxisDraft:
    factor = (2.0 * pi / lead.value) ** 2
    mass = plant.inertia.scaled(factor)
    inertia = f"motor and screw included: inertia {digits(plant.inertia.value)} kg m^2 at the motor"
    values = [BenchValue("lead_m", lead.value, f"m per revolution, +-{lead.std_error:.2g}", lead.how)]
    if deflection is None:
        values += [estimated("mass_kg", mass, "kg", inertia), *_rotary_friction(plant)]
        return AxisDraft("rigid", values)
    motor, table = split.motor.scaled(factor), split.load.scaled(factor)
    how = f"{split.how}; the sum is {digits(mass.value)} kg; a rotor of 1e-4 kg m^2 counts {digits(1e-4 * factor)} kg"
    elastic = [
        estimated("motor_mass_kg", motor, "kg", how),
        estimated("table_mass_kg", table, "kg", f"the rest; {inertia}"),
        estimated("stiffness_n_m", _stiffness(table, deflection), "N/m", "for this split"),
    ]
    told = "the sum of the masses and table mass over stiffness"
    held = ("table_mass_kg",) if split.held else ()
    return AxisDraft("two_mass", [*values, *elastic, *_rotary_friction(plant)], _unsure(elastic, told, split), held)


def _in_volts(recording: Recording) -> bool:
    """True if the torque is a voltage whose torque per volt is not known: 1 N m stands for 1 V."""
    origins, names = recording.metadata.get("channels", {}), recording.axis
    origin = origins.get(names.torque) or origins.get(names.torque_command) or {}
    return bool(origin.get("unit") == "V" and origin.get("si_per_volt") == 1.0)


def _dc_motor(plant: PlantValues, lead: Estimate) -> list[BenchValue]:
    """Values of a motor driven by a voltage, which stands in the place of the torque."""
    inertia, slope = plant.inertia, plant.viscous
    time_s = inertia.value / slope.value
    error_s = abs(time_s) * hypot(inertia.std_error / inertia.value, slope.std_error / slope.value)
    return [
        estimated("gear_ratio", Estimate(ROTARY_LEAD_M / lead.value, 0.0, lead.how), "motor per load"),
        estimated("time_constant_s", Estimate(time_s, error_s, inertia.how), "s"),
        _friction("coulomb_voltage_v", plant.coulomb),
        estimated("voltage_constant_v_s_rad", slope, "V s/rad"),
    ]


def _turning(
    plant: PlantValues, deflection: Estimate | None, sag: Estimate | None, lead: Estimate, split: Split
) -> AxisDraft:
    gear = gear_of(lead)
    values, friction = [estimated("gear_ratio", gear, "motor per load")], _rotary_friction(plant)
    load = split.load.scaled(gear.value**2)
    stiffness = sag or (None if deflection is None else _stiffness(load, deflection))
    if stiffness is None:
        inertia = estimated("inertia_kg_m2", plant.inertia, "kg m^2 at the motor")
        return AxisDraft("rotary", [*values, inertia, *friction])
    elastic = [
        estimated("motor_inertia_kg_m2", split.motor, "kg m^2 at the motor", split.how),
        estimated("load_inertia_kg_m2", load, "kg m^2 at the load", "the rest"),
        estimated("stiffness_n_m_rad", stiffness, "N m/rad"),
    ]
    told = "the sum of the inertias at the motor and load inertia over stiffness"
    held = ("load_inertia_kg_m2",) if split.held else ()
    return AxisDraft("rotary_two_mass", [*values, *elastic, *friction], _unsure(elastic, told, split), held)


def _unsure(elastic: list[BenchValue], told: str, split: Split) -> tuple[str, ...]:
    keys = ", ".join(one.key for one in elastic)
    return (f"{keys}: told are {told}; {split.how}",)


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


def _rotary_friction(plant: PlantValues) -> list[BenchValue]:
    return [_friction("coulomb_torque_n_m", plant.coulomb), _friction("viscous_torque_n_m_s_rad", plant.viscous)]


def _friction(key: str, estimate: Estimate) -> BenchValue:
    sure = "" if estimate.significant else "not identifiable from this motion; "
    how = sure + estimate.how
    if not estimate.value > 0.0:
        how = f"not identifiable from this motion: {estimate.value:.3g} is below 0; {estimate.how}"
    return BenchValue(key, max(estimate.value, 0.0), f"{unit_of(key)}, +-{estimate.std_error:.2g}", how)
