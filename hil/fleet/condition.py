"""Condition of an axis by one recording: friction, lost motion, lead error, stiffness, delays, what the twin leaves.

What is constant of the axis is held (`constants`). The rest are linear regressions over the measured motion, in rows
about which the axis slides one way (`plain_model`), in motor units:

    T - J a   =  sign(v) (Fc + Fv |v|), both for each direction,  + delay d(J a)/dt
    x - r q   =  x0 - reversal sign(v) / 2 - m_t a / k - delay v + slope q + harmonics 1 to 3 of the screw

x: table, q: motor, m_t: mass at the table. The second one counts rows that do not brake: there the direction tells
which flank drives. Standard errors are those of the jackknife over blocks of rows (`least_squares`). A quantity that
the motion does not tell has no value, and says why.
"""

import math

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.fleet.constants import Constants
from hil.fleet.quantities import Told
from hil.identification.dataset import prepare_dataset
from hil.identification.derivatives import noise_gains
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import measured_motion
from hil.identification.least_squares import BLOCKS, Estimate, LinearFit, least_squares
from hil.identification.measured import Measured
from hil.identification.plain_model import MotionData, PlainModel, SlowestSliding
from hil.identification.torque_left import left_by_twin

_SLIDING = 0.02  # of the top speed, as in the plain model
_BRAKES = 0.05  # of the greatest acceleration: below, an axis counts as braking
_FEWEST = 200  # rows of a regression
_AFTER_S = 0.15  # after a reversal, in which its error is looked for
_TURNS = 2.0  # of the screw, which tell its harmonics from the slope
_HARMONICS = (1, 2, 3)
_TOLD = (
    5.0  # standard errors from 0 at which an inertia is told, and a stiffness, a reciprocal, has an error of its own
)


def condition(run: Measured, constants: Constants, set_points: bool = True) -> dict[str, Told]:
    """Return all quantities by their names. `set_points`: they were recorded, not derived from the motion.

    Raises InputError if the axis does not slide, or if the recording is of another axis.
    """
    motion = measured_motion(run)
    top = float(np.max(np.abs(motion.moved.velocity[motion.rows]), initial=0.0))
    sliding = motion.sliding(SlowestSliding(_SLIDING * top, _SLIDING * top))
    if np.count_nonzero(sliding) < _FEWEST:
        raise InputError(f"{run.name}: the axis hardly moves, allowed sliding motion; record a check motion")
    inertia = _inertia(motion, sliding)
    known = inertia.value is not None and inertia.error is not None and inertia.value > _TOLD * inertia.error
    if known and (told := constants.why_not(inertia.value or 0.0)):
        raise InputError(f"{run.name}: {told}")
    found = _friction(run, motion, sliding, constants)
    found["inertia"] = inertia if known else Told(reason="no accelerations that tell it")
    found["twin_left"] = _twin_left(run, constants, found, SlowestSliding(_SLIDING * top, _SLIDING * top))
    found |= _table(run, motion, sliding, constants)
    if set_points:
        found["quadrant"] = _reversal_error(run, constants.bench.axis.ratio_m_rad)
    else:
        found["quadrant"] = Told(reason="no set-points are recorded")
    return found


