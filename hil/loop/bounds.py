"""Bounds of the supervision of a bench, and the cycle that holds them."""

import math

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode
from hil.channels import AxisKind
from hil.control.cascade import Gains
from hil.loop.columns import Setpoint, Watch
from hil.loop.cycle import Cycle
from hil.loop.devices import Devices, Rig
from hil.loop.limits import Bounds
from hil.loop.stall import acceleration_m_s2
from hil.motion.pieces import MotionLimits

_SETPOINTS = {DriveMode.CST: Setpoint.TORQUE, DriveMode.CSV: Setpoint.VELOCITY, DriveMode.CSP: Setpoint.POSITION}
FROZEN_SHARE = 0.1  # of the encoder difference: backlash and windup of a usable transmission are below
FROZEN_COUNTS = 4.0  # noise of a quantised position is below
SPEED_MARGIN = 1.5  # overshoot of the velocity beyond the limit of the set-points
TORQUE_MARGIN = 1.5  # measured peaks beyond the limit of the command
ACTING_SHARE = 0.3  # of the torque that can act: error of a torque constant, ripple and offset are below
FROZEN_TORQUE_SHARE = 0.5  # of the torque that can act: stiction of a usable axis is below
RUNAWAY_PERIODS = 3.0  # of full torque: one until it acts, one of averaging, one of noise
SIGN_SHARE = 0.25  # of the following error: way of the first motion, unless the loop yields further to a load
SIGN_M = 5e-4  # at most; rad where the axis turns


def make_bounds(rig: Devices, limits: MotionLimits | None) -> Bounds:
    """Bounds of a bench; limits: of the profile, None: those of the bench, none at all: no bound of velocity."""
    section, gains, given = rig.section, rig.bench.gains, rig.section.supervision
    low_m, high_m = section.travel_m or (-math.inf, math.inf)
    allowed = limits or section.limits
    error_m, torque = section.following_error_m, gains.torque_limit_n_m
    velocity_m_s = SPEED_MARGIN * allowed.velocity_m_s + gains.position_gain_1_s * error_m if allowed else math.inf
    difference_m = given.encoder_difference_m or error_m
    table, residual = rig.bench.encoders.table, given.residual
    drive_torque = rig.drive.info.max_torque_n_m if isinstance(rig, Rig) else math.inf
    acting = rig.acting_torque
    count_m = table.resolution_m if table is not None else 0.0
    motor_count_m = rig.bench.motor_count * gains.ratio_m_rad
    return Bounds(
        has_table=rig.encoder is not None,
        commands_torque=section.mode is DriveMode.CST,
        following_error_m=error_m,
        following_error_s=given.following_error_s,
        travel_low_m=low_m,
        travel_high_m=high_m,
        deceleration_m_s2=allowed.acceleration_m_s2 if allowed else math.inf,
        velocity_m_s=given.velocity_m_s or velocity_m_s,
        encoder_difference_m=difference_m,
        frozen_m=given.frozen_m or max(FROZEN_SHARE * difference_m, FROZEN_COUNTS * count_m),
        frozen_torque=given.frozen_torque or FROZEN_TORQUE_SHARE * acting,
        torque=given.torque or TORQUE_MARGIN * torque,
        torque_difference=given.torque_difference or ACTING_SHARE * acting,
        drive_torque=drive_torque,
        continuous_torque=given.continuous_torque or math.inf,
        thermal_time_s=given.thermal_time_s,
        residual_motor_m=residual.motor_m if residual else math.inf,
        residual_table_m=(residual.table_m if residual else None) or math.inf,
        residual_torque=residual.torque if residual else math.inf,
        load_torque=rig.load_torque,
        runaway_m_s=_runaway_m_s(rig.bench, acting),
        position_gain_1_s=gains.position_gain_1_s,
        sign_m=max(
            min(SIGN_SHARE * error_m, SIGN_M),
            FROZEN_COUNTS * max(motor_count_m, count_m),
            _yield_m(gains, rig.load_torque),
        ),
    )


def _yield_m(gains: Gains, load_torque: float) -> float:
    """Way by which the loop yields to a load until its integrator, or its position loop, holds it."""
    by_position = gains.velocity_gain_n_m_s_rad * gains.position_gain_1_s
    stiffness = max(gains.integral_gain_n_m_rad, by_position)
    return load_torque * gains.ratio_m_rad / stiffness if stiffness > 0.0 else math.inf


def _runaway_m_s(bench: Bench, torque: float) -> float:
    """Speed that full torque gives the whole axis in RUNAWAY_PERIODS, and more where the motor alone swings against
    the rest: by 2 tau phi_i^2 / w_i in each mode after a step of the torque."""
    gains, modal = bench.gains, bench.twin().modal
    share = modal.shape[modal.motor] ** 2 / modal.shape[modal.motor, 0] ** 2
    swing_s = float(np.sum(2.0 * share[1:] / modal.frequency_rad_s[1:]))
    noise_m_s = 2.0 * bench.motor_count * gains.ratio_m_rad / gains.period_s  # a count more in one period than before
    return acceleration_m_s2(bench, torque) * (RUNAWAY_PERIODS * gains.period_s + swing_s) + noise_m_s


def make_cycle(rig: Devices, motor_position: float, limits: MotionLimits | None = None) -> Cycle:
    """Controller, twin and checks of a bench, for an axis at rest at this motor position [rad, m]."""
    bench = rig.bench
    kind = AxisKind.LINEAR if bench.axis.linear else AxisKind.ROTARY
    tables = bench.tables()
    watch = Watch(_SETPOINTS[rig.section.mode], make_bounds(rig, limits), bool(tables.tables))
    return Cycle(bench.twin(), kind, watch, motor_position, tables)
