"""Records of the compiled kernels: parameters of one simulated axis, its state, and delay lines.

Every effect of the catalogue is a nested record named by its id, holding `on`, `form` and its parameters; switched
off it is all zeros. Adding an effect: one entry in effects.CATALOGUE (or NOVEL) and its term in a kernel.
"""

from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.sim.axis import MAX_MASSES
from drivers.sim.contact import GMS_ELEMENTS
from drivers.sim.effects import EFFECTS

SPRING_ROWS = MAX_MASSES
LINES = 2  # delay lines: torque command, recorded channel
COMMAND_LINE, CHANNEL_LINE = 0, 1

# numba's cache of a kernel notices changes of its own file only, not of the files it calls. The checksum of the sources
# in the name of a field changes the type of the records with every edit, so that no old kernel is used.
_KERNELS = ("contact", "drive_path", "kernel", "layout", "reality", "sensors", "servo")
_SOURCES = [Path(__file__).with_name(f"{name}.py") for name in _KERNELS]
_STAMP = f"sources_{crc32(b''.join(path.read_bytes() for path in _SOURCES)):08x}"

_SCALARS = (
    "step_s", "drive_ratio", "screw_ratio", "coulomb", "viscous", "bristle_damping", "nut_stiffness", "nut_damping",
    "motor_resolution", "table_resolution", "motor_offset", "table_offset", "motor_noise", "table_noise",
    "torque_noise", "torque_noise_correlation", "sampling_jitter_s",
)  # fmt: skip
_INDICES = (
    "masses", "springs", "table", "base", "nut_screw", "nut_axial", "nut_table", "has_nut", "screw_springs",
    "full_damping", "varied_friction", "varied_nut", "lead_errors", "drive_path", "angle_torque", "table_force",
)  # fmt: skip

PARAMETERS = np.dtype(
    [(_STAMP, np.int64)]
    + [(name, np.float64) for name in _SCALARS]
    + [(name, np.int64) for name in _INDICES]
    + [
        ("mass", np.float64, (MAX_MASSES,)),
        ("nut_rate", np.float64, (MAX_MASSES,)),  # weights of the velocities in the nut's damper
        ("spring_first", np.int64, (SPRING_ROWS,)),
        ("spring_second", np.int64, (SPRING_ROWS,)),
        ("spring_on_screw", np.int64, (SPRING_ROWS,)),
        ("spring_stiffness", np.float64, (SPRING_ROWS,)),
        ("spring_damping", np.float64, (SPRING_ROWS,)),
        ("damping", np.float64, (MAX_MASSES, MAX_MASSES)),  # without that of the nut and the springs
    ]
    + [
        (effect, np.dtype([("on", np.int64), ("form", np.int64)] + [(p, np.float64) for p in entry.parameters]))
        for effect, entry in EFFECTS.items()
    ],
    align=True,
)

STATE = np.dtype(
    [
        ("tick", np.int64),  # internal steps since the start: time = tick x step
        ("random", np.uint64),
        ("position", np.float64, (MAX_MASSES,)),  # at the tick
        ("velocity", np.float64, (MAX_MASSES,)),  # half a step before it
        ("force", np.float64, (MAX_MASSES,)),
        ("bristle", np.float64, (2, GMS_ELEMENTS)),  # motor side, table side
        ("lag_current", np.float64),
        ("lag_torque", np.float64),
        ("torque", np.float64),  # mean of the last step
        ("torque_noise", np.float64),
        ("motor_seen", np.float64),  # reading of the motor encoder in the control loop
        ("table_seen", np.float64),
        ("motor_recorded", np.float64),
        ("table_recorded", np.float64),
        ("torque_recorded", np.float64),
    ],
    align=True,
)


def one(dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Array of one zeroed record; kernels take it and work on its first item."""
    return np.zeros(1, dtype)


@njit(cache=True)
def push(line: Any, tick: int, value: float) -> None:
    """Store the value of this tick in a ring."""
    line[tick % line.size] = value


@njit(cache=True)
def delayed(line: Any, tick: int, delay_steps: float) -> float:
    """Value `delay_steps` before the tick, linear between ticks."""
    whole = int(delay_steps)
    part = delay_steps - whole
    value: float = (1.0 - part) * line[(tick - whole) % line.size] + part * line[(tick - whole - 1) % line.size]
    return value
