"""Time stepping of the simulated axis in natural coordinates; compiled, no allocation.

Leapfrog with friction as an impulse (Moreau's time stepping, diagonal M): positions at t_k, velocities at t_k-1/2,

    M (v_k+1/2 - v_k-1/2) = h f(q_k, v_k-1/2) - friction impulse,     q_k+1 = q_k + h v_k+1/2

second order in h for springs and torque, exact rest in stiction. A torque that changes at t_k acts with its mean there.
"""

from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
from numba import njit

from drivers.sim.contact import bristle_torque, coulomb_impulse, friction_law, lead_error, loaded_bound, nut_force
from drivers.sim.drive_path import angle_torque, drive_torque
from drivers.sim.layout import CHANNEL_LINE, delayed, push
from drivers.sim.sensors import motor_truth, normal, sample, table_truth

MOTOR_SIDE, TABLE_SIDE = 0, 1


@njit(cache=True)
def nut(p: Any, s: Any, time_s: float) -> None:
    """Add the forces of the screw-nut contact: by virtual work on screw (and its axial motion) and table side."""
    q, v, force = s.position, s.velocity, s.force
    screw = p.nut_screw
    error = slope = 0.0
    if p.lead_errors:
        error, slope = lead_error(p, q[screw], time_s)
    stretch = q[screw] + error - q[p.nut_table]
    if p.nut_axial >= 0:
        stretch += q[p.nut_axial]
    rate = slope * v[screw]
    for i in range(p.masses):
        rate += p.nut_rate[i] * v[i]
    if p.varied_nut:
        stiffness = p.nut_stiffness
        if p.screw_springs == 0:
            stiffness *= 1.0 + p.position_dependent_stiffness.relative_slope * q[p.table]
        elastic, damping = nut_force(p, stiffness, stretch, rate)
    else:
        elastic, damping = p.nut_stiffness * stretch, p.nut_damping * rate
    force[screw] -= elastic * (1.0 + slope) + damping * slope
    force[p.nut_table] += elastic
    if p.nut_axial >= 0:
        force[p.nut_axial] -= elastic
    for i in range(p.masses):
        force[i] -= damping * p.nut_rate[i]


@njit(cache=True)
def springs(p: Any, s: Any) -> None:
    """Add the forces of the linear springs and of the damping matrix."""
    q, v, force = s.position, s.velocity, s.force
    for i in range(p.springs):
        a, b = p.spring_first[i], p.spring_second[i]
        stretch, rate = q[a], v[a]
        if b >= 0:
            stretch, rate = stretch - q[b], rate - v[b]
        stiffness = p.spring_stiffness[i]
        if p.spring_on_screw[i]:
            stiffness *= 1.0 + p.position_dependent_stiffness.relative_slope * q[p.table]
        f = stiffness * stretch + p.spring_damping[i] * rate
        force[a] -= f
        if b >= 0:
            force[b] += f
    if p.full_damping:
        for i in range(p.masses):
            for j in range(p.masses):
                force[i] -= p.damping[i, j] * v[j]


@njit(cache=True)
def table_force(p: Any, position_m: float, time_s: float) -> float:
    """Force [N] on the table from outside: push in a window, spring, stop, gravity of an arm, vibration, hammering."""
    force: float = -p.spring_load.stiffness_n_m * (position_m - p.spring_load.rest_position_m)
    e = p.external_force
    if e.start_s <= time_s < e.end_s:
        force += e.force_n
    if p.periodic_force.on:
        turns = p.periodic_force.frequency_hz * time_s + p.periodic_force.phase_rad / (2.0 * pi)
        force += p.periodic_force.force_n * cos(2.0 * pi * (turns - np.floor(turns) - 0.25))
    if p.end_stop.on:
        side = 1.0 - 2.0 * p.end_stop.form
        pressed = side * (position_m - p.end_stop.edge_m)
        force -= 0.5 * side * p.end_stop.stiffness_n_m * (pressed + abs(pressed))
    if p.gravity_torque.on:
        weight = p.gravity_torque
        force += weight.gravity_torque_n_m * sin(-position_m - weight.angle_rad)
    if p.novel_vibration.on:
        u = p.novel_vibration
        first, second = 2.0 * pi * u.frequency_hz * time_s + u.phase_rad, 2.0 * pi * u.frequency_2_hz * time_s
        force += u.force_n * (sin(first) + u.ratio * sin(second))
    if p.novel_hammering.on:
        b = p.novel_hammering
        if time_s >= b.start_s and (time_s - b.start_s) % b.period_s < b.width_s:
            force += b.force_n
    return force


@njit(cache=True)
def moving_mass(p: Any, index: int, time_s: float) -> float:
    """Mass [kg] of a body of the chain at this time."""
    mass: float = p.mass[index]
    if p.novel_mass_change.on and index == p.table and time_s >= p.novel_mass_change.start_s:
        mass *= 1.0 + p.novel_mass_change.fraction
    return mass


