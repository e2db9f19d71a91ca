"""Inertia and friction of a bench where no torque is recorded: two encoders tell the transmission without them."""

from collections.abc import Sequence

from hil.drafting.plant_values import PlantValues, TransmissionValues, plant_values
from hil.identification.least_squares import Estimate
from hil.recording.recording import Recording

# A servo motor of a kilowatt; without a torque a diagnosis uses the ratio of stiffness and mass alone.
_INERTIA_KG_M2, _COULOMB_N_M, _VISCOUS_N_M_S_RAD = 1e-3, 0.1, 1e-3
ASSUMED = "assumed: no torque is recorded, which would tell it"


def plant_or_assumed(
    recordings: Sequence[Recording],
    transmission: TransmissionValues | None,
    load_ratio: float | None,
    nominal: Estimate | None,
) -> PlantValues:
    """Values by `plant_values`; those of a usual motor, with errors as large, where two encoders are recorded alone.

    `nominal` is the inertia that the owner tells, for that of a usual motor.
    """
    if any(one.axis.torque in one.columns for one in recordings) or transmission is None:
        return plant_values(recordings, load_ratio)
    inertia, viscous, coulomb = (
        Estimate(value, value, ASSUMED) for value in (_INERTIA_KG_M2, _VISCOUS_N_M_S_RAD, _COULOMB_N_M)
    )
    return PlantValues(nominal or inertia, viscous, coulomb, Estimate(0.0, 0.0, ASSUMED), 0.0, None, None, None)
