"""Formats of `hil export` as parameters of a test, and the comparison of what comes back."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from channel_files import LIBRARIES

from hil.exchange.export import WRITERS
from hil.recording.recording import Recording


def needs(ending: str) -> pytest.MarkDecorator:
    """Skip where the optional library of a format is not installed."""
    library = LIBRARIES.get(ending.removeprefix("."))
    absent = library is not None and importlib.util.find_spec(library) is None
    return pytest.mark.skipif(absent, reason=f"{library} is an optional extra and not installed")


FORMATS = [pytest.param(ending, marks=needs(ending)) for ending in WRITERS]


def short_run() -> Recording:
    """Two parts of 300 rows with a gap, and metadata of a run."""
    ticks = np.r_[np.arange(300), np.arange(900, 1200)]
    phase = ticks * 0.01
    columns = {
        "time_s": ticks * 1e-3,
        "position_command_m": 0.01 * np.sin(phase),
        "motor_position_rad": 2 * np.pi * np.sin(phase),
        "table_position_m": 0.01 * np.sin(phase + 1e-3),
        "torque_command_n_m": np.cos(phase) / 3.0,
        "torque_n_m": np.cos(phase) / 3.0 + 0.01,
        "twin_torque_n_m": np.cos(phase) / 3.0,
        "drive_state": np.full(600, 4.0),
    }
    metadata = {"seed": 3, "start_time": "2026-02-03T04:05:06+0100", "bench": {"name": "Achse 1", "lead_m": 0.01}}
    return Recording("run", columns, 1e-3, metadata)


def assert_same(one: Recording, other: Recording) -> None:
    """Name, period, metadata, parts, and every column bit by bit."""
    assert (one.name, one.period_s, one.metadata) == (other.name, other.period_s, other.metadata)
    assert set(one.columns) == set(other.columns)
    for name, values in other.columns.items():
        assert one[name].tobytes() == values.tobytes(), name
    assert [(part.start_s, len(part)) for part in one.parts()] == [(part.start_s, len(part)) for part in other.parts()]
