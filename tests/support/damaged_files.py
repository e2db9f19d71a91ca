"""Files of one simulated axis with one thing damaged or odd."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from foreign_axis import axis, csv_text, renamed, write

AXIS = axis(rows=3000)
NAMES = {"t": "time_s", "x_set": "position_setpoint_mm", "angle": "motor_angle_rad", "torque": "torque_Nm"}
GOOD = renamed(AXIS, **NAMES)
TEXT = csv_text(GOOD)
LINES = TEXT.splitlines()
HALF = len(AXIS["t"]) // 2
Make = Callable[[Path], Any]


def changed(**columns: Any) -> dict[str, np.ndarray]:
    """The good columns, some replaced by their short name; None leaves one out."""
    merged = AXIS | {name: values for name, values in columns.items() if values is not None}
    return renamed(merged, **{short: long for short, long in NAMES.items() if columns.get(short, 0) is not None})


def table(**columns: Any) -> Make:
    return lambda path: write(path, changed(**columns))


def text(content: str) -> Make:
    return lambda path: path.write_text(content)


def content(content: bytes) -> Make:
    return lambda path: path.write_bytes(content)


def with_lines(*at: tuple[int, str]) -> Make:
    """The good text with lines replaced."""
    lines = list(LINES)
    for index, line in at:
        lines[index] = line
    return text("\n".join(lines) + "\n")


def in_rows(name: str, rows: slice, value: Any) -> dict[str, Any]:
    values = AXIS[name].copy()
    values[rows] = value(values[rows]) if callable(value) else value
    return {name: values}


def field(row: int, index: int, value: str) -> tuple[int, str]:
    fields = LINES[row].split(",")
    fields[index] = value
    return row, ",".join(fields)


def shuffled() -> dict[str, np.ndarray]:
    order = np.random.default_rng(3).permutation(len(AXIS["t"]))
    return {name: values[order] for name, values in GOOD.items()}


def cut(ending: str, share: float) -> Make:
    def make(path: Path) -> None:
        write(path, GOOD)
        whole = path.read_bytes()
        path.write_bytes(whole[: int(share * len(whole))])

    assert ending
    return make


def two_rates() -> dict[str, np.ndarray]:
    rows = np.r_[0:HALF, HALF : len(AXIS["t"]) : 4]
    return {name: values[rows] for name, values in GOOD.items()}


def unequal(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {**GOOD, "torque_Nm": GOOD["torque_Nm"][::4], "motor_angle_rad": GOOD["motor_angle_rad"][::4]})


def every_fourth(name: str) -> str:
    """Text in which a column has a number in every fourth row only."""
    index = list(NAMES.values()).index(name)
    return (
        "\n".join(line if row % 4 == 1 or row == 0 else field(row, index, "")[1] for row, line in enumerate(LINES))
        + "\n"
    )


RANDOM = np.random.default_rng(4)
