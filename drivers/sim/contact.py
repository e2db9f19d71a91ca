"""Contacts of the axis: friction (motor side, table side) and the screw-nut contact.

Records `p` and `s` are laid out in layout.py. Friction is in the motor's unit (N m over rad/s; on a
linear axis N over m/s), nut forces are N.
"""

from math import atan, exp, pi, sin, sqrt
from typing import Any

import numpy as np
from numba import njit

GMS_ELEMENTS = 4
WANDER_RATES = (1.0, 1.618034, 0.414214, 2.718282)


@njit(cache=True)
def friction_law(p: Any, velocity: float, position_m: float, time_s: float) -> tuple[float, float, float, float, float]:
    """Coulomb bound F(v, x, t) >= 0, offset, smooth drag, factor on all three, and on viscous friction, all effects in.

    friction = F sign(v) + offset + drag;  drag = Fv v + quadratic v |v|
    F = [Fc + (Fs - Fc) s(v / vs)] (1 + fraction sin(2 pi x / period + phase))
    and all of them, or Fv alone, times 1 + fraction (1 - exp(-t / tau)). Curves: Armstrong-Helouvry et al. 1994.
    """
    bound = p.coulomb
    drag = p.viscous * velocity
    if p.stribeck_friction.on:
        u = abs(velocity) / p.stribeck_friction.stribeck_velocity_rad_s
        if p.stribeck_friction.form == 0:
            share = exp(-u * u)
        elif p.stribeck_friction.form == 1:
            share = exp(-u)
        else:
            share = 1.0 - 2.0 / pi * atan(u)
        bound += (p.stribeck_friction.static_torque_n_m - bound) * share
    if p.position_dependent_friction.on:
        e = p.position_dependent_friction
        bound *= 1.0 + e.fraction * sin(2.0 * pi * position_m / e.period_m + e.phase_rad)
    if p.friction_gradient.on:
        bound *= max(1.0 + p.friction_gradient.slope_1_m * position_m, 0.0)
    if p.local_friction.on:
        z = p.local_friction
        bound *= 1.0 + z.fraction * ramp((position_m - z.begin_m) / z.flank_m) * ramp(
            (z.end_m - position_m) / z.flank_m
        )
    if p.novel_friction_bump.on:
        b = p.novel_friction_bump
        bound *= 1.0 + b.fraction * bell((position_m - b.centre_m) / b.width_m)
    drag += p.nonlinear_viscous_friction.quadratic_n_m_s2_rad2 * velocity * abs(velocity)
    offset = p.asymmetric_friction.offset_torque_n_m
    scale: float = 1.0
    thinner: float = 1.0
    if p.friction_drift.on:
        change = p.friction_drift.fraction * (1.0 - exp(-time_s / p.friction_drift.time_constant_s))
        if p.friction_drift.form == 1:
            thinner += change
            drag += change * p.viscous * velocity
        else:
            scale += change
    if p.novel_friction_wander.on:
        w = p.novel_friction_wander
        scale *= 1.0 + w.fraction * wander(time_s / w.period_s, w.phase_rad)
    return scale * bound, scale * offset, scale * drag, scale, scale * thinner


@njit(cache=True)
def loaded_bound(p: Any, bound: float, drag: float, scale: float, towards: float, torque: float) -> float:
    """Coulomb bound under a load: bound + scale share |torque - Coulomb friction - drag|, by successive substitution.

    `towards` has the sign of the motion, or of the one that friction prevents.
    """
    way = np.sign(towards)
    level = bound
    for _ in range(60):
        level = bound + scale * p.load_dependent_friction.share * abs(torque - way * level - drag)
    return level


@njit(cache=True)
def ramp(u: float) -> float:
    """0 below -1/2, 1 above 1/2, straight between."""
    return 0.5 * (abs(u + 0.5) - abs(u - 0.5) + 1.0)


@njit(cache=True)
def bell(u: float) -> float:
    """exp(-u^2 / 2)."""
    return exp(-0.5 * u * u)


@njit(cache=True)
def wander(u: float, phase_rad: float) -> float:
    """Four sines of incommensurate periods and unrelated phases, rms 1: between -2.83 and 2.83, not periodic."""
    total: float = 0.0
    for k in range(4):
        total += sin(2.0 * pi * WANDER_RATES[k] * u + (k + 1) * (k + 1) * phase_rad)
    return total / sqrt(2.0)


