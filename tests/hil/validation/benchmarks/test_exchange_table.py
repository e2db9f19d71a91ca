"""The table of formats: every column of it can fail."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import pytest
from exported import needs, short_run

from hil.recording.recording import Recording
from hil.validation.benchmarks import exchange


@pytest.mark.parametrize("ending", [pytest.param(one, marks=needs(one)) for one in exchange.OPENERS])
def test_a_format_keeps_all(ending: str, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        if "asammdf" in sys.modules:
            warnings.simplefilter("ignore")
        run = short_run()
        run = Recording(run.name, run.columns, run.period_s, {"start_time": "2026-02-03T04:05:06+0100"})
        row = exchange.measure(run, ending, tmp_path)
    # the gap of this run gives metadata of its own when it is read
    assert row[:5] == [ending, "8/8", "8/8", "no", "yes"]
    assert row[-1] in ("asammdf", "mcap", "pyarrow", "scipy", "h5py")


@pytest.mark.parametrize("ending", [".blf", ".asc", ".log"])
def test_a_log_keeps_the_positions(ending: str, tmp_path: Path) -> None:
    row = exchange.measure_log(200, ending, tmp_path)
    assert row[:5] == [ending, "7", "-", "-", "yes"]
    assert row[-1] == "python-can"
