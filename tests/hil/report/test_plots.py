"""Results draw themselves as matplotlib figures, and nothing loads matplotlib before."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from compare_runs import bench_with, record

from hil.errors import InputError
from hil.figures.panels import MEASURED, Line, Panel
from hil.identification.compare import compare
from hil.identification.measured import bench_of
from hil.motion.profile import load_profile
from hil.motion.trajectory import plan
from hil.report.plots import over_time

PROFILES = Path(__file__).parents[3] / "profiles"


def labels(figure: object) -> list[str]:
    return [axis.get_ylabel() for axis in figure.axes]  # type: ignore[attr-defined]


def test_values_beyond_single_precision_leave_a_gap_and_no_warning() -> None:
    values = np.array([0.0, 1e300, -np.inf, np.nan, 2.0])
    grid = over_time(np.arange(5.0), [Panel("torque", "N m", (Line("measured", values, MEASURED),))])
    drawn = grid.children[0][0].renderers[0].data_source.data["y0"]
    assert np.array_equal(np.isfinite(drawn), [True, False, False, False, True])


def test_a_trajectory_draws_its_set_points() -> None:
    trajectory = plan(load_profile(PROFILES / "reference.yaml"), 1e-3)
    figure = trajectory.plot()
    assert labels(figure) == ["position\n[mm]", "velocity\n[m/min]", "acceleration\n[m/s²]", "jerk\n[m/s³]"]
    position = figure.axes[0].lines[0].get_ydata()
    assert position.max() == pytest.approx(1e3 * trajectory.position_m.max())
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_a_recording_draws_the_channels_asked_for(tmp_path: Path) -> None:
    recording = record(tmp_path, bench_with())
    assert labels(recording.plot("torque_n_m"))[0].startswith("torque\n[")
    assert len(recording.plot().axes) == 6
    with pytest.raises(InputError, match="force_n is not recorded"):
        recording.plot("force_n")


def test_a_comparison_draws_the_axis_its_blocks_and_its_fastest_move(tmp_path: Path) -> None:
    recording = record(tmp_path, bench_with())
    result = compare(recording, bench_of(recording))
    whole, blocks, move = result.plot(), result.plot(blocks=True), result.plot(fastest_move=True)
    assert len(blocks.axes) == 2 * len(result.blocks)
    assert labels(whole)
    assert all("[" in label for label in labels(whole))
    (first, last), (begin, end) = move.axes[0].get_xlim(), whole.axes[0].get_xlim()
    assert begin < first < last < end


def test_matplotlib_is_loaded_by_the_first_plot_only() -> None:
    code = (
        "import sys, hil.loop.session, hil.motion.trajectory, hil.recording.recording, hil.identification.compare, "
        "hil.identification.friction, hil.diagnosis.diagnose; sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
