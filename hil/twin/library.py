"""Library of mechanisms: one import and one line of the list each.

The order of the list is the order in which the contributions of one stage are composed.
"""

import inspect
import sys
from pathlib import Path

from hil.compiled.kernel_cache import provide_kernel_cache
from hil.errors import HilError, InputError
from hil.twin.maps import MAPS
from hil.twin.mechanism import Mechanism
from hil.twin.mechanisms import (
    asymmetric_friction,
    backlash,
    channel_time_skew,
    cogging_torque,
    constant_load,
    cumulative_lead_error,
    current_loop_lag,
    encoder_eccentricity,
    end_stop,
    external_force,
    friction_drift,
    friction_gradient,
    gravity_torque,
    load_dependent_friction,
    load_encoder_eccentricity,
    local_friction,
    local_torque_constant,
    nonlinear_viscous_friction,
    periodic_force,
    periodic_lead_error,
    position_dependent_friction,
    position_dependent_stiffness,
    preload_loss,
    presliding_hysteresis,
    scale_interpolation_error,
    spring_load,
    stribeck_friction,
    structural_mode,
    table_side_friction,
    table_side_viscous_friction,
    thermal_growth,
    torque_constant_drift,
    torque_constant_gradient,
    torque_constant_saturation,
    torque_dead_zone,
    torque_ripple,
    torque_saturation,
    transport_delay,
    velocity_filter_lag,
)
from hil.twin.parameter import Role

LIBRARY: tuple[Mechanism, ...] = (
    transport_delay.MECHANISM,
    torque_dead_zone.MECHANISM,
    torque_saturation.MECHANISM,
    current_loop_lag.MECHANISM,
    torque_constant_saturation.MECHANISM,  # K(angle, current) is the product: the ripple does not saturate it
    torque_constant_gradient.MECHANISM,
    torque_constant_drift.MECHANISM,
    local_torque_constant.MECHANISM,
    torque_ripple.MECHANISM,
    cogging_torque.MECHANISM,
    constant_load.MECHANISM,
    asymmetric_friction.MECHANISM,
    stribeck_friction.MECHANISM,
    position_dependent_friction.MECHANISM,
    friction_gradient.MECHANISM,
    local_friction.MECHANISM,
    load_dependent_friction.MECHANISM,
    presliding_hysteresis.MECHANISM,
    friction_drift.MECHANISM,
    nonlinear_viscous_friction.MECHANISM,
    table_side_friction.MECHANISM,
    table_side_viscous_friction.MECHANISM,
    periodic_lead_error.MECHANISM,
    cumulative_lead_error.MECHANISM,
    thermal_growth.MECHANISM,
    preload_loss.MECHANISM,
    position_dependent_stiffness.MECHANISM,
    backlash.MECHANISM,
    external_force.MECHANISM,
    periodic_force.MECHANISM,
    spring_load.MECHANISM,
    end_stop.MECHANISM,
    gravity_torque.MECHANISM,
    encoder_eccentricity.MECHANISM,
    load_encoder_eccentricity.MECHANISM,
    scale_interpolation_error.MECHANISM,
    velocity_filter_lag.MECHANISM,
    structural_mode.MECHANISM,
    channel_time_skew.MECHANISM,
)

# What a bench file may name: the library, and maps for what has no name.
BY_ID: dict[str, Mechanism] = {mechanism.id: mechanism for mechanism in (*LIBRARY, *MAPS)}

# Places in the twin: a mechanism that may act twice at once has two.
SLOTS: tuple[Mechanism, ...] = tuple(mechanism for mechanism in (*LIBRARY, *MAPS) for _ in range(mechanism.most))


def register(mechanism: Mechanism) -> None:
    """Add a mechanism from outside the package at the end of the library, which a diagnosis searches then.

    mechanism: equation, stage, parameters and texts, in a file of its own. Call it before anything else of hil is used:
    kernels are composed and compiled from the library then. Raises HilError afterwards, InputError if the id is
    taken.
    """
    global LIBRARY, SLOTS
    if "hil.twin.stepping.stages" in sys.modules:
        raise HilError(f"{mechanism.id} must be registered before the kernels are built, got it afterwards")
    if mechanism.id in BY_ID:
        raise InputError(f"id must be a new one, got {mechanism.id}")
    LIBRARY = (*LIBRARY, mechanism)
    SLOTS = (*SLOTS, *[mechanism] * mechanism.most)
    BY_ID[mechanism.id] = mechanism
    for contribution in {variant.contribution for variant in mechanism.variants}:
        provide_kernel_cache(Path(inspect.getfile(inspect.unwrap(contribution))))


def names_of(*roles: Role) -> tuple[str, ...]:
    """Names of all parameters in the library that have one of the roles."""
    found = (p.name for mechanism in LIBRARY for p in mechanism.parameters if p.role in roles)
    return tuple(dict.fromkeys(found))
