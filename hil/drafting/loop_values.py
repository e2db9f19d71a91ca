"""Gains of a cascaded control law from set-points, motion and torque command, without a bench.

The fit is that of `hil.identification.law.fit`, from a closed form, at every period of the position loop, with both
velocity estimates, with and without an integrator and delays; the best of these is refined, also with a feed-forward of
the last difference of the position set-points. Each encoder is tried as feedback of the position loop; the velocity
loop has that of the motor.
"""

from dataclasses import replace
from itertools import product
from math import hypot
from typing import NamedTuple

import numpy as np

from hil.channels import SPEED_SET_POINT, AxisKind
from hil.control.cascade import Gains, make_gains
from hil.drafting.bench_value import BenchValue
from hil.identification.law.closed_form import closed_form, find_delays, first_tick
from hil.identification.law.fit import fit_settings
from hil.identification.law.replay import LawRows, Settings
from hil.identification.law.result import REPLAYED, SURE, LawFit, preferred, sure, told_apart
from hil.identification.parallel import one_blas_thread
from hil.identification.sensor_noise import white_noise
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.twin.axis import Response, Start, Twin
from hil.twin.mechanisms import velocity_filter_lag
from hil.twin.physics import Physics
from hil.twin.structure.chain import one_mass

_FILTER = Term(velocity_filter_lag.MECHANISM.id, 0, (2e-3,))  # as drives have it
_FORWARD = 0.01  # feed-forward below which its velocity is not told
_LEAST_FILTER = 1.0  # time constant over the period: a shorter one is not told from a delay of a part of a row
_TICKS = (1, 2, 4, 8)  # of the velocity loop per tick of the position loop, as drives have them
_LONGEST_S = 0.1  # period of a position loop that a bench allows
_FIRST_STEPS, _LAST_STEPS = 8, 40  # of the refinement of each variant, and of the best
_NEAR = 3  # variants without delays, the best ones, that are also fitted with delays of a part of a row
_ROWS = 8000  # that are replayed: seconds of motion at a usual rate
_SETTLED = 10  # rows after which the first difference of the position is forgotten
_NOISE = 1e-4  # of the command: a scale of the residuals, of no influence on the values


class ControlValues(NamedTuple):
    """Keys of the control section; without a law that fits, no keys and the reason.

    `close`: the law stands for that of a measured torque and leaves more than its noise.
    """

    values: list[BenchValue]
    why: str = ""
    close: bool = False


class LoopFit(NamedTuple):
    """The control law of a recording, and the best one with the other encoder as feedback of the position loop."""

    law: LawFit
    other: LawFit | None = None


def loop_values(recording: Recording, ratio_m_rad: float) -> ControlValues:
    """Draft the control section of a bench from a recording; `ratio_m_rad`: travel over motor angle."""
    names, found, period_s = recording.axis, fit_loops(recording, ratio_m_rad), recording.period_s
    if found is None:
        return ControlValues([], "no set-points are recorded, or no gains reproduce the torque command")
    loop = found.law
    torque, command = (recording.columns.get(name) for name in (names.torque, names.torque_command))
    measured = command is None or (torque is not None and np.array_equal(command, torque))
    if loop.left > REPLAYED:
        stands_for_it = "; its command is not recorded, the measured torque stands for it" if measured else ""
        return ControlValues([], f"the best cascaded law leaves {_left(loop)}{stands_for_it}")
    late_rows, error_rows = loop.settings.feedback_rows, loop.errors.feedback_rows
    if sure(late_rows, error_rows):
        return ControlValues(
            [],
            f"the cascaded law leaves {_left(loop)} with positions that are {1e3 * period_s * late_rows:.3g} ms old, "
            f"+-{1e3 * period_s * error_rows:.1g}; a delay of the loop is not simulated; if the drive filters its "
            "velocity instead, give its gains and velocity_filter_time_constant_s",
        )
    feedback = [_feedback(found)] if _has_two(recording) else []
    close = measured and torque is not None and loop.left_of_command * np.std(torque) > SURE * white_noise(torque)
    return ControlValues([*feedback, *_bench_values(loop, recording.kind, period_s)], close=bool(close))


def _has_two(recording: Recording) -> bool:
    """True if a second encoder is recorded that a bench file takes."""
    return recording.kind is AxisKind.ROTARY and recording.axis.table_position in recording.columns


