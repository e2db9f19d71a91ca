"""Each form that docs/recordings.md lists, imported without a map: period, angle and torque are as known."""

from __future__ import annotations

import importlib.util
import re
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from channel_files import LIBRARIES
from dialects import ANGLE, DIALECTS, TORQUE

from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text
from hil.importing.records import read_records

# the units of the columns are not in these: the map asks for them; with rad the result is in other units
WITHOUT_UNITS = {
    "LinuxCNC halsampler", "ODrive, JSON", "EPICS camonitor", "EPICS camonitor, on change",
    "TwinCAT Scope, without a header", "moteus, CSV", "NumPy, matrix .npy", "ROS, ros2 topic echo --csv",
}  # fmt: skip
WITHOUT_A_CLOCK = {"LinuxCNC halsampler": 1000.0, "TwinCAT Scope, without a header": 1000.0}
DOCUMENT = Path(__file__).parents[3] / "docs" / "recordings.md"


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_is_imported_without_a_map(tmp_path: Path, dialect: str) -> None:
    ending, write = DIALECTS[dialect]
    library = LIBRARIES.get(ending)
    if library and importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is an optional extra and not installed")
    path, map_path = tmp_path / f"axis.{ending}", tmp_path / "map.yaml"
    with warnings.catch_warnings():
        if library:
            warnings.simplefilter("ignore")
        write(path)
        draft = draft_map(path, WITHOUT_A_CLOCK.get(dialect))
        map_path.write_text(answered(map_text(draft)))
        recording = import_recording(path, map_path)
    assert recording.period_s == pytest.approx(1e-3, rel=1e-4)
    rows = len(recording)
    assert rows >= ANGLE.size - 1
    found, given = recording[recording.axis.motor_position], ANGLE[-rows:]
    if dialect in WITHOUT_UNITS:
        found = found * np.ptp(given) / np.ptp(found)
    np.testing.assert_allclose(found - found[0], given - given[0], atol=4e-3)
    np.testing.assert_allclose(recording[recording.axis.torque], TORQUE[-rows:], atol=3e-3)


def answered(text: str) -> str:
    """The map with the first unit of those for which it asks."""
    return re.sub(r"unit: +# <-- write: .*?; write ([^,;]+)[,;].*", r'unit: "\1"', text)


def test_the_document_lists_the_dialects_that_are_tested() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    listed = " ".join(text[text.index("- Tested forms:") :].split("\n- ")[0].split())
    for dialect in DIALECTS:
        program = dialect.split(", ")[0].split()[0]
        assert program in listed, dialect


def test_values_that_are_older_than_three_intervals_are_held(tmp_path: Path) -> None:
    lines = [f"{k}.0 speed {k}" for k in range(20)] + ["0.0 state 1", "10.0 state 2", "19.0 state 2"]
    path = tmp_path / "long.txt"
    path.write_text("\n".join(lines))
    arrays = read_records(path).columns.lists
    np.testing.assert_array_equal(arrays["speed"], np.arange(20.0))
    np.testing.assert_array_equal(arrays["state"], [1.0] * 10 + [2.0] * 10)


def test_values_that_are_printed_late_are_put_in_order(tmp_path: Path) -> None:
    lines = [f"{k}.0 speed {k}" for k in (*range(8), 9, 8, *range(10, 20))] + [f"{k}.0 force {-k}" for k in range(20)]
    path = tmp_path / "long.txt"
    path.write_text("\n".join(lines))
    arrays = read_records(path).columns.lists
    np.testing.assert_array_equal(arrays["time"], np.arange(20.0))
    np.testing.assert_array_equal(arrays["speed"], np.arange(20.0))


def test_stamps_without_a_time_in_common_are_refused(tmp_path: Path) -> None:
    rows = (f"{k};{np.sin(k / 9):.4f};{0.5 * k + 5000};{np.cos(k / 9):.4f}" for k in range(1000))
    path = tmp_path / "pairs.csv"
    path.write_text("\n".join(["time [ms];angle [rad];time 2 [ms];torque [Nm]", *rows]))
    with pytest.raises(InputError, match=r"stamps of time \[ms\], time 2 \[ms\] have no time in common"):
        draft_map(path)


def test_an_extra_that_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "asammdf", None)
    path = tmp_path / "run.mf4"
    path.write_bytes(b"MDF     4.10")
    with pytest.raises(
        InputError, match=r"asammdf, which is not installed; install it: pip install 'hil-servo\[mf4\]'"
    ):
        draft_map(path)
