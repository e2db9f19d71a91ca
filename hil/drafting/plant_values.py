"""Inertia, friction, load and transmission of an axis from its recording.

T = J a + D v + Tc sign(v) + T0 (+ r G sin(r q + q0)  or  + k q)        at the motor; r = 1 / gear ratio
x = r q + c - r tau v - (m_t / k) a - (F_t / k) sign(v) - (G / k) sin(x + q0)      second encoder over the motor's
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.stats import norm
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.drafting.estimate import BlockFit, Estimate, fit_blocks
from hil.errors import InputError
from hil.identification.friction import identify_friction
from hil.identification.inverse_dynamics import CORNER, CUT_AT_START, inverse_dynamics_columns
from hil.identification.sensor_noise import white_noise
from hil.importing.relations import direction, motion, smoothed
from hil.recording.recording import Recording

CUTOFFS_HZ = (100.0, 50.0, 25.0, 12.0, 6.0, 3.0)  # of the position filter
NOISE_SHARE = 0.02  # of noise in the acceleration: it makes the inertia too small by this share
MOST_OF_RATE = 0.2  # of the sampling rate: the filter must end well below half of it
LEAST_ROWS = 80  # after decimation: eight per block of the error estimate
# Residual with a torque over the position over that without, up to which it is reported: on LEAST_ROWS white rows two
# parameters without effect remove 1 %.
GRAVITY_GAIN = 0.85
# Least low-passed sign of the velocity of a row that is fitted: below, the filter mixes the friction of both directions
# and of rest, and its change near a reversal, where the acceleration is largest, looks like an inertia.
SLIDES = 0.9
WRONG_SIGN = 3.0  # standard errors by which a negative inertia is none that the motion does not tell
LEAST_ANGLE_RAD = 0.5  # of the load: over less, a sine is a straight line to 1 %, and gravity is a spring


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
    inertia, viscous, coulomb, offset, *more = fit.estimates
    if inertia.value <= -WRONG_SIGN * inertia.std_error:
        raise InputError(
            f"{recording.name}: the inertia comes out as {inertia.value:.3g} +- {inertia.std_error:.2g}, allowed "
            "above 0; "
            "the torque has the wrong sign, or the motion does not separate inertia from a spring, gravity or another "
            "moving arm: record moves of different accelerations"
        )
    if inertia.value <= inertia.std_error:
        inertia = replace(inertia, value=inertia.std_error, how=f"{inertia.how}; not told by this motion: its error")
    gravity, angle = _gravity(more[0], more[1], load_ratio) if len(more) == 2 and load_ratio else (None, None)
    spring = more[0] if len(more) == 1 else None
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


def _fit(recording: Recording, cutoff_hz: float, load_ratio: float | None) -> BlockFit:
    """Fit without a torque over the position, or with it where it leaves clearly less.

    It is a spring, or gravity where the load turns far and that leaves less.
    """
    # the filter of the decimation, alike for torque and motion, ends where that of the position does, at 40 Hz or below
    rate_hz = 1.0 / recording.period_s
    decimation = max(2, round(0.5 * CORNER * rate_hz / cutoff_hz), round(rate_hz / 100.0))
    rows = (len(recording) - CUT_AT_START) // decimation
    if rows < LEAST_ROWS:
        raise InputError(
            f"{recording.name}: given {len(recording)} rows, allowed {CUT_AT_START + LEAST_ROWS * decimation} or more; "
            "give a longer recording"
        )
    position = recording[recording.axis.motor_position]
    angle = position * (load_ratio or 0.0)
    over_position = [position, np.sin(angle), np.cos(angle)]
    columns, torque = inverse_dynamics_columns(recording, cutoff_hz, decimation, more=over_position)
    slides = np.abs(columns[:, 2]) > SLIDES
    if np.count_nonzero(slides) >= LEAST_ROWS:
        columns, torque = columns[slides], torque[slides]
    how = f"least squares of torque over motion, position filtered at {cutoff_hz:g} Hz"
    motion_only, spring, weight = columns[:, :4].T, columns[:, 4], columns[:, 5:].T
    plain = fit_blocks(list(motion_only), torque, [how] * 4)
    more = fit_blocks([*motion_only, spring], torque, [f"{how}, with a spring"] * 5)
    if np.ptp(spring) * (load_ratio or 0.0) >= LEAST_ANGLE_RAD:
        heavy = fit_blocks([*motion_only, *weight], torque, [f"{how}, with gravity"] * 6)
        more = heavy if heavy.left < more.left else more
    return more if more.left < GRAVITY_GAIN * plain.left and more.estimates[0].value > 0.0 else plain


def transmission_values(recording: Recording, gravity_angle: float | None = None) -> TransmissionValues | None:
    """Fit the second encoder over the motor's; with `gravity_angle` [rad] also the deflection under gravity.

    None without a second encoder.
    """
    names = recording.axis
    if names.table_position not in recording.columns:
        return None
    period_s = recording.period_s
    moved = motion(recording[names.motor_position], period_s)
    edge = slice(CUT_AT_START, -CUT_AT_START)
    table = smoothed(recording[names.table_position], period_s)[edge]
    parts = (moved.position, moved.velocity, moved.acceleration, direction(moved.velocity))
    columns: list[FloatArray] = [*(part[edge] for part in parts), np.ones(table.size)]
    if gravity_angle is not None:
        weight = -np.sin(table + gravity_angle)
        columns += [weight, np.sign(weight)]  # deflection, and play whose flank the weight chooses
    fit = fit_blocks(columns, table, ["second encoder over the motor's"] * len(columns))
    sag = fit.estimates[5] if gravity_angle is not None else None
    ratio, velocity, acceleration, friction = fit.estimates[:4]
    delay = velocity.scaled(-1.0 / ratio.value)
    # a pure delay adds r tau^2 / 2 to the factor of the acceleration
    straight = Estimate(
        acceleration.value - 0.5 * ratio.value * delay.value**2, acceleration.std_error, acceleration.how
    ).scaled(1.0 / ratio.value)
    return TransmissionValues(ratio, delay, straight, friction, fit.left * float(np.std(table)), sag)
