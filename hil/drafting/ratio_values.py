"""Lead of a screw, or gear ratio, from two positions of a recording."""

from dataclasses import replace
from math import pi

from hil.drafting.plant_values import TransmissionValues
from hil.identification.derivatives import motion
from hil.identification.least_squares import Estimate, least_squares
from hil.identification.plain_model import plain_columns
from hil.importing.usual_values import SURE_TURNS, usual_lead
from hil.quantities import ROTARY_LEAD_M
from hil.recording.recording import Recording

DIRECT = 0.02  # deviation from equal angles of motor and load up to which there is no gear
_WHOLE = 1e-4  # relative deviation from a round value that is none: play between the encoders biases the measured one
_LIKELY = 2.0  # standard errors within which a round value is taken


def lead_of(recording: Recording, transmission: TransmissionValues | None) -> Estimate:
    """Travel per motor revolution [m]; on a rotary axis that of the load in rad.

    Of two encoders, else of set-points and encoder, else that of the import map, which of motor channels alone makes a
    screw. Beside a measured lead that of the map, or a usual one, is taken only where they do not contradict each
    other: what the bench file says would else be named as an error of the machine.
    """
    names, told = recording.axis, recording.metadata.get("lead_m")
    if transmission is not None:
        measured = transmission.ratio.scaled(2.0 * pi)
    elif names.position_command in recording.columns:
        measured = _of_set_points(recording).scaled(2.0 * pi)
    elif told not in (None, ROTARY_LEAD_M):  # the motor's own channels of a screw
        return Estimate(told, 0.0, "lead of the map; one encoder and no set-points do not measure it")
    else:
        return Estimate(ROTARY_LEAD_M, 0.0, "one encoder and no set-points: no ratio is told")
    if abs(measured.value - ROTARY_LEAD_M) < max(DIRECT * ROTARY_LEAD_M, _LIKELY * measured.std_error):
        return Estimate(ROTARY_LEAD_M, measured.std_error, f"direct; {measured.how}")
    usual = usual_lead(measured.value)
    lead = told if told not in (None, ROTARY_LEAD_M) and _agrees(told, measured) else usual
    if lead == measured.value:
        return measured
    if _agrees(lead, measured):
        return replace(measured, value=lead, how=f"{measured.how} ({1e3 * measured.value:.6g} mm measured)")
    how = f"{measured.how}; if its nominal lead is {1e3 * lead:g} mm write that: hil diagnose then names the difference"
    return replace(measured, how=how)


def gear_of(lead: Estimate) -> Estimate:
    """Motor revolutions per revolution of the load: the whole number that is very near, else the ratio."""
    measured = Estimate(ROTARY_LEAD_M / lead.value, ROTARY_LEAD_M / lead.value**2 * lead.std_error, lead.how)
    whole = float(round(measured.value))
    off = abs(measured.value - whole)
    if whole < 1.0 or off == 0.0 or off > SURE_TURNS or not _agrees(whole, measured):
        return measured
    return replace(measured, value=whole, how=f"{measured.how} ({measured.value:.7g} measured)")


def _agrees(value: float, measured: Estimate) -> bool:
    return abs(measured.value - value) < max(_WHOLE * value, _LIKELY * measured.std_error)


def _of_set_points(recording: Recording) -> Estimate:
    """Set-points over the motor's position [m/rad], beside a following error over velocity and acceleration.

    The remaining difference is following error, which depends on the motion. All of it counts as error of the ratio.
    """
    names = recording.axis
    moved = motion(recording[names.motor_position], recording.period_s)
    fit = least_squares(plain_columns(moved, spring=True), recording[names.position_command])
    ratio = fit["spring"]  # the factor of the position
    error = max(ratio.std_error, fit.left * abs(ratio.value))
    return Estimate(ratio.value, error, "set-points over the motor's encoder")