def _feedback(found: LoopFit) -> BenchValue:
    """Encoder of the position loop, and what the law leaves with the other one."""
    from_table = found.law.gains.position_from_table
    encoder, other = ("table", "the motor's encoder") if from_table else ("motor", "the second encoder")
    if found.other is None:
        told, how = "told", f"with {other} no gains are found"
    elif told_apart(found.law, found.other):
        told, how = "told", f"with {other} the law leaves {_left(found.other)}"
    else:
        told, how = "not told, assumed", f"with {other} the law leaves as little, {_left(found.other)}"
    return BenchValue("position_feedback", encoder, told, how)


def _bench_values(loop: LawFit, kind: AxisKind, period_s: float) -> list[BenchValue]:
    gains, delays, errors = loop.gains, loop.settings, loop.errors
    position, velocity, integral = gains.position_gain_1_s, gains.velocity_gain_n_m_s_rad, gains.integral_gain_n_m_rad
    linear = kind is AxisKind.LINEAR
    key, unit = ("velocity_gain_n_s_m", "N s/m") if linear else ("velocity_gain_n_m_s_rad", "N m s/rad")
    how = f"the replayed law leaves {_left(loop)}"
    best = f"of 1, 2, 4 and 8 rows {gains.position_ticks} fits best"
    values = [
        BenchValue("position_gain_1_s", position, f"1/s, +-{position * errors.position_gain:.2g}", how),
        BenchValue("velocity_feedforward", gains.velocity_feedforward, f"1 is 100 %, +-{errors.feedforward:.2g}"),
        BenchValue("position_period_s", float(f"{gains.position_ticks * period_s:.9g}"), "s", best),
        BenchValue(key, velocity, f"{unit}, +-{velocity * errors.velocity_gain:.2g}"),
    ]
    if integral > 0.0:
        time_s = velocity / integral
        error_s = time_s * hypot(errors.velocity_gain, errors.integral_gain)
        values.append(BenchValue("velocity_integral_time_s", time_s, f"s, +-{error_s:.2g}"))
    if sure(delays.setpoint_rows, 0.0):
        error = f"s, +-{period_s * errors.setpoint_rows:.2g}"
        values.append(BenchValue("setpoint_delay_s", period_s * delays.setpoint_rows, error))
    if loop.terms:
        (time_s,), how = loop.terms[0].values, "better than without a filter, and than a delay"
        values.append(BenchValue("velocity_filter_time_constant_s", time_s, "s", how))
    if delays.differenced:
        how = "of the position set-points, better than as recorded"
        values.append(BenchValue("velocity_setpoint", "backward_difference", "", how))
    estimate = "two_sample_mean" if gains.two_sample_mean else "backward_difference"
    return [
        *values,
        BenchValue("velocity_period_s", float(f"{period_s:.9g}"), "s", "the period of the recording"),
        BenchValue("velocity_estimate", estimate, "", "the better of the two"),
    ]


def _left(loop: LawFit) -> str:
    of_speed = f", {100 * loop.left_of_speed:.2g} % in the speed set-point" if loop.left_of_speed else ""
    return f"{100 * loop.left_of_command:.2g} % of the torque command{of_speed}"


@one_blas_thread
def fit_loops(recording: Recording, ratio_m_rad: float) -> LoopFit | None:
    """Fit the control law; None without set-points or torque, or where no gains are found.

    Of two encoders that of the motor closes the position loop unless the second one leaves clearly less. Where the
    speed set-point is recorded, each loop is fitted to its own output; if these do not reproduce it, or if it
    is not recorded, the chain of both loops is.
    """
    names = recording.axis
    torque = names.torque_command if names.torque_command in recording.columns else names.torque
    if not {names.position_command, names.motor_position, torque} <= set(recording.columns):
        return None
    position = recording[names.position_command]
    velocity = recording.columns.get(names.velocity_command)
    velocity = np.gradient(position, recording.period_s) if velocity is None else velocity
    speed = np.asarray(recording.columns.get(SPEED_SET_POINT, np.empty(0)))
    moving = np.flatnonzero(np.abs(velocity) > 1e-3 * np.max(np.abs(velocity), initial=0.0))
    if not moving.size:
        return None
    rows = slice(max(int(moving[0]) - 50, 0), max(int(moving[0]) - 50, 0) + _ROWS)
    motor, command = recording[names.motor_position][rows], recording[torque][rows]
    table = recording[names.table_position][rows] if _has_two(recording) else np.empty(0)
    law = LawRows(
        position[rows],
        velocity[rows],
        Response(motor, table, command, command),
        np.empty(0),
        Start(float(ratio_m_rad * motor[0]), float(ratio_m_rad * (motor[1] - motor[0])) / recording.period_s),
        _SETTLED,
        _NOISE * max(float(np.std(command)), 1e-300),
    )
    if np.any(speed):
        found = _of_encoders(replace(law, speed_set_point=speed[rows]), ratio_m_rad, recording.period_s)
        if found is not None and found.law.left <= REPLAYED:
            return found
    return _of_encoders(law, ratio_m_rad, recording.period_s)


