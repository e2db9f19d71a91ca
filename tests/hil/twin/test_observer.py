"""The observer that holds the twin on measured motion is stable at long periods, also with two encoders on one body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.bench.bench_file import load_bench
from hil.twin.axis import Response, Twin
from hil.twin.stepping.loops import LEAST_TICKS


def held(twin: Twin, period_s: float, late_rows: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Error of the motor (n,) of a twin held on its own motion, begun with a wrong position, and the motion."""
    time_s = np.arange(round(8.0 / period_s)) * period_s
    inertia = float(twin.modal.shape[twin.modal.motor, 0] ** -2)
    # friction and a torque that turns the motor there and back, with rests in between
    torque = (twin.physics.coulomb_n_m + inertia) * np.sign(np.sin(2.0 * np.pi * 0.5 * time_s)) * (time_s % 1.0 < 0.6)
    motion = twin.drive(torque)
    table = np.roll(motion.table_position_m, late_rows)
    table[:late_rows] = motion.table_position_m[0]
    off = motion.motor_position + 1e-3
    measured = Response(off, table + 1e-3 * twin.gains.ratio_m_rad, torque, torque)
    found = twin.observe(np.zeros(time_s.size), np.zeros(time_s.size), measured)
    return off - found.motor_position, off


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.01])
@pytest.mark.parametrize("late_rows", [0, 1])
def test_one_body_with_two_encoders_is_held_by_its_motor(period_s: float, late_rows: int) -> None:
    twin = replace(load_bench("rotary").sampled(period_s).twin(), observer_s=LEAST_TICKS * period_s)
    error, motion = held(twin, period_s, late_rows)
    # a second encoder that is late by a row does not pull the motor; the wrong start decays by 3/4 per tick
    assert np.max(np.abs(error[200:])) < 1e-6 * np.ptp(motion)


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.01])
@pytest.mark.parametrize("damping_ratio", [0.03, 0.9])
@pytest.mark.parametrize("viscous", [1.0, 300.0])
def test_two_masses_are_held_at_any_damping_over_period(period_s: float, damping_ratio: float, viscous: float) -> None:
    bench = load_bench("reference")
    physics = bench.axis.model_copy(update={"damping_ratio": damping_ratio}).physics()
    gains = bench.gains._replace(period_s=period_s)
    strong = replace(physics, viscous_n_m_s_rad=viscous * physics.viscous_n_m_s_rad)
    error, motion = held(Twin(strong, gains, observer_s=LEAST_TICKS * period_s), period_s)
    # what is left is friction that sticks at another torque; an unstable observer leaves many times the motion
    assert np.max(np.abs(error[-200:])) < 1e-4 * np.ptp(motion)


@pytest.mark.parametrize("period_s", [0.001, 0.004])
def test_a_torque_that_is_wrong_is_no_error_of_the_table(period_s: float) -> None:
    bench = load_bench("reference")
    physics = bench.axis.physics()
    twin = Twin(physics, bench.gains._replace(period_s=period_s), observer_s=LEAST_TICKS * period_s)
    time_s = np.arange(round(4.0 / period_s)) * period_s
    torque = 4.0 * physics.coulomb_n_m * np.sign(np.sin(2.0 * np.pi * 0.5 * time_s))
    true = twin.drive(torque)
    less = replace(twin, physics=replace(physics, coulomb_n_m=0.5 * physics.coulomb_n_m))
    found = less.observe(np.zeros(time_s.size), np.zeros(time_s.size), Response(*true[:2], torque, torque))
    motor = true.motor_position - found.motor_position
    stretch = true.table_position_m - found.table_position_m - twin.gains.ratio_m_rad * motor
    away, back = (way * np.sin(2.0 * np.pi * 0.5 * time_s) > 0.5 for way in (1.0, -1.0))  # from the reversals
    errors = [float(np.median(motor[rows])) * twin.gains.ratio_m_rad for rows in (away, back)]
    seen = [float(np.median(stretch[rows])) for rows in (away, back)]
    # beside the motor as it is before the observer puts it back, the table would differ by half the motor's error
    assert abs(seen[0] - seen[1]) < 0.1 * abs(errors[0] - errors[1])


@pytest.mark.parametrize("turns", [0.25, 0.7, 1.0, 3.0])
def test_a_mode_that_the_ticks_do_not_show_is_not_excited(turns: float) -> None:
    """A wrong friction moves the motor about as far as on a rigid axis, however often the mode turns per tick."""
    bench, period_s = load_bench("reference"), 0.01
    own = bench.twin().modal.frequency_rad_s[1]
    stiffness = bench.axis.stiffness_n_m * (2.0 * np.pi * turns / period_s / own) ** 2  # type: ignore[union-attr]
    physics = bench.axis.model_copy(update={"stiffness_n_m": stiffness, "damping_ratio": 0.03}).physics()
    twin = Twin(physics, bench.gains._replace(period_s=period_s), observer_s=LEAST_TICKS * period_s)
    time_s = np.arange(400) * period_s
    torque = 3.0 * physics.coulomb_n_m * np.sign(np.sin(2.0 * np.pi * 0.5 * time_s)) * (time_s % 1.0 < 0.6)
    true = twin.drive(torque)
    less = replace(twin, physics=replace(physics, coulomb_n_m=0.8 * physics.coulomb_n_m))
    found = less.observe(np.zeros(time_s.size), np.zeros(time_s.size), Response(*true[:2], torque, torque))
    inertia = float(twin.modal.shape[twin.modal.motor, 0] ** -2)
    rigid = 0.2 * physics.coulomb_n_m * twin.observer_s**2 / inertia
    error = np.abs(true.motor_position - found.motor_position)
    assert np.max(error) < 2.0 * rigid
