"""Pack axis, sensors and effects into the parameter record of the kernels."""

from collections.abc import Mapping
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.sim.axis import GROUND, AxisTruth, Spring
from drivers.sim.effects import Effect
from drivers.sim.layout import PARAMETERS, one
from drivers.sim.sensors import Sensors

NEED_TABLE = (
    "backlash", "preload_loss", "position_dependent_stiffness", "periodic_lead_error", "cumulative_lead_error",
    "thermal_growth", "table_side_friction", "table_side_viscous_friction", "scale_interpolation_error",
    "load_encoder_eccentricity", "novel_pitch_bump",
)  # fmt: skip
GROUPS = {
    "varied_friction": (
        "asymmetric_friction", "stribeck_friction", "position_dependent_friction", "nonlinear_viscous_friction",
        "friction_drift", "friction_gradient", "load_dependent_friction", "local_friction",
        "novel_friction_bump", "novel_friction_wander",
    ),
    "varied_nut": ("backlash", "preload_loss", "position_dependent_stiffness"),
    "lead_errors": ("periodic_lead_error", "cumulative_lead_error", "thermal_growth", "novel_pitch_bump"),
    "drive_path": ("torque_saturation", "torque_dead_zone", "current_loop_lag", "transport_delay"),
    "angle_torque": (
        "torque_ripple", "torque_constant_drift", "torque_constant_gradient", "torque_constant_saturation",
        "local_torque_constant", "cogging_torque",
    ),
    "table_force": (
        "external_force", "periodic_force", "spring_load", "end_stop", "gravity_torque", "novel_vibration",
        "novel_hammering",
    ),
}  # fmt: skip
LARGEST_PHASE_STEP = 1.5  # omega h; leapfrog is stable below 2, less with damping


class StepTooLong(ValueError):
    """The internal step is too long for the fastest mode of an axis with its effects."""


def pack(axis: AxisTruth, sensors: Sensors, effects: Mapping[str, Effect], step_s: float) -> NDArray[np.void]:
    """Return an array of one PARAMETERS record.

    Raises ValueError for an effect that the axis cannot have or a step that is too long.
    """
    _check_effects(axis, effects)
    packed = one(PARAMETERS)
    p: Any = packed[0]
    p["step_s"] = step_s
    p["drive_ratio"], p["screw_ratio"] = axis.drive_ratio_m_rad, axis.screw_ratio_m_rad
    p["coulomb"], p["viscous"] = axis.coulomb_torque_n_m, axis.viscous_torque_n_m_s_rad
    for effect in effects.values():
        record = p[effect.id]
        record["on"], record["form"] = 1, effect.form_index
        for name, value in effect.parameters.items():
            record[name] = value
    for group, members in GROUPS.items():
        p[group] = int(any(member in effects for member in members))
    _pack_chain(p, axis, effects.get("structural_mode"))
    _pack_sensors(p, axis, sensors)
    bristle_stiffness = _pack_bristles(p, axis, effects.get("presliding_hysteresis"))
    _check_step(p, step_s, bristle_stiffness)
    return packed


def _check_effects(axis: AxisTruth, effects: Mapping[str, Effect]) -> None:
    if axis.nut is None:
        for name in NEED_TABLE:
            if name in effects:
                raise ValueError(f"effect {name}: needs an axis with a table behind a nut, got one mass")
        skew = effects.get("channel_time_skew")
        if skew is not None and skew.form_index == 0:
            raise ValueError(
                "effect channel_time_skew: one mass has no table encoder; allowed forms: motor_position, torque"
            )
    offset = effects.get("asymmetric_friction")
    if offset is not None and abs(offset.parameters["offset_torque_n_m"]) > axis.coulomb_torque_n_m:
        raise ValueError(
            f"effect asymmetric_friction: |offset_torque_n_m| must be <= the Coulomb friction "
            f"{axis.coulomb_torque_n_m:g} (beyond it friction would drive the axis), "
            f"got {offset.parameters['offset_torque_n_m']:g}"
        )


def _pack_chain(p: Any, axis: AxisTruth, mode: Effect | None) -> None:
    count = len(axis.mass_kg)
    masses = list(axis.mass_kg)
    links = list(axis.springs)
    p["table"], p["base"] = count - 1, GROUND
    p["nut_axial"] = GROUND
    rest, rate, coefficient = _split_damping(axis)
    if axis.nut is not None:
        nut = axis.nut
        p["has_nut"], p["nut_stiffness"], p["nut_damping"] = 1, nut.stiffness_n_m, coefficient
        p["nut_screw"], p["nut_table"], p["nut_axial"] = nut.screw, nut.table_side, nut.axial
    if mode is not None:
        # an extra mass m on a spring k to the table (attached) or to the ground, under the screw bearings (base)
        extra = mode.parameters["mass_ratio"] * axis.mass_kg[-1]
        omega = 2 * pi * mode.parameters["frequency_hz"]
        masses.append(extra)
        stiffness, damping = extra * omega**2, 2 * mode.parameters["damping_ratio"] * omega * extra
        if mode.form_index == 0:
            links.append(Spring(stiffness, count, count - 1, damping_n_s_m=damping))
        else:
            p["base"] = count
            links = [Spring(k.stiffness_n_m, k.first, count, k.on_screw) if k.second == GROUND else k for k in links]
            links.append(Spring(stiffness, count, damping_n_s_m=damping))
            if axis.nut is not None and axis.nut.axial == GROUND:
                p["nut_axial"], rate[count] = count, 1.0
    p["masses"], p["springs"] = len(masses), len(links)
    p["mass"][: len(masses)] = masses
    for i, link in enumerate(links):
        p["spring_first"][i], p["spring_second"][i] = link.first, link.second
        p["spring_stiffness"][i], p["spring_damping"][i] = link.stiffness_n_m, link.damping_n_s_m
        p["spring_on_screw"][i] = link.on_screw and p["position_dependent_stiffness"]["on"]
    p["screw_springs"] = sum(link.on_screw for link in links)
    p["damping"][:count, :count] = rest
    p["full_damping"] = int(np.any(rest != 0.0))
    p["nut_rate"][:] = rate


