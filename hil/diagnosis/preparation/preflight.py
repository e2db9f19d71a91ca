"""Check recordings before a diagnosis: excitation, frozen channels, wrong signs and units, saturation.

The plain model of the torque over the measured motion tells inertia J and Coulomb friction Fc. One of them negative,
and none positive, shows a wrong sign; J and Fc far from those of the bench, a wrong unit.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS
from hil.errors import InputError, listed
from hil.identification.derived_channels import DERIVED, completed, torque_is_measured
from hil.identification.measured import LEAD_IN, Measured, take
from hil.identification.plain_model import PlainModel, fit_plain_model, motion_data
from hil.quantities import digits, misread_factors
from hil.recording.recording import Recording

SHORTEST_S = 0.8  # settling, and LEAST_MOVING_S of motion: a part of a recording of three seconds
LEAST_TRAVEL_COUNTS = 50  # of the motor encoder: below, counting is 2 % of the motion
LEAST_MOVING_S = 0.5  # a few hundred moving rows: below, the parameters are not determined
# Nominal parameters may be wrong by a factor of three (`hil.identification.hypothesis`), wrong units exceed that.
WRONG_BY = 4.0
SLOPE_TOLERANCE = 0.2  # of positions against set-points; following errors are below 5 %
_RELATED = 0.5  # least squared correlation of two channels for a factor between them: half of the variance
_SWINGS = 6  # of the command between its limits in a move one way: to speed up and to brake make two
_POSITIVE = {"inertia": "inertia", "coulomb": "friction"}
SATURATED = 0.5  # share of the moving rows at the torque limit: above, most rows do not obey the control law

_POSITION_UNITS = misread_factors("mm", "um", "nm", "deg", "rev", "km", "in")
_VELOCITY_UNITS = misread_factors("m/min", "mm/s", "mm/min", "um/s")
_TORQUE_UNITS = misread_factors("mN m", "uN m", "N cm", "kN m", "kgf m", "kgf cm", "ozf in", "lbf ft") | {
    9.81: "N m times 9.81",
    2.0 * math.pi: "N m times 2 pi",
    1.0 / (2.0 * math.pi): "N m per 2 pi",
}


class Preflight(NamedTuple):
    """Recordings prepared for the twin, none if they cannot be diagnosed, and one line per problem."""

    runs: list[Measured]
    problems: tuple[str, ...]

    def accepted(self) -> list[Measured]:
        """The prepared recordings; raises InputError with all problems if there are any."""
        if self.problems:
            raise InputError("\n".join(self.problems))
        return self.runs


def preflight(recordings: Sequence[Recording], bench: Bench) -> Preflight:
    """Check recordings and prepare them for the twin.

    Problems are missing channels, too short, no motion, a frozen or copied channel, a wrong sign or unit of a position
    or of the torque, saturation in most of the motion.
    """
    if not recordings:
        return Preflight([], ("given no recording, allowed one or more; give the recordings to diagnose",))
    recordings = [completed(recording, bench) for recording in recordings]
    if problems := [problem for recording in recordings for problem in _raw_problems(recording, bench)]:
        return Preflight([], tuple(problems))
    try:
        runs = [take(recording, bench) for recording in recordings]
    except InputError as error:  # the bench is of another axis, or values are damaged
        return Preflight([], (str(error),))
    problems = [
        f"{run.name}: {problem}"
        for run, recording in zip(runs, recordings, strict=True)
        for problem in _problems(run, bench, set(recording.metadata.get(DERIVED, {})), runs)
    ]
    return Preflight(runs, tuple(problems))


def _raw_problems(recording: Recording, bench: Bench) -> Iterator[str]:
    duration = (len(recording) - recording.metadata.get(LEAD_IN, 0)) * recording.period_s
    if duration < SHORTEST_S:
        yield (
            f"{recording.name}: too short: given {duration:.3g} s, allowed {SHORTEST_S:g} s or more; "
            "record a motion there and back"
        )
    names = AXIS_CHANNELS[recording.kind]
    needed = (names.position_command, names.velocity_command, names.motor_position, names.torque)
    for name in needed if bench.law_known else ():
        if name not in recording.columns:
            yield (
                f"{recording.name}: {name} is not recorded, allowed are recordings with it; "
                f"record it (there are {listed(recording.columns)})"
            )
    if not torque_is_measured(recording) and not bench.has_table_encoder:
        yield (
            f"{recording.name}: neither {names.torque}, {names.torque_command} nor {names.table_position} is recorded, "
            "allowed are recordings with one of them beside the motor: motion alone has no cause; record one"
        )


def _problems(run: Measured, bench: Bench, derived: set[str], runs: Sequence[Measured]) -> Iterator[str]:
    names, ratio = AXIS_CHANNELS[run.kind], bench.axis.ratio_m_rad
    command = run.position_command_m
    top = float(np.max(np.abs(run.velocity_command_m_s)))
    moving = run.moving & (np.arange(run.motor.size) >= run.lead_in)
    moved = float(np.ptp(run.motor)) * ratio
    if np.ptp(command) == 0.0 or top == 0.0:
        yield (
            "without excitation: the set-points do not move, so that no parameter is determined; "
            "record a motion with reversals and several feeds"
        )
        return
    if moving.sum() * run.period_s < LEAST_MOVING_S:
        yield (
            f"without excitation: the set-points move for {moving.sum() * run.period_s:.2g} s, allowed "
            f"{LEAST_MOVING_S:g} s or more; record more motion"
        )
        return
    if np.ptp(run.motor) == 0.0:
        yield f"{names.motor_position} is frozen at {run.motor[0]:.6g} while the set-points move; check the encoder"
        return
    if np.ptp(run.torque) == 0.0:
        yield f"{names.torque} is frozen at {run.torque[0]:.6g} while the axis moves; check the channel"
        return
    if moved < LEAST_TRAVEL_COUNTS * math.sqrt(12.0) * run.noise.motor * ratio:
        yield (
            f"without excitation: the motor moves by {moved * 1e6:.3g} µm, {LEAST_TRAVEL_COUNTS} counts of its "
            "encoder or less; record a longer motion"
        )
        return
    found = [*_position_problems(run, bench, names.motor_position, names.table_position)]
    if names.velocity_command not in derived:  # a derived channel has no unit of its own to be wrong
        found += _set_point_problems(run, names.velocity_command)
    yield from found
    if run.observability.closed_loop:  # else the saturated rows obey the plant like the others
        yield from _saturation(run, bench, moving)
    if not found and run.observability.torque_measured:  # the check of the torque needs a valid measured motion
        yield from _torque_problems(run, bench, runs)


def _position_problems(run: Measured, bench: Bench, motor: str, table: str) -> Iterator[str]:
    ratio = bench.axis.ratio_m_rad
    slope = _factor_between(run.position_command_m, ratio * run.motor)
    if bench.axis.turns and abs(slope / ratio - 1.0) < SLOPE_TOLERANCE < abs(slope - 1.0):
        yield (
            f"position_command_m: is the angle of the motor, and is to be that of the load, behind a gear of "
            f"{1.0 / ratio:.6g}; in the import map write so many times its counts per revolution, or scale: {ratio:.6g}"
        )
    elif abs(slope - 1.0) > SLOPE_TOLERANCE:
        yield f"{motor}: {_factor(slope, _POSITION_UNITS, 'the set-points')}"
    if not run.table_m.size:
        return
    if np.ptp(run.table_m) == 0.0:
        yield f"{table} is frozen at {run.table_m[0]:.6g} while the axis moves; check the linear encoder"
        return
    if np.ptp(run.table_m - ratio * run.motor) < 1e-12:
        yield (
            f"{table} is a copy of the motor position, allowed the linear encoder's own reading; "
            "record it, or write 'table: null' under encoders in the bench file"
        )
    slope = _factor_between(run.position_command_m, run.table_m)
    if abs(slope - 1.0) > SLOPE_TOLERANCE:
        yield f"{table}: {_factor(slope, _POSITION_UNITS, 'the set-points')}"


def _set_point_problems(run: Measured, name: str) -> Iterator[str]:
    speed = np.gradient(run.position_command_m, run.period_s)
    slope = float(speed @ run.velocity_command_m_s / (speed @ speed))  # at a constant feed it has no other
    if abs(slope - 1.0) > SLOPE_TOLERANCE:
        yield f"{name}: {_factor(slope, _VELOCITY_UNITS, 'the derivative of the position set-points')}"


def _torque_problems(run: Measured, bench: Bench, runs: Sequence[Measured]) -> Iterator[str]:
    names, unit = AXIS_CHANNELS[run.kind], "N" if bench.axis.linear else "N m"
    physics = bench.axis.physics()
    inertia = float(physics.chain.inertia_kg_m2.sum())
    if run.observability.torque_and_command:
        slope = _slope(run.torque_command, run.torque)
        if slope < 0.0 and _correlation(run.torque_command, run.torque) < -0.5:
            yield (
                f"{names.torque} is opposite to {names.torque_command} (slope {slope:.3g}): one of them has the wrong "
                "sign; correct it in the import map"
            )
            return
        # a saturated drive gives less than its command, but not as little as an eighth
        if _correlation(run.torque_command, run.torque) > 0.5 and not 0.5 / WRONG_BY < slope < 2.0 * WRONG_BY:
            yield f"{names.torque}: {_factor(slope, _TORQUE_UNITS, names.torque_command)}"
            return
    measured = regress(run, bench)
    if measured is None:
        return
    j, coulomb = measured["inertia"], measured["coulomb"]
    negative = [name for name in _POSITIVE if measured[name].significant and measured[name].value < 0.0]
    # neither can be negative, and both have the sign of the torque, which is that of all recordings
    others = [one for one in runs if one is not run and len(negative) == 1]
    if negative and not (_right_sign(measured) or any(_right_sign(regress(one, bench)) for one in others)):
        value = measured[negative[0]]
        yield (
            f"{names.torque} has the wrong sign: its regression gives a negative {_POSITIVE[negative[0]]}, "
            f"{value.value:.3g} ± {value.std_error:.1g}; correct the sign of the channel, or of the "
            "encoder"
        )
        return
    told = [(j, inertia), (coulomb, physics.coulomb_n_m)] if physics.coulomb_n_m > 0.0 else [(j, inertia)]
    factors = [one.value / given for one, given in told if one.value > 5.0 * one.std_error]
    # one of them may be wrong in the bench file, or not be told; a wrong unit changes both
    if len(factors) == len(told) and (min(factors) > WRONG_BY or max(factors) < 1.0 / WRONG_BY):
        factor = float(np.exp(np.mean(np.log(factors))))
        units = {} if bench.axis.linear else {1.0 / bench.axis.ratio_m_rad: "N at the table"}
        against = f"the inertia and friction of the bench ({unit})"
        yield f"{names.torque}: {_factor(factor, units | _TORQUE_UNITS, against)}"


def _right_sign(model: PlainModel | None) -> bool:
    return model is not None and any(model[name].significant and model[name].value > 0.0 for name in _POSITIVE)


def regress(run: Measured, bench: Bench) -> PlainModel | None:
    """Fit the plain model to a recording; None without sliding motion.

    It has gravity or a spring where the torque follows the position.
    """
    load_ratio = bench.axis.ratio_m_rad if bench.axis.turns else None
    return fit_plain_model([motion_data(run.motor, run.torque, run.period_s)], load_ratio, spring=True)


def _saturation(run: Measured, bench: Bench, moving: NDArray[np.bool_]) -> Iterator[str]:
    limit = bench.gains.torque_limit_n_m
    peak = float(np.max(np.abs(run.torque_command)))
    level = limit if math.isfinite(limit) and peak <= 1.01 * limit else peak
    share = float(np.mean(np.abs(run.torque_command[moving]) >= 0.999 * level))
    hz = _limit_cycle_hz(run, level)
    if share > SATURATED and hz is not None:
        yield (
            f"limit cycle: the control loop oscillates at {digits(hz)} Hz between the limits of its command, "
            f"{level:.4g} in either direction, in {100.0 * share:.0f} % of the motion, allowed "
            f"{100.0 * SATURATED:.0f} %; usual causes are a gain that is too high and a delay in the loop; lower the "
            "velocity gain or find the delay, then record again"
        )
    elif share > SATURATED:
        yield (
            f"saturated throughout: the command is at its limit of {level:.4g} in {100.0 * share:.0f} % of the "
            f"motion, allowed {100.0 * SATURATED:.0f} %; the control loop is open there; record a slower motion"
        )


def _limit_cycle_hz(run: Measured, level: float) -> float | None:
    """Frequency at which the command swings from one limit to the other; None if the motion itself makes it swing."""
    rows = np.flatnonzero(np.abs(run.torque_command) >= 0.999 * level)
    swings = rows[1:][np.diff(np.sign(run.torque_command[rows])) != 0.0]
    motion = np.sign(run.velocity_command_m_s)
    phases = 1 + np.count_nonzero(np.diff(motion[motion != 0.0]))
    if swings.size < _SWINGS * phases:
        return None
    half = float(np.median(np.diff(swings)))
    # at rest a command may flicker for a while
    return 1.0 / (2.0 * run.period_s * half) if half * swings.size > SATURATED * np.count_nonzero(run.moving) else None


def _slope(over: FloatArray, values: FloatArray) -> float:
    """Slope of a regression of `values` on `over`."""
    centred = over - over.mean()
    return float(centred @ (values - values.mean()) / max(float(centred @ centred), 1e-300))


def _factor_between(over: FloatArray, values: FloatArray) -> float:
    """Factor from `over` to `values`: the value nearest to 1 between the two regressions, of each on the other.

    For a wrong unit both regressions agree; for an axis that lags or sticks on short strokes they differ. With little
    correlation the slope of `values` over `over` is returned.
    """
    forward, backward = _slope(over, values), _slope(values, over)
    if forward * backward < _RELATED:
        return forward
    low, high = sorted((forward, 1.0 / backward))
    return min(max(1.0, low), high)


def _correlation(a: FloatArray, b: FloatArray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


def _factor(factor: float, units: dict[float, str], against: str) -> str:
    """Describe a wrong factor between a channel and its reference `against`, with the unit it suggests."""
    if factor < 0.0 and abs(factor + 1.0) < SLOPE_TOLERANCE:
        return f"has the wrong sign: it is opposite to {against} (slope {factor:.3g}); correct it in the import map"
    sign = "has the wrong sign and " if factor < 0.0 else ""
    size = abs(factor)
    near = min(units, key=lambda unit: abs(math.log(max(size, 1e-300) / unit)))
    looks = f", which suggests {units[near]}" if abs(math.log(max(size, 1e-300) / near)) < math.log(1.6) else ""
    return (
        f"{sign}is {digits(size)} × the value expected from {against}{looks}; correct its unit in the import map, "
        "or the bench file"
    )
