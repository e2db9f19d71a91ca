"""Take one rate of a file with several: that of motion and effort; slower columns beside them are left out."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.importing.roles import Roles
from hil.importing.slow_columns import rows_per_value

_SAME = 0.95  # share of the rows of motion and effort in which another column has a value


def use_one_rate(path: Path, columns: Mapping[str, FloatArray], roles: Roles) -> None:
    """Leave set-points and second encoders (n,) out of the roles that are slower than motion and effort.

    Raises InputError: motion and effort have no values in the same rows.
    """
    motion, effort = roles.motor or roles.motor_velocity, roles.effort or roles.effort_command
    needed = [name for name in (motion, effort) if name]
    slow = {name: step for name in roles.used if (step := rows_per_value(columns[name]))}
    if not slow or not needed:
        return
    common = np.logical_and.reduce([np.isfinite(columns[name]) for name in needed])
    if not common.any() or (set(slow) & set(needed) and rows_per_value(np.where(common, 0.0, np.nan)) is None):
        listed = " and ".join(f"{name} a number in one row of {slow[name]:g}" for name in needed if name in slow)
        raise InputError(
            f"{path}: {listed}, and not in the same rows: two rates in one file; if they have time columns of their "
            "own, write time: {column: NAME, unit: s} to the channels in a map; else export one rate"
        )
    for role in ("table", "command", "unfollowed", "velocity_command", "effort_command"):
        name = getattr(roles, role)
        if name in slow and name not in needed and np.mean(np.isfinite(columns[name][common])) < _SAME:
            setattr(roles, role, None)
            roles.left_out[name] = f"a number in one row of {slow[name]:g} only, {motion} in more"
            roles.unsure.append(f"{name}: has {roles.left_out[name]}: it is not used")