@njit(cache=True)
def bristle_torque(
    p: Any, bristle: Any, share: float, travel: float, step_s: float, bound: float, offset: float
) -> float:
    """Pre-sliding friction after `travel` more of motor motion within step_s; advances `bristle` (4,).

    Dahl 1968:     dT/dx = sigma (1 - T sign(dx) / F), solved exactly over the step
    LuGre (Canudas de Wit et al. 1995): z' = v - sigma |v| z / F, T = sigma z + sigma1 z' (same z)
    GMS (Al-Bender et al. 2005): parallel elements, each elastic up to its share of F, then slipping
    """
    stiffness = share * p.presliding_hysteresis.stiffness_n_m_rad
    if p.presliding_hysteresis.form == 2:
        total: float = 0.0
        for i in range(GMS_ELEMENTS):
            yields = (i + 1) / 10.0  # 0.1, 0.2, 0.3, 0.4 of F; stiffness 0.4, 0.3, 0.2, 0.1 of sigma
            trial = bristle[i] + (GMS_ELEMENTS - i) / 10.0 * stiffness * travel
            bristle[i] = min(max(trial, yields * (offset - bound)), yields * (offset + bound))
            total += bristle[i]
        return total
    before: float = bristle[0]
    after = before
    if travel != 0.0:
        target = (bound if travel > 0.0 else -bound) + offset
        after = target + (before - target) * exp(-stiffness * abs(travel) / max(bound, 1e-12))
        bristle[0] = after
    if p.presliding_hysteresis.form == 1:
        rate: float = (after - before) / (p.presliding_hysteresis.stiffness_n_m_rad * step_s)
        after += p.bristle_damping * rate
    return after


@njit(cache=True)
def coulomb_impulse(free_impulse: float, step_s: float, bound: float, offset: float) -> float:
    """Impulse of dry friction, opposing positive motion, that brings a body with `free_impulse` (mass times
    velocity without friction) to rest, or as much of it as the friction can give: rest is exact.

    lambda in step (offset + [-F, F]), Moreau's time stepping with the Coulomb law at velocity level.
    """
    low, high = step_s * (offset - bound), step_s * (offset + bound)
    return min(max(free_impulse, low), high)


@njit(cache=True)
def nut_force(p: Any, stiffness: float, stretch: float, rate: float) -> tuple[float, float]:
    """Elastic and damping force [N] of the nut for a stretch [m] and its rate [m/s], beyond the linear spring.

    Beyond the play (+-gap/2) the spring is soft within +-zone/2 and full beyond; its damping goes with its
    local stiffness. A contact with play cannot pull: the damping force is held where it would.
    """
    sign = 1.0 if stretch > 0.0 else -1.0
    pressed = abs(stretch)
    if p.backlash.on:
        pressed -= 0.5 * p.backlash.gap_m
        if pressed <= 0.0:
            return 0.0, 0.0
    local = 1.0
    if p.preload_loss.on:
        zone = 0.5 * p.preload_loss.zone_m
        if pressed < zone:
            local = p.preload_loss.stiffness_ratio
            pressed *= local
        else:
            pressed -= (1.0 - p.preload_loss.stiffness_ratio) * zone
    elastic = sign * stiffness * pressed
    damping = local * p.nut_damping * rate
    if p.backlash.on and sign * (elastic + damping) < 0.0:
        damping = -elastic
    return elastic, damping


@njit(cache=True)
def lead_error(p: Any, coordinate_m: float, time_s: float) -> tuple[float, float]:
    """Error e [m] of the transmission table = r theta + e(theta), and its slope de / d(r theta)."""
    slope, offset = p.cumulative_lead_error.slope_m_m, 0.0
    if p.thermal_growth.on:
        grown = p.thermal_growth.relative_growth * (1.0 - exp(-time_s / p.thermal_growth.time_constant_s))
        slope += grown
        offset = grown * p.thermal_growth.bearing_m
    error = slope * coordinate_m - offset
    if p.periodic_lead_error.on:
        e = p.periodic_lead_error
        angle = coordinate_m / p.screw_ratio
        error += e.amplitude_m * sin(angle + e.phase_rad)
        slope += e.amplitude_m / p.screw_ratio * sin(angle + e.phase_rad + 0.5 * pi)
        if e.amplitude_2_m != 0.0 or e.amplitude_3_m != 0.0:
            second, third = 2.0 * angle + e.phase_2_rad, 3.0 * angle + e.phase_3_rad
            error += e.amplitude_2_m * sin(second) + e.amplitude_3_m * sin(third)
            slope += 2.0 * e.amplitude_2_m / p.screw_ratio * sin(second + 0.5 * pi)
            slope += 3.0 * e.amplitude_3_m / p.screw_ratio * sin(third + 0.5 * pi)
    if p.novel_pitch_bump.on:
        b = p.novel_pitch_bump
        u = (coordinate_m - b.centre_m) / b.width_m
        error += b.height_m * bell(u)
        slope -= b.height_m * bell(u) * u / b.width_m
    return error, slope
