"""Rows of the conditions of axes as a worker writes them, made from levels, scatter and changes."""

from __future__ import annotations

from typing import Any

import numpy as np

from hil.fleet.quantities import QUANTITIES
from hil.fleet.store import Store

LEVELS = {
    "coulomb_forward": (1.2, 0.03), "coulomb_back": (1.25, 0.03), "viscous_forward": (5e-3, 2e-4),
    "viscous_back": (5e-3, 2e-4), "ripple": (0.02, 1e-3), "reversal": (8e-6, 3e-7), "quadrant": (6e-5, 3e-6),
    "stiffness": (2e8, 2e6), "lead_error": (2e-6, 5e-8), "lead_slope": (1e-6, 5e-7), "table_delay": (3e-5, 5e-7),
    "torque_delay": (5e-4, 3e-5), "inertia": (2.7e-3, 2e-6), "twin_left": (0.03, 2e-3),
}  # fmt: skip
BEGIN_DAY = 20089.0  # 2025-01-01


def rows_of(
    axis: str, count: int, seed: int, steps: dict[str, tuple[int, float]] | None = None, *, every_days: float = 7.0,
    slopes: dict[str, float] | None = None, untold: dict[str, str] | None = None,
) -> list[dict[str, Any]]:  # fmt: skip
    """Rows of `count` recordings: steps as quantity -> (recording, size in levels), slopes in levels a recording."""
    rng = np.random.default_rng(seed)
    rows = []
    for at in range(count):
        name = f"{axis}/{at:04d}.parquet"
        row: dict[str, Any] = {"id": f"{axis}-{at}", "axis": axis, "file": name, "status": "good", "reason": ""}
        row["moment"] = 86400.0 * (BEGIN_DAY + every_days * at)
        for quantity in QUANTITIES:
            level, scatter = LEVELS[quantity.name]
            begin, size = (steps or {}).get(quantity.name, (0, 0.0))
            wear = 1.0 + size * (at >= begin) + (slopes or {}).get(quantity.name, 0.0) * at
            value = float(level * wear + scatter * rng.standard_normal())
            reason = (untold or {}).get(quantity.name, "")
            row |= {
                quantity.name: None if reason else value,
                f"{quantity.name}_error": None if reason else 0.3 * scatter,
                f"{quantity.name}_reason": reason,
            }
        rows.append(row)
    return rows


def write_conditions(results: Store, axis: str, rows: list[dict[str, Any]]) -> None:
    """Write rows as `hil fleet compare` leaves them."""
    from hil.fleet.fleet import CONDITION, CONDITION_COLUMNS, INDEX, INDEX_COLUMNS

    channels = "time_s,motor_position_rad,torque_n_m"
    results.write_rows(CONDITION, axis, [row | {"moment": None} for row in rows], CONDITION_COLUMNS)
    looked = [{key: row[key] for key in ("id", "axis", "file", "status", "reason", "moment")} for row in rows]
    results.write_rows(INDEX, axis, [row | {"channels": channels} for row in looked], INDEX_COLUMNS)
