"""Columns of a foreign recording with known truth: an axis that moves there and back under inertia and friction."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

INERTIA_KG_M2, COULOMB_N_M, VISCOUS_N_M_S_RAD = 2.0e-3, 0.4, 0.01
LEAD_M = 0.010


def axis(
    rows: int = 4000, rate_hz: float = 1000.0, inertia_kg_m2: float | np.ndarray = INERTIA_KG_M2
) -> dict[str, np.ndarray]:
    """t [s], x_set, x_act [mm], motor angle [rad], speed [rad/s], torque [N m] of a screw of 10 mm.

    The inertia is one value, or one for each row.
    """
    random = np.random.default_rng(1)
    t = np.arange(rows) / rate_hz
    phases = ((30.0, 0.5, 0.0), (12.0, 1.3, 1.0), (4.0, 3.1, 2.0))
    angle, speed, acceleration = (np.zeros(rows) for _ in range(3))
    for size, frequency, phase in phases:
        w = 2 * np.pi * frequency
        angle += size * (np.sin(w * t + phase) - np.sin(phase))
        speed += size * w * np.cos(w * t + phase)
        acceleration -= size * w**2 * np.sin(w * t + phase)
    torque = inertia_kg_m2 * acceleration + VISCOUS_N_M_S_RAD * speed + COULOMB_N_M * np.sign(speed)
    count = 2 * np.pi / 2**17
    ratio_mm = 1e3 * LEAD_M / (2 * np.pi)
    late = np.interp(t + 0.004, t, angle, right=angle[-1])  # the set-point comes before the motion
    return {
        "t": t,
        "x_set": ratio_mm * late,
        "x_act": np.round(ratio_mm * angle / 1e-4) * 1e-4,
        "angle": np.round(angle / count) * count,
        "speed": speed + random.normal(0.0, 0.01, rows),
        "torque": torque + random.normal(0.0, 0.01, rows),
    }


def csv_text(
    columns: dict[str, np.ndarray], delimiter: str = ",", comma: bool = False, above: str = "", below: str = ""
) -> str:
    """Text of a CSV file; `above` stands over the header, `below` between header and numbers."""
    lines = [delimiter.join(columns)]
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    numbers = [
        delimiter.join(f"{value:.9g}" if isinstance(value, float) else str(value) for value in row) for row in rows
    ]
    text = "\n".join(numbers)
    return above + lines[0] + "\n" + below + (text.replace(".", ",") if comma else text) + "\n"


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Write columns in the format of the ending: csv, mat, parquet or json."""
    if path.suffix == ".mat":
        from scipy.io import savemat

        savemat(path, columns)
    elif path.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table(columns), path)
    elif path.suffix == ".json":
        path.write_text(json.dumps({name: values.tolist() for name, values in columns.items()}))
    else:
        path.write_text(csv_text(columns), encoding="utf-8")
    return path


def renamed(columns: dict[str, np.ndarray], **names: str) -> dict[str, np.ndarray]:
    """The columns with other names; those without one are left out."""
    return {new: columns[old] for old, new in names.items()}


def answered(map_text: str, **values: object) -> str:
    """Text of a drafted map with `values` in place of the keys that it asks."""
    for key, value in values.items():
        map_text = re.sub(rf"^( *{key}:)   # <-- write:.*$", rf"\1 {value}", map_text, count=1, flags=re.MULTILINE)
    return map_text
