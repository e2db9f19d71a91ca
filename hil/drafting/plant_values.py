"""Inertia, friction, load and transmission of an axis from its recordings.

T = J a + D v + Fc sign(v) + T0 (+ r G sin(r q + q0)  or  + k q)        the plain model at the motor; r = 1 / gear ratio
x = r q + c - r tau v - (m_t / k) a - (F_t / k) sign(v) - (G / k) sin(x + q0)      second encoder over the motor's
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from hil.errors import InputError
from hil.identification.derivatives import motion, rows_per_sample, smoothed
from hil.identification.friction import identify_friction
from hil.identification.least_squares import Estimate, LinearFit, least_squares
from hil.identification.plain_model import MOTION, PlainModel, fit_plain_model, motion_data
from hil.recording.recording import Recording

EDGE_ROWS = 49  # at both ends of a second encoder, where filters settle
WRONG_SIGN = 3.0  # standard errors by which a negative inertia is none that the motion does not tell


@dataclass(frozen=True)
class PlantValues:
    """Estimates at the motor: kg m^2, N m s/rad, N m (linear axis kg, N s/m, N); `left` is a share of the torque.

    `gravity` is the torque G over the load's angle [N m], `gravity_angle` its q0 [rad], both at the load. `spring` is
    the torque over the motor's position k [N m/rad, N/m]. `one_way` is Coulomb friction and load together, in the
    direction of a motion that does not tell them apart; then it is friction, which a bench cannot lack. `early_s` [s]:
    the torque is recorded so much before the motion that it makes; 0 where that is within its error.
    """

    inertia: Estimate
    viscous: Estimate
    coulomb: Estimate
    offset: Estimate
    left: float
    gravity: Estimate | None
    gravity_angle: Estimate | None
    spring: Estimate | None
    one_way: Estimate | None = None
    early_s: Estimate | None = None

    @property
    def offset_told(self) -> bool:
        """True for a constant torque that the motion tells from none, and from friction."""
        return self.offset.significant and self.one_way is None


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


def plant_values(recordings: Sequence[Recording], load_ratio: float | None = None) -> PlantValues:
    """Fit torque over motion of recordings of one axis; with `load_ratio` [load rad per motor rad] also gravity.

    What one recording does not tell another may. Values that none tells have errors as large, or stand for all.
    Raises InputError: no torque, no rows that slide, no positive inertia.
    """
    name, names = recordings[0].name, recordings[0].axis
    if any(names.torque not in recording.columns for recording in recordings):
        raise InputError(
            f"{name}: {names.torque} is not recorded, and without torque no mass and no friction can be told; "
            "record torque, current or voltage"
        )
    data = [motion_data(one[names.motor_position], one[names.torque], one.period_s) for one in recordings]
    model = fit_plain_model(data, load_ratio, spring=True)
    if model is None:
        raise InputError(
            f"{name}: no rows about which the axis keeps sliding one way for the {data[0].window + 2} rows that a "
            "velocity takes; record longer moves, or more rows per second"
        )
    fit = replace(model.fit, how=_how(model, data[0].window * data[0].period_s))
    inertia, viscous, coulomb, offset = (fit[name] for name in MOTION)
    if inertia.value <= -WRONG_SIGN * inertia.std_error:
        raise InputError(
            f"{name}: the inertia comes out as {inertia.value:.3g} +- {inertia.std_error:.2g}, allowed above 0; "
            "the torque has the wrong sign, or the motion does not separate inertia from a spring, gravity or another "
            "moving arm: record moves of different accelerations"
        )
    moving = np.concatenate([one.moved.velocity[one.sliding(model.slowest)] for one in data])
    top, most = float(np.max(np.abs(moving))), max(float(np.max(np.abs(one.torque))) for one in data)
    if inertia.value <= inertia.std_error and inertia.std_error < most / top:
        inertia = replace(inertia, value=inertia.std_error, how=f"{inertia.how}; not told by this motion: its error")
    elif inertia.value <= inertia.std_error:
        inertia = Estimate(most / top, most / top, "assumed: this motion has no acceleration; 1 s to its top speed")
    heavy = "sine" in fit.names
    gravity, angle = _gravity(fit, load_ratio or 1.0) if heavy else (None, None)
    spring = fit["spring"] if "spring" in fit.names else None
    one_way = None
    if not np.isfinite(coulomb.std_error):
        way, mean = float(np.sign(moving[0])), float(np.mean(np.abs(moving)))
        slope = viscous.std_error * mean < abs(coulomb.value + way * offset.value)  # else one speed: all of it together
        one_way = _together(fit, {"coulomb": 1.0, "offset": way, "viscous": 0.0 if slope else mean})
        friction, size = max(one_way.value, 0.0), abs(one_way.value)
        how = (
            f"friction and load, {one_way.value:.3g} +-{one_way.std_error:.2g}: motion one way tells their sum, which "
            "is taken for friction"
        )
        coulomb, offset = Estimate(friction, size, how), Estimate(way * (one_way.value - friction), size, how)
        if not slope:
            viscous = Estimate(0.0, size / mean, "not told from Coulomb friction at one speed")
    elif viscous.value < 0.0:
        # friction that falls with speed, or a loop whose torque answers what the model lacks: neither is the plain law
        viscous, coulomb = (
            replace(one, std_error=float(np.hypot(one.std_error, size)))
            for one, size in ((viscous, viscous.value), (coulomb, viscous.value * top))
        )
    viscous, coulomb = _at_feeds(recordings, viscous, coulomb) or (viscous, coulomb)
    early = Estimate(model.early_rows, model.early_error_rows, fit.how).scaled(data[0].period_s)
    return PlantValues(inertia, viscous, coulomb, offset, fit.left, gravity, angle, spring, one_way, early)


def _together(fit: LinearFit, parts: dict[str, float]) -> Estimate:
    """Sum of coefficients with factors."""
    weights = np.array([parts.get(name, 0.0) for name in fit.names])
    return Estimate(float(weights @ fit.values), float(np.sqrt(weights @ fit.covariance @ weights)), fit.how)


def _how(model: PlainModel, window_s: float) -> str:
    how = f"least squares of torque over motion where it slides, windows of {1e3 * window_s:.3g} ms"
    if model.early_rows:
        late = model.early_rows < 0.0
        how += f", torque recorded {abs(model.early_rows):.2f} rows {'late' if late else 'early'}"
    return how + {5: ", with a spring", 6: ", with gravity"}.get(len(model.fit.names), "")


def _at_feeds(
    recordings: Sequence[Recording], viscous: Estimate, coulomb: Estimate
) -> tuple[Estimate, Estimate] | None:
    """Viscous and Coulomb friction from constant feeds, where these tell both better than all rows do; else None.

    Friction that falls from rest makes the viscous friction of all rows too small, and negative; rows at reversals,
    where the sign of the velocity is least known, make Coulomb friction too small.
    """
    try:
        found = identify_friction(*recordings)
    except InputError:
        return None
    how = f"{len(found.points)} constant feeds; all rows tell it less well"
    # the error of a few points is known badly (Student's t)
    wider = float(stdtrit(len(found.points) - 3, 0.975) / ndtri(0.975))
    at_feeds = (
        Estimate(found.viscous, wider * found.viscous_std_error, how),
        Estimate(found.coulomb, wider * found.coulomb_std_error, how),
    )
    if not all(one.significant and one.value > 0.0 for one in at_feeds):
        return None
    pairs = zip(at_feeds, (viscous, coulomb), strict=True)
    better = all(feed.std_error < rows.std_error for feed, rows in pairs)
    return at_feeds if better or not (viscous.significant and viscous.value > 0.0) else None


def _gravity(fit: LinearFit, load_ratio: float) -> tuple[Estimate, Estimate]:
    """Size and angle at the load from the coefficients of sine and cosine at the motor."""
    at = [fit.names.index(name) for name in ("sine", "cosine")]
    sine, cosine = fit.values[at]
    size = float(np.hypot(sine, cosine))
    along, across = np.array([sine, cosine]) / size, np.array([-cosine, sine]) / size
    error, turned = (float(np.sqrt(one @ fit.covariance[np.ix_(at, at)] @ one)) for one in (along, across))
    angle = Estimate(float(np.arctan2(cosine, sine)), turned / size, fit.how)
    return Estimate(size, error, fit.how).scaled(1.0 / load_ratio), angle


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
    edge = slice(EDGE_ROWS, -EDGE_ROWS)
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
