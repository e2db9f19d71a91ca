"""Every format of `hil export`: what comes back is the recording, bit by bit."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from exported import FORMATS, assert_same
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from hil.channels import CHANNELS
from hil.exchange.export import export_recording
from hil.exchange.own_file import read_exported
from hil.recording.recording import Recording, read_recording, write_parquet
from hil.recording.stamps import LARGEST

NUMBERS = st.floats(-LARGEST, LARGEST, allow_nan=False)
TEXTS = st.text(st.characters(codec="utf-8"), max_size=20)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | TEXTS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=8,
)
OTHERS = sorted(set(CHANNELS) - {"time_s", "motor_position_m", "motor_velocity_m_s"})
PART = 250  # rows


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    """A recording as a file holds it: of both kinds, with gaps, any numbers, and metadata of any shape."""
    period_s = draw(st.sampled_from([1e-3, 2.5e-4, 0.004, 1 / 3000]))
    gaps = draw(st.lists(st.integers(11, 5000), max_size=2))
    ticks = np.concatenate([np.arange(PART) + number * PART + sum(gaps[:number]) for number in range(len(gaps) + 1)])
    columns = {"time_s": draw(st.sampled_from([0.0, 0.25, 1e3])) + ticks * period_s}
    motion = draw(st.sampled_from([("motor_position_rad", "torque_n_m"), ("motor_position_m", "force_n")]))
    for name in dict.fromkeys([*motion, *draw(st.sets(st.sampled_from(OTHERS), max_size=4))]):
        columns[name] = np.tile(draw(hnp.arrays(np.float64, PART, elements=NUMBERS)), len(gaps) + 1)
    metadata = draw(st.dictionaries(st.sampled_from(["seed", "about", "ß 名", "bench"]), JSON, max_size=3))
    metadata |= draw(st.sampled_from([{}, {"start_time": "2026-02-03T04:05:06+0100"}, {"start_time": "virtual time"}]))
    return Recording("run", columns, period_s, metadata)


@pytest.mark.parametrize("ending", FORMATS)
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(made=recordings())
def test_a_round_trip_loses_nothing(ending: str, made: Recording) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_parquet(made, folder / "run.parquet")
        recording = read_recording(folder / "run.parquet")
        with warnings.catch_warnings():
            if ending == ".mf4":
                warnings.simplefilter("ignore")
            export_recording(recording, folder / f"run{ending}")
            back = read_exported(folder / f"run{ending}")
    assert back is not None
    assert_same(back, recording)
