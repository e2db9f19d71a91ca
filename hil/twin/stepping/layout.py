"""Where what stands in the arrays that the compiled kernels share.

`modes` (COUPLING + n, n), `constants` (CONSTANTS,), `codes` (CODES,) and `memory` (slots + 1, WIDTH) are packed by
`hil.twin.stepping.packing`; beside them go `values` (slots, PARAMETERS), those of the mechanisms.
"""

from __future__ import annotations

from hil.twin.library import SLOTS

# Rows of `modes` (COUPLING + n, n): exact discretisation for the coarse and the fine step, shapes, then the damping
# that modes share.
(
    COARSE,
    FINE,
    SHAPE_MOTOR,
    SHAPE_TABLE,
    SHAPE_SPRING,
    SHAPE_SCREW,
    SHAPE_DAMPER,
    TABLE_SIDE,
    TABLE_IMPULSE,
    MOTOR_IMPULSE,
    COUPLING,
) = (0, 6, *range(12, 21))

# Entries of `constants`.
(
    PERIOD,
    RATIO,
    ANGLE_PER_UNIT,
    COULOMB,
    VISCOUS,
    SPRING,
    DAMPER,
    COARSE_STEPS,
    FINE_STEPS,
    SLOW_VELOCITY,
    ALWAYS_FINE,
    OBSERVER,
    PLAY,
    SLIPS,
    VISCOUS_SPEED,
    SCREW,
    SCREW_APART,
    COARSE_GAINS,
    FINE_GAINS,
    CONSTANTS,
) = (*range(18), 20, 23)

# Entries of `codes`: variant + 1 of the mechanism in each slot (0: off), then whether each stage is entered.
(
    ON_CURRENT,
    ON_TORQUE,
    ON_MOTOR_TORQUE,
    ON_COULOMB,
    ON_FRICTION_SCALE,
    ON_DRAG,
    ON_BIAS,
    ON_BRISTLE,
    ON_TABLE_SHARE,
    ON_TRANSMISSION,
    ON_SCREW,
    ON_TABLE_FORCE,
    ON_MOTOR_READING,
    ON_TABLE_READING,
    ON_ANY,
    ON_COUPLING,
    CODES,
) = range(len(SLOTS), len(SLOTS) + 17)

# Rows of `memory` (slots + 1, WIDTH): each mechanism's own, then the kernel's.
OWN = len(SLOTS)
CLOCK, BRISTLE_DEFLECTION, SPRING_EXTRA, FLOATING, LAST_SPEED, SLIP_ELEMENTS = range(6)
