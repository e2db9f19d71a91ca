"""The library of mechanisms: one import and one line of the list each.

The order of the list is the order in which the contributions of one stage are composed.
"""

from __future__ import annotations

from hil.twin.mechanism import Mechanism
from hil.twin.mechanisms import (
    asymmetric_friction,
    backlash,
    cogging_torque,
    constant_load,
    current_loop_lag,
    stribeck_friction,
    torque_constant_saturation,
    torque_dead_zone,
    torque_ripple,
    torque_saturation,
    transport_delay,
)

LIBRARY: tuple[Mechanism, ...] = (
    transport_delay.MECHANISM,
    torque_dead_zone.MECHANISM,
    torque_saturation.MECHANISM,
    current_loop_lag.MECHANISM,
    torque_ripple.MECHANISM,
    torque_constant_saturation.MECHANISM,
    cogging_torque.MECHANISM,
    constant_load.MECHANISM,
    asymmetric_friction.MECHANISM,
    stribeck_friction.MECHANISM,
    backlash.MECHANISM,
)

BY_ID: dict[str, Mechanism] = {mechanism.id: mechanism for mechanism in LIBRARY}