def _split_damping(axis: AxisTruth) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """C = C_rest + c w w^T with C_rest s = 0, s the motor side of the nut moving as one (1 there, 0 behind).

    c = s^T C s, w = C s / c: the damper of the nut, which is zero within the play; C_rest acts always, without force
    on the relative motion of the two sides. For two masses C_rest = 0.
    """
    count = len(axis.mass_kg)
    rate = np.zeros(PARAMETERS["nut_rate"].shape[0])
    mass, damping, _ = axis.matrices()
    ground = axis.mass_damping_1_s * mass if axis.damping_ratio is None else np.zeros_like(mass)
    damping = damping - ground
    coefficient = 0.0
    if axis.nut is not None:
        side = np.zeros(count)
        side[axis.nut.screw] = 1.0
        for _ in range(count):
            for link in axis.springs:
                if link.second != GROUND:
                    side[[link.first, link.second]] = max(side[link.first], side[link.second])
        pull = damping @ side
        coefficient = float(side @ pull)
        if coefficient > 0:
            rate[:count] = pull / coefficient
            damping = damping - np.outer(pull, pull) / coefficient
    rest = damping + ground
    rest[np.abs(rest) < 1e-12 * max(coefficient, 1e-300)] = 0.0
    return rest, rate, coefficient


def _pack_sensors(p: Any, axis: AxisTruth, sensors: Sensors) -> None:
    revolution = axis.lead_m if axis.linear else 2 * pi
    p["motor_resolution"] = revolution / sensors.motor_counts_per_rev if sensors.motor_counts_per_rev else 0.0
    p["table_resolution"] = sensors.table_resolution_m
    p["motor_offset"], p["table_offset"] = sensors.motor_offset_rad, sensors.table_offset_m
    p["motor_noise"], p["table_noise"] = sensors.motor_noise_rad, sensors.table_noise_m
    p["torque_noise"], p["torque_noise_correlation"] = sensors.torque_noise_n_m, sensors.torque_noise_correlation
    p["sampling_jitter_s"] = sensors.sampling_jitter_s


def _pack_bristles(p: Any, axis: AxisTruth, effect: Effect | None) -> float:
    """Set the bristle damping of LuGre; return the bristle stiffness [N/m] as translation at the table."""
    if effect is None:
        return 0.0
    stiffness, given = effect.parameters["stiffness_n_m_rad"], effect.parameters["damping_n_m_s_rad"]
    inertia = axis.mass_kg[0] * axis.drive_ratio_m_rad**2
    p["bristle_damping"] = given if given >= 0.0 else sqrt(stiffness * inertia)
    return stiffness / axis.drive_ratio_m_rad**2


def _check_step(p: Any, step_s: float, bristle_stiffness: float) -> None:
    """Raise StepTooLong if the phase of the fastest mode advances by more than LARGEST_PHASE_STEP [rad] per step."""
    count = int(p["masses"])
    stiffness = np.zeros((count, count))
    stiffness[0, 0] = bristle_stiffness
    ends = [
        (int(p["spring_first"][i]), int(p["spring_second"][i]), float(p["spring_stiffness"][i]))
        for i in range(int(p["springs"]))
    ]
    rows = [({a: 1.0, b: -1.0}, k) for a, b, k in ends]
    if p["has_nut"]:
        rows.append(({int(p["nut_screw"]): 1.0, int(p["nut_axial"]): 1.0, int(p["nut_table"]): -1.0},
                     float(p["nut_stiffness"])))  # fmt: skip
    for row, k in rows:
        vector = np.array([row.get(i, 0.0) for i in range(count)])
        stiffness += k * np.outer(vector, vector)
    root = np.sqrt(p["mass"][:count])
    fastest = sqrt(max(float(np.linalg.eigvalsh(stiffness / np.outer(root, root))[-1]), 0.0))
    if fastest * step_s > LARGEST_PHASE_STEP:
        raise StepTooLong(
            f"step_s: must be <= {LARGEST_PHASE_STEP / fastest:.3g} s for the fastest mode of this axis "
            f"({fastest / (2 * pi):.4g} Hz), got {step_s!r}"
        )
