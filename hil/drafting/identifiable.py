"""Refuse a draft of which nothing is told: a bench of such values would look like a measured one."""

from hil.channels import AxisKind
from hil.drafting.plant_values import PlantValues
from hil.errors import InputError
from hil.identification.least_squares import SIGMAS
from hil.quantities import digits


def refuse_untold(name: str, kind: AxisKind, plant: PlantValues) -> None:
    """Raise InputError if the recording `name` tells neither inertia nor friction nor what acts over the position."""
    told = (plant.inertia, plant.coulomb, plant.viscous, plant.gravity, plant.spring)
    if any(one is not None and one.significant for one in told):
        return
    units = ("kg", "N", "N s/m") if kind is AxisKind.LINEAR else ("kg m^2 at the motor", "N m", "N m s/rad")
    names = ("mass" if kind is AxisKind.LINEAR else "inertia", "Coulomb friction", "viscous friction")
    values = (plant.inertia, plant.coulomb, plant.viscous)
    shown = ", ".join(
        f"{what} {one.value:.3g} +-{one.std_error:.2g} {unit}"
        for what, one, unit in zip(names, values, units, strict=True)
    )
    effort, unit = ("force", "N") if kind is AxisKind.LINEAR else ("torque", "N m")
    together = plant.one_way
    sums = "" if together is None else (
        f"; told is only friction and load together, {together.value:.3g} +-{together.std_error:.2g} {unit}"
    )  # fmt: skip
    raise InputError(
        f"{name}: neither {names[0]} nor friction is identifiable, and no bench is written: {shown}; each is below "
        f"{SIGMAS:g} of its standard errors, and the motion leaves {digits(100.0 * plant.left, 2)} % of the {effort}"
        f"{sums}. Check in the map that the {effort} is of the axis that moves; else record moves both ways, with more "
        "acceleration and at several speeds"
    )