def _of_encoders(rows: LawRows, ratio_m_rad: float, period_s: float) -> LoopFit | None:
    """The law with the encoder of the position loop that leaves clearly less, else with that of the motor."""
    gains = make_gains(
        position_gain_1_s=1.0,
        velocity_gain_n_m_s_rad=1.0,
        ratio_m_rad=ratio_m_rad,
        velocity_period_s=period_s,
        position_period_s=period_s,
    )
    of_motor = _best(rows, gains)
    of_table = _best(rows, gains._replace(position_from_table=True)) if rows.measured.table_position_m.size else None
    if of_motor is None or of_table is None:
        law = of_motor or of_table
        return LoopFit(law) if law else None
    if preferred([of_motor, of_table]) is of_table and told_apart(of_table, of_motor):
        return LoopFit(of_table, of_motor)
    return LoopFit(of_motor, of_table)


def _best(rows: LawRows, given: Gains) -> LawFit | None:
    """The variant of the law with the best criterion, with and without delays, for the encoder of `given`."""
    twin, period_s = Twin(Physics(one_mass(1.0), 0.0, 0.0), given), given.period_s
    tried = list[tuple[Settings, int, LawFit]]()

    def attempt(start: Settings, free: int) -> None:
        base = closed_form([rows], start, [first_tick(rows, start)])
        if base is not None:  # the start is too far off to tell which variant is right
            fit = fit_settings([rows], base, twin, delays=free, start=base, most=_FIRST_STEPS)
            tried.append((start, free, fit))

    for ticks in _TICKS:
        if ticks * period_s > _LONGEST_S:
            continue
        gains = given._replace(position_ticks=ticks)
        delays = find_delays(rows, Settings(gains._replace(integral_gain_n_m_rad=1.0)))
        for mean, integral in product((True, False), (1.0, 0.0)):  # a mean is old by half a row: the fit resolves it
            start = Settings(gains._replace(two_sample_mean=mean, integral_gain_n_m_rad=integral))
            attempt(start, 0)
            attempt(start._replace(setpoint_rows=delays[0], feedback_rows=delays[1]), 2)
    # a coarse search finds no delays of a part of a row: the fit resolves them, from none
    near = sorted((one for one in tried if one[1] == 0), key=lambda one: one[2].cost)[:_NEAR]
    for (start, _, _), free in product(near, (1, 2)):
        attempt(start, free)
    if not tried:
        return None
    best = preferred([fit for *_, fit in tried])
    free = next(free for _, free, fit in tried if fit is best)
    return _refined(rows, best.settings, free, twin)


def _refined(rows: LawRows, at: Settings, delays: int, twin: Twin) -> LawFit:
    """The best of the law as found, with a feed-forward of the last difference, and with a filter of the velocity.

    A filter looks like old positions, another feed-forward like other gains.
    """
    fits = [fit_settings([rows], at, twin, delays=delays, start=at, most=_LAST_STEPS)]
    for differenced, mean, filtered in product((False, True), (False, True), (False, True)):
        if not (differenced or filtered) or (differenced and at.gains.velocity_feedforward < _FORWARD):
            continue
        start = at._replace(
            gains=at.gains._replace(two_sample_mean=mean),
            setpoint_rows=0.0 if differenced else at.setpoint_rows,
            feedback_rows=0.0,
            differenced=differenced,
        )
        if differenced:
            start = closed_form([rows], start, [first_tick(rows, start)]) or start
        fits += [
            fit_settings([rows], start, twin, [_FILTER] if filtered else [], delays=some, start=start, most=_LAST_STEPS)
            for some in {0, min(delays, 1)}
        ]
    least_s = _LEAST_FILTER * at.gains.period_s
    return preferred([one for one in fits if not one.terms or one.terms[0].values[0] > least_s] or fits[:1])
