"""Inertia, friction, load and transmission of an axis from its recording.

T = J a + D v + Fc sign(v) + T0 (+ r G sin(r q + q0)  or  + k q)        the plain model at the motor; r = 1 / gear ratio
x = r q + c - r tau v - (m_t / k) a - (F_t / k) sign(v) - (G / k) sin(x + q0)      second encoder over the motor's
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.stats import norm
from scipy.stats import t as student

from hil.errors import InputError
from hil.identification.derivatives import motion, rows_per_sample, smoothed
from hil.identification.friction import identify_friction
from hil.identification.inverse_dynamics import CORNER, CUT_AT_START, inverse_dynamics_columns
from hil.identification.least_squares import Estimate, LinearFit, least_squares
from hil.identification.plain_model import MOTION, least_structure
from hil.identification.sensor_noise import white_noise
from hil.recording.recording import Recording

CUTOFFS_HZ = (100.0, 50.0, 25.0, 12.0, 6.0, 3.0)  # of the position filter
NOISE_SHARE = 0.02  # of noise in the acceleration: it makes the inertia too small by this share
MOST_OF_RATE = 0.2  # of the sampling rate: the filter must end well below half of it
LEAST_ROWS = 80  # after decimation: eight per block of the error estimate
WRONG_SIGN = 3.0  # standard errors by which a negative inertia is none that the motion does not tell


@dataclass(frozen=True)
class PlantValues:
    """Estimates at the motor: kg m^2, N m s/rad, N m (linear axis kg, N s/m, N); `left` is a share of the torque.

    `gravity` is the torque G over the load's angle [N m], `gravity_angle` its q0 [rad], both at the load. `spring` is
    the torque over the motor's position k [N m/rad, N/m].
    """

    inertia: Estimate
    viscous: Estimate
    coulomb: Estimate
    offset: Estimate
    left: float
    gravity: Estimate | None
    gravity_angle: Estimate | None
    spring: Estimate | None
    cutoff_hz: float


@dataclass(frozen=True)
class TransmissionValues:
    """Second encoder against the motor's: ratio [m/rad], delay [s], -m_t / k [s^2], lost motion [m], rms left [m].

    `sag_m` is the deflection G / k under gravity over the angle of a load that turns, None where it is not seen.
    """

    ratio: Estimate
    delay_s: Estimate
    compliance_s2: Estimate
    friction_m: Estimate
    left_m: float
    sag_m: Estimate | None = None


def plant_values(recording: Recording, load_ratio: float | None = None) -> PlantValues:
    """Fit torque over motion; with `load_ratio` [load rad per motor rad] also gravity on a load that turns.

    Raises InputError: too short, motion in one direction, no torque, no positive inertia.
    """
    names = recording.axis
    if names.torque not in recording.columns:
        raise InputError(
            f"{recording.name}: {names.torque} is not recorded, and without torque no mass and no friction can be "
            "told; "
            "record torque, current or voltage"
        )
    rate_hz = 1.0 / recording.period_s
    allowed = [cutoff_hz for cutoff_hz in CUTOFFS_HZ if cutoff_hz <= MOST_OF_RATE * rate_hz]
    if not allowed:
        raise InputError(
            f"{recording.name}: given {rate_hz:.3g} rows per second, allowed {CUTOFFS_HZ[-1] / MOST_OF_RATE:g} or "
            "more; "
            "record at a higher rate"
        )
    # the highest that noise allows: a lower one cuts acceleration, so that the inertia comes out too large
    cutoff_hz = next((one for one in allowed if _noise_share(recording, one) < NOISE_SHARE), allowed[-1])
    fit = _fit(recording, cutoff_hz, load_ratio)
    inertia, viscous, coulomb, offset = (fit[name] for name in MOTION)
    if inertia.value <= -WRONG_SIGN * inertia.std_error:
        raise InputError(
            f"{recording.name}: the inertia comes out as {inertia.value:.3g} +- {inertia.std_error:.2g}, allowed "
            "above 0; "
            "the torque has the wrong sign, or the motion does not separate inertia from a spring, gravity or another "
            "moving arm: record moves of different accelerations"
        )
    if inertia.value <= inertia.std_error:
        inertia = replace(inertia, value=inertia.std_error, how=f"{inertia.how}; not told by this motion: its error")
    heavy = load_ratio is not None and "sine" in fit.names
    gravity, angle = _gravity(fit["sine"], fit["cosine"], load_ratio or 1.0) if heavy else (None, None)
    spring = fit["spring"] if "spring" in fit.names else None
    viscous, coulomb = _at_feeds(recording, viscous, coulomb) or (viscous, coulomb)
    return PlantValues(inertia, viscous, coulomb, offset, fit.left, gravity, angle, spring, cutoff_hz)


def _at_feeds(recording: Recording, viscous: Estimate, coulomb: Estimate) -> tuple[Estimate, Estimate] | None:
    """Viscous and Coulomb friction from constant feeds, where these tell both better than all rows do; else None.

    Friction that falls from rest makes the viscous friction of all rows too small, and negative; rows at reversals,
    where the sign of the velocity is least known, make Coulomb friction too small.
    """
    try:
        found = identify_friction(recording)
    except InputError:
        return None
    how = f"{len(found.points)} constant feeds; all rows tell it less well"
    # the error of a few points is known badly (Student's t)
    wider = float(student.ppf(0.975, len(found.points) - 3) / norm.ppf(0.975))
    at_feeds = (
        Estimate(found.viscous, wider * found.viscous_std_error, how),
        Estimate(found.coulomb, wider * found.coulomb_std_error, how),
    )
    if not all(one.significant and one.value > 0.0 for one in at_feeds):
        return None
    pairs = zip(at_feeds, (viscous, coulomb), strict=True)
    better = all(feed.std_error < rows.std_error for feed, rows in pairs)
    return at_feeds if better or not (viscous.significant and viscous.value > 0.0) else None


def _gravity(sine: Estimate, cosine: Estimate, load_ratio: float) -> tuple[Estimate, Estimate]:
    """Size and angle at the load from the coefficients of sine and cosine at the motor."""
    size = float(np.hypot(sine.value, cosine.value))
    error = float(np.hypot(sine.value * sine.std_error, cosine.value * cosine.std_error)) / size
    across = float(np.hypot(cosine.value * sine.std_error, sine.value * cosine.std_error)) / size
    angle = Estimate(float(np.arctan2(cosine.value, sine.value)), across / size, sine.how)
    return Estimate(size, error, sine.how).scaled(1.0 / load_ratio), angle


def _noise_share(recording: Recording, cutoff_hz: float) -> float:
    """Share of white position noise in the variance of the acceleration below `cutoff_hz`.

    var = 2 T sigma^2 (2 pi)^4 fc^5 / 5 for white noise sigma at the period T.
    """
    position, period_s = recording[recording.axis.motor_position], recording.period_s
    noise = 2.0 * period_s * white_noise(position) ** 2 * (2.0 * np.pi) ** 4 * cutoff_hz**5 / 5.0
    filtered = sosfiltfilt(butter(4, 2.0 * cutoff_hz * period_s, output="sos"), position)
    total = float(np.var(np.diff(filtered, 2))) / period_s**4
    return float(noise) / total if total > 0.0 else np.inf


def _fit(recording: Recording, cutoff_hz: float, load_ratio: float | None) -> LinearFit:
    # the filter of the decimation, alike for torque and motion, ends where that of the position does, at 40 Hz or below
    rate_hz = 1.0 / recording.period_s
    decimation = max(2, round(0.5 * CORNER * rate_hz / cutoff_hz), round(rate_hz / 100.0))
    rows = (len(recording) - CUT_AT_START) // decimation
    if rows < LEAST_ROWS:
        raise InputError(
            f"{recording.name}: given {len(recording)} rows, allowed {CUT_AT_START + LEAST_ROWS * decimation} or more; "
            "give a longer recording"
        )
    columns, torque = inverse_dynamics_columns(recording, cutoff_hz, decimation, load_ratio=load_ratio)
    turned_rad = float(np.ptp(columns["spring"])) * (load_ratio or 0.0)
    how = f"least squares of torque over motion, position filtered at {cutoff_hz:g} Hz"
    return least_structure(columns, torque, LEAST_ROWS, turned_rad, how=how)


def transmission_values(recording: Recording, gravity_angle: float | None = None) -> TransmissionValues | None:
    """Fit the second encoder over the motor's; with `gravity_angle` [rad] also the deflection under gravity.

    None without a second encoder.
    """
    names = recording.axis
    if names.table_position not in recording.columns:
        return None
    period_s = recording.period_s
    moved = motion(recording[names.motor_position], period_s)
    table = smoothed(recording[names.table_position], period_s)
    columns = {
        "ratio": moved.position,
        "delay": moved.velocity,
        "compliance": moved.acceleration,
        "friction": moved.direction,
        "offset": np.ones_like(table),
    }
    if gravity_angle is not None:
        weight = -np.sin(table + gravity_angle)
        columns |= {"sag": weight, "play": np.sign(weight)}  # deflection, and play whose flank the weight chooses
    edge = slice(CUT_AT_START, -CUT_AT_START)
    columns, table = {name: column[edge] for name, column in columns.items()}, table[edge]
    how = "second encoder over the motor's"
    fit = least_squares(columns, table, rows_per_sample=rows_per_sample(period_s), how=how)
    ratio, acceleration = fit["ratio"], fit["compliance"]
    delay = fit["delay"].scaled(-1.0 / ratio.value)
    # a pure delay adds r tau^2 / 2 to the factor of the acceleration
    straight = replace(acceleration, value=acceleration.value - 0.5 * ratio.value * delay.value**2)
    compliance, left_m = straight.scaled(1.0 / ratio.value), float(np.std(fit.residual))
    sag = fit["sag"] if gravity_angle is not None else None
    return TransmissionValues(ratio, delay, compliance, fit["friction"], left_m, sag)