def _friction(run: Measured, motion: MotionData, sliding: NDArray[np.bool_], constants: Constants) -> dict[str, Told]:
    """Friction by direction, evenness and delay of the torque."""
    moved, inertial = motion.moved, constants.inertia * motion.moved.acceleration
    rows = np.flatnonzero(sliding)[:: max(motion.window // 4, 1)]
    forward, back = moved.direction > 0.0, moved.direction < 0.0
    columns: dict[str, FloatArray] = {
        "coulomb_forward": np.where(forward, 1.0, 0.0),
        "coulomb_back": np.where(back, -1.0, 0.0),
        "viscous_forward": np.where(forward, moved.velocity, 0.0),
        "viscous_back": np.where(back, moved.velocity, 0.0),
        "torque_delay": np.gradient(inertial, run.period_s),
    }
    names = ["torque_delay", *(f"{kind}_{way}" for way, at in (("forward", forward), ("back", back))
                               for kind in ("coulomb", "viscous") if at[rows].any())]  # fmt: skip
    samples = noise_gains(run.period_s, motion.window)[0] ** 2 * np.count_nonzero(sliding)
    fit = least_squares(
        {name: columns[name][rows] for name in names},
        (motion.torque - inertial)[rows],
        rows_per_sample=rows.size / max(samples, 1.0),
    )
    found = {name: _told(fit, name, "the motion has too few speeds") for name in names}
    missing = {name: Told(reason="the axis does not slide this way") for name in columns if name not in names}
    return found | missing | {"ripple": _rms(fit.residual)}


def _inertia(motion: MotionData, sliding: NDArray[np.bool_]) -> Told:
    """Inertia of this recording alone."""
    rows = np.flatnonzero(sliding)[:: max(motion.window // 4, 1)]
    moved = motion.moved
    columns = {
        "inertia": moved.acceleration,
        "viscous": moved.velocity,
        "way": moved.direction,
        "one": moved.direction**2,
    }
    fit = least_squares({name: values[rows] for name, values in columns.items()}, motion.torque[rows])
    return _told(fit, "inertia", "no accelerations that tell it")


def _twin_left(run: Measured, constants: Constants, found: dict[str, Told], slowest: SlowestSliding) -> Told:
    """Share of the torque's deviation that the twin leaves which has the friction of this recording."""
    coulomb, viscous = (
        [one.value for way in ("forward", "back") if (one := found[f"{kind}_{way}"]).value is not None]
        for kind in ("coulomb", "viscous")
    )
    if not coulomb or not run.observability.torque_measured:
        return Told(reason="no torque is recorded")
    axis = constants.bench.axis
    of_run = zip(axis.FRICTION, (coulomb, viscous), strict=False)
    values = {name: max(float(np.mean(each)), 0.0) for name, each in of_run if each}
    bench = constants.bench.model_copy(update={"axis": axis.model_copy(update=values)})
    data = prepare_dataset([run], bench)
    plain = PlainModel(least_squares({"one": np.ones(2)}, np.ones(2)), slowest)
    left = left_by_twin(Hypothesis(bench), data, plain)
    if left is None:
        return Told(reason="the twin does not hold the motion")
    return Told(left, left / math.sqrt(2.0 * BLOCKS))


def _table(run: Measured, motion: MotionData, sliding: NDArray[np.bool_], constants: Constants) -> dict[str, Told]:
    """What the two encoders tell: reversal difference, windup, lateness, lead."""
    names = ("reversal", "stiffness", "lead_error", "lead_slope", "table_delay")
    if not run.table_m.size:
        return dict.fromkeys(names, Told(reason="no encoder at the table"))
    axis, moved = constants.bench.axis, motion.moved
    peak = float(np.max(np.abs(moved.acceleration[sliding])))
    noise = motion.noise * noise_gains(run.period_s, motion.window)[2]
    rows = np.flatnonzero(sliding & (moved.acceleration * moved.direction > -max(_BRAKES * peak, 4.0 * noise)))
    if rows.size < _FEWEST:
        return dict.fromkeys(names, Told(reason="too little motion without braking"))
    turn = axis.physics().angle_per_unit
    angle = turn * run.motor
    columns: dict[str, FloatArray] = {
        "one": np.ones_like(angle),
        "reversal": -0.5 * moved.direction,
        "windup": -moved.acceleration,
        "table_delay": -axis.ratio_m_rad * moved.velocity,
        "lead_slope": axis.ratio_m_rad * (run.motor - run.motor[rows].mean()),
    }
    turns = float(np.ptp(angle[rows])) / (2.0 * math.pi)
    if turns >= _TURNS:
        for order in _HARMONICS:
            columns |= {f"sine {order}": np.sin(order * angle), f"cosine {order}": np.cos(order * angle)}
    both = np.unique(moved.direction[rows]).size > 1
    if not both:
        del columns["reversal"]
    fit = least_squares(
        {name: values[rows] for name, values in columns.items()},
        (run.table_m - axis.ratio_m_rad * run.motor)[rows],
    )
    found = {name: _told(fit, name, "the motion has too few speeds") for name in ("lead_slope", "table_delay")}
    found["reversal"] = _told(fit, "reversal", "") if both else Told(reason="it moves one way only")
    found["stiffness"] = _stiffness(fit["windup"], constants)
    found["lead_error"] = _amplitude(fit) if turns >= _TURNS else Told(reason="the screw makes less than two turns")
    return found


def _stiffness(windup: Estimate, constants: Constants) -> Told:
    """Stiffness at the table [N/m] by the windup per acceleration of the motor, in m per motor unit / s^2."""
    axis = constants.bench.axis
    chain = axis.physics().chain
    if not np.any(chain.transmission):
        return Told(reason="the axis of the bench file has no spring")
    at_table = float(chain.side(chain.table) @ chain.inertia_kg_m2.sum(axis=1)) / axis.ratio_m_rad
    if not math.isfinite(windup.std_error) or windup.value < _TOLD * windup.std_error:
        return Told(reason="the accelerations wind the axis up too little")
    value = at_table / windup.value
    return Told(value, value * windup.std_error / windup.value)


def _amplitude(fit: LinearFit) -> Told:
    """Amplitude of the first harmonic with its standard error."""
    sine, cosine = fit["sine 1"], fit["cosine 1"]
    value = math.hypot(sine.value, cosine.value)
    error = math.hypot(sine.value * sine.std_error, cosine.value * cosine.std_error) / max(value, 1e-300)
    return Told(value, error) if math.isfinite(error) else Told(reason="the motion does not tell it")


def _reversal_error(run: Measured, ratio_m: float) -> Told:
    """Mean over reversals of the largest following error after them beyond that of steady motion."""
    command, velocity = run.position_command_m, run.velocity_command_m_s
    position = run.table_m if run.table_m.size else ratio_m * run.motor
    ways = np.sign(np.where(run.moving, velocity, 0.0))
    moving = np.flatnonzero(ways)
    turned = moving[1:][np.diff(ways[moving]) != 0.0]
    if turned.size < 2:
        return Told(reason="fewer than two reversals")
    error = command - position
    columns = {"one": np.ones(velocity.size), "lag": velocity, "way": ways}
    fit = least_squares(
        {name: values[run.evaluated] for name, values in columns.items()}, error[run.evaluated], blocks=0
    )
    left = np.abs(error - fit.predict(columns | {"way": np.zeros(velocity.size)}))
    rows = round(_AFTER_S / run.period_s)
    peaks = np.array([np.max(left[row : row + rows]) for row in turned])
    return Told(float(peaks.mean()), float(peaks.std(ddof=1) / math.sqrt(peaks.size)))


def _rms(residual: FloatArray) -> Told:
    blocks = np.array([np.mean(one**2) for one in np.array_split(residual, BLOCKS)])
    value = math.sqrt(float(blocks.mean()))
    return Told(value, float(blocks.std(ddof=1) / math.sqrt(BLOCKS) / (2.0 * max(value, 1e-300))))


def _told(fit: LinearFit, name: str, reason: str) -> Told:
    estimate = fit[name]
    if not math.isfinite(estimate.std_error) or estimate.std_error <= 0.0:
        return Told(reason=reason)
    return Told(estimate.value, estimate.std_error)