@njit(cache=True)
def kick(p: Any, s: Any, index: int, side: int, share: float, viscous: float, time_s: float) -> None:
    """New velocity of a mass under its force, its share of the friction and its viscous friction."""
    h, ratio, mass = p.step_s, p.drive_ratio, moving_mass(p, index, time_s)
    speed = s.velocity[index] / ratio
    if p.varied_friction:
        bound, offset, drag, scale, thinner = friction_law(p, speed, s.position[index], time_s)
        if p.load_dependent_friction.on:
            towards = mass * s.velocity[index] + h * (s.force[index] - drag / ratio)
            bound = loaded_bound(p, bound, drag, scale, towards, s.torque)
        bound, offset = share * bound, share * offset
        drag = share * drag + thinner * (viscous - share * p.viscous) * speed
    else:
        bound, offset, drag = share * p.coulomb, 0.0, viscous * speed
    force = s.force[index] - drag / ratio
    if p.presliding_hysteresis.on:
        force -= bristle_torque(p, s.bristle[side], share, h * speed, h, bound, offset) / ratio
        s.velocity[index] += h / mass * force
    else:
        free = mass * s.velocity[index] + h * force
        s.velocity[index] = (free - coulomb_impulse(free, h, bound / ratio, offset / ratio)) / mass


@njit(cache=True)
def advance(p: Any, s: Any, lines: Any, command: float, steps: int) -> None:
    """Hold the torque command for `steps` internal steps; then measure."""
    h = p.step_s
    q, v, force = s.position, s.velocity, s.force
    skew = p.channel_time_skew
    motor_share = 1.0 - p.table_side_friction.share
    moved = p.table_side_viscous_friction.share
    motor_viscous = motor_share * (1.0 - moved) if moved >= 0.0 else 1.0 - (1.0 - motor_share) * (1.0 + moved)
    guided = min(motor_share, motor_viscous) < 1.0
    measured = 0.0
    for _ in range(steps):
        time_s = s.tick * h
        current = torque = command
        if p.drive_path:
            current, torque = drive_torque(p, s, lines, command)
        if skew.on and skew.form == 2:
            push(lines[CHANNEL_LINE], s.tick, current)
            current = delayed(lines[CHANNEL_LINE], s.tick, skew.delay_s / h)
        measured += current
        acting = 0.5 * (s.torque + torque)
        s.torque = torque
        if p.angle_torque:
            acting = angle_torque(p, acting, q[0] / p.screw_ratio, q[0], time_s)
        for i in range(p.masses):
            force[i] = 0.0
        force[0] = (acting - p.constant_load.load_torque_n_m) / p.drive_ratio
        if p.springs or p.full_damping:
            springs(p, s)
        if p.has_nut:
            nut(p, s, time_s)
        if p.table_force:
            force[p.table] += table_force(p, q[p.table], time_s)
        kick(p, s, 0, MOTOR_SIDE, motor_share, motor_viscous * p.viscous, time_s)
        last = p.masses
        for i in range(1, last):
            if i == p.table and guided:
                kick(p, s, i, TABLE_SIDE, 1.0 - motor_share, (1.0 - motor_viscous) * p.viscous, time_s)
            else:
                v[i] += h / moving_mass(p, i, time_s) * force[i]
        for i in range(last):
            q[i] += h * v[i]
        s.tick += 1
        if skew.on and skew.form < 2:
            push(lines[CHANNEL_LINE], s.tick, table_truth(p, s) if skew.form == 0 else motor_truth(p, s))
    if p.torque_noise > 0.0:
        rho = p.torque_noise_correlation
        s.torque_noise = rho * s.torque_noise + sqrt(1.0 - rho * rho) * p.torque_noise * normal(s)
    s.torque_recorded = measured / steps + s.torque_noise
    sample(p, s, lines)


@njit(cache=True)
def begin(p: np.ndarray, s: np.ndarray, lines: np.ndarray) -> None:
    """Fill the delay line of a late position channel with its reading at the start, and sample."""
    if p[0].channel_time_skew.form == 0:
        lines[CHANNEL_LINE, :] = table_truth(p[0], s[0])
    elif p[0].channel_time_skew.form == 1:
        lines[CHANNEL_LINE, :] = motor_truth(p[0], s[0])
    sample(p[0], s[0], lines)


@njit(cache=True)
def advance_period(
    p: np.ndarray, s: np.ndarray, lines: np.ndarray, command: float, steps: int
) -> tuple[float, float, float]:
    """advance() on arrays of one record each; returns the recorded motor position, table position and torque."""
    advance(p[0], s[0], lines, command, steps)
    return s[0].motor_recorded, s[0].table_recorded, s[0].torque_recorded
